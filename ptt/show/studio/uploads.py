"""Storing uploaded files in a session's folder: safe names, nothing overwritten, no programs."""

import unicodedata
from collections.abc import Iterator
from itertools import count
from pathlib import Path

from ptt.errors import InputError
from ptt.files import write_bytes
from ptt.show.studio.guard import LIMIT
from ptt.show.studio.results import ANSWERS, COLUMNS, EFFECTS, MENDED, SEAL, SEALS, Source

RESERVED = (  # names that the studio itself uses in a session's folder
    "model.toml", ANSWERS, COLUMNS, MENDED, "sliders.csv", "report.html", "compensator", "challenge", "export",
    "months", "later", "again.json", EFFECTS, SEAL, SEALS,
)  # fmt: skip


def keep_upload(folder: Path, name: str, data: bytes) -> str:
    """Store an uploaded file; nothing is overwritten.

    Args:
        folder: the session's folder.
        name: name as the browser gives it; folders in it are ignored.
        data: its content, never executed.

    Returns:
        The name in the folder, with a number where another file has that name; a file of the same content is reused.

    Raises:
        InputError: larger than the limit, or a program.
    """
    if len(data) > LIMIT:
        raise InputError(f"larger than {LIMIT >> 20} MB", where=safe_name(name), fix="split it")
    wanted = safe_name(name)
    if _folded(wanted).endswith(".py"):
        fix = "name your own effects when starting the studio: ptt studio --effects FILE.py"
        raise InputError("a program is not taken from the page", where=wanted, fix=fix)
    taken = {_folded(file.name): file for file in folder.iterdir()} | dict.fromkeys(RESERVED)
    for kept in _numbered(wanted):
        there = taken.get(_folded(kept))
        if _folded(kept) not in taken:
            write_bytes(folder / kept, data)
            return kept
        if there is not None and there.is_file() and there.read_bytes() == data:
            return there.name
    raise AssertionError  # never reached: `_numbered` does not end


def keep_seal(folder: Path, run: str, data: bytes) -> None:
    """Store the seal of a challenge beside its run: it is lost neither to other files nor to a run opened after it.

    Args:
        folder: the session's folder.
        run: name of the run's file in it.
        data: content of the seal.
    """
    place = folder / Source(run).sealed
    place.mkdir(parents=True, exist_ok=True)
    write_bytes(place / SEAL, data)


def keep_effects(folder: Path, name: str, data: bytes) -> None:
    """Store a file of effects, which will be executed: one named when the studio was started, or written by it.

    Args:
        folder: the session's folder.
        name: name of the file.
        data: its content.
    """
    place = folder / EFFECTS
    place.mkdir(exist_ok=True)
    write_bytes(place / name, data)


def safe_name(name: str) -> str:
    """A file name without folders or odd characters."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    kept = "".join(letter if letter.isalnum() or letter in "._- ()+" else "_" for letter in last).strip(". ")
    return kept[-100:] or "file"


def _numbered(name: str) -> Iterator[str]:
    """The name itself, then 'name (2)' and so on, the ending kept."""
    yield name
    place = Path(name)
    yield from (f"{place.stem} ({number}){place.suffix}" for number in count(2))


def _folded(name: str) -> str:
    """A name as compared by a file system that ignores case and Unicode normalisation."""
    return unicodedata.normalize("NFC", name).casefold()
