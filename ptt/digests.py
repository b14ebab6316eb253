"""SHA-256 of files, and of which files one is kept beside them, as sha256sum writes and checks it."""

import hashlib
import os
import string
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ptt.errors import InputError

LARGEST = 4096  # bytes of a digest and the longest name of a file
_listening: list[list[Path]] = []


def sha256(path: str | Path) -> str:
    """Hash a file.

    Args:
        path: the file.

    Returns:
        SHA-256 as hexadecimal.
    """
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def listed() -> Iterator[list[Path]]:
    """List all files that are written within.

    Yields:
        The list, which grows.
    """
    written: list[Path] = []
    _listening.append(written)
    try:
        yield written
    finally:
        _listening.remove(written)


def note_written(path: str | Path) -> None:
    """Tell those who list that a file was written.

    Args:
        path: as it was named.
    """
    for written in _listening:
        written.append(Path(path))


def beside(path: str | Path) -> Path:
    """Where the digest of a file is kept: NAME.sha256."""
    return Path(path).with_name(f"{Path(path).name}.sha256")


def line_of(path: str | Path) -> bytes:
    """What is kept there."""
    return os.fsencode(f"{sha256(path)}  {Path(path).name}\n")


def is_kept(path: str | Path) -> bool:
    """Whether a digest of a file is kept beside it, right or not."""
    try:
        if not beside(path).is_file() or beside(path).stat().st_size > LARGEST:
            return False
        digest, _, name = os.fsdecode(beside(path).read_bytes()).partition(" ")
    except (OSError, ValueError):
        return False
    return len(digest) == 64 and set(digest) <= set(string.hexdigits) and name[1:] == f"{Path(path).name}\n"


def require_place(path: str | Path) -> None:
    """Refuse to keep a digest where something else is.

    Args:
        path: the file that the digest is of.

    Raises:
        InputError: beside it is a file of that name which is no digest of it.
    """
    if os.path.lexists(beside(path)) and not is_kept(path):
        raise InputError("is no SHA-256 of the file beside it", where=str(beside(path)), fix="move it away")
