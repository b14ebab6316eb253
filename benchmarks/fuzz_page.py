"""What the studio's worker does with files that were dropped on its page, as if it were a verb of the fuzzer."""

import os
import shutil
import sys
from pathlib import Path
from typing import Any

ODD_NAMES = (
    "run.csv",
    "../../run.csv",
    "model.toml",
    "\udcff.csv",
    "a\nb.csv",
    "",
    ".",
    "x" * 3000,
    "CON",
    "ü (2).CSV",
)


def run_page(words: list[str]) -> int:
    """Upload files into a session's folder and do one job on them.

    Args:
        words: the job and the files that it takes: 'peek', 'look', 'describe' or 'predict'.

    Returns:
        As a verb does: 0 done, 2 where the page shows why not, in one line on standard error.
    """
    from ptt.errors import PttError
    from ptt.show.studio import jobs
    from ptt.show.studio.worker import _answer

    job, *given = words
    contents = [_content(Path(name)) for name in given]
    home = Path("page")
    home.mkdir()
    os.chdir(home)
    try:
        arguments = _arguments(job, given, contents)
        kind, *told = _answer(_Nobody(), getattr(jobs, job), arguments)  # type: ignore[arg-type]
    except PttError as refused:
        kind, told = "failed", [" ".join(str(refused).split())]
    finally:
        os.chdir("..")
        shutil.rmtree(home)
    if kind == "done":
        return 0
    print(f"error: {kind if kind != 'failed' else told[0]}", file=sys.stderr)
    return 2


class _Nobody:
    """A page that watches no progress and never asks to leave off."""

    def send(self, _: Any) -> None:
        """Nothing."""

    def poll(self) -> bool:
        """Whether it asks to leave off."""
        return False


def _content(path: Path) -> bytes:
    from ptt.show.studio.opening import zipped

    if path.is_dir():
        return zipped(path.iterdir(), path.parent)
    return path.read_bytes() if path.is_file() else b""  # a browser hands over nothing but what is in files


def _arguments(job: str, given: list[str], contents: list[bytes]) -> list[Any]:
    """What a job takes: the run as a source, the machine as text or the compensator zipped, targets by name."""
    from ptt.show.studio.results import Source
    from ptt.show.studio.uploads import keep_upload

    here = Path()
    if job == "describe":
        return [_text(contents[0])]
    name = ODD_NAMES[len(contents[0]) % len(ODD_NAMES)]  # as odd as the content: a case is the same each time
    source = Source(keep_upload(here, name, contents[0]))
    if job == "peek":
        return [source]
    if given[1] == "comp":
        Path("compensator").mkdir()
    model = contents[1] if given[1] == "comp" else _text(contents[1])
    others = zip(given[2:], contents[2:], strict=True)
    return [source, model, *(keep_upload(here, other, data) for other, data in others)]


def _text(data: bytes) -> str:
    """As the page reads a machine file that was dropped on it."""
    from ptt.errors import InputError

    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not UTF-8 text", where="machine.toml", fix="save it as UTF-8") from None
