"""Jobs about exports: the formats for a machine, and writing one of them."""

import io
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ptt.progress import Progress
from ptt.show.studio.opening import place_of
from ptt.show.studio.results import Source

FOLDER = "export"


def formats(kind: str, tell: Progress) -> tuple[tuple[str, str], ...]:
    """Names and descriptions of the formats that a machine can be exported to.

    Args:
        kind: kind of the machine.
        tell: told what is done.

    Returns:
        Name and description of each.
    """
    from ptt.correct.exports.registry import available

    return tuple((each.name, each.about) for each in available() if kind in each.mechanisms)


def export(source: Source, model: str | bytes, to: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt export`.

    Returns:
        Its JSON, with 'name' and 'content' of the file, a zip where there are several.
    """
    from ptt.show.studio.verbs import run_verb_json

    tell("writing it", 0, 0)
    shutil.rmtree(FOLDER, ignore_errors=True)
    Path(FOLDER).mkdir()
    out = Path(FOLDER) / f"ptt-{to}"
    effects = [word for file in source.effect_files for word in ("--effects", file)]
    data = run_verb_json(["export", "--model", str(place_of(model)), "--to", to, "--out", str(out), *effects])
    files = sorted(path for path in Path(FOLDER).rglob("*") if path.is_file())
    if len(files) == 1:
        return data | {"name": files[0].name, "content": files[0].read_bytes()}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, str(file.relative_to(FOLDER)))
    return data | {"name": f"ptt-{to}.zip", "content": buffer.getvalue()}
