"""Jobs about exports: the formats for a machine, and writing one of them."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ptt.progress import Progress
from ptt.show.studio.opening import place_of, zipped
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
    from ptt.correct.exports.registry import find_format
    from ptt.door.exporting import export_as
    from ptt.door.model import load

    tell("writing it", 0, 0)
    shutil.rmtree(FOLDER, ignore_errors=True)
    Path(FOLDER).mkdir()
    chosen, place = find_format(to), place_of(model)
    loaded = load(place, effects=source.effect_files)
    data = export_as(loaded, chosen, Path(FOLDER) / f"ptt-{to}", place, progress=tell).to_dict()
    files = sorted(path for path in Path(FOLDER).rglob("*") if path.is_file())
    if len(files) == 1:
        return data | {"name": files[0].name, "content": files[0].read_bytes()}
    return data | {"name": f"ptt-{to}.zip", "content": zipped(files, Path(FOLDER))}
