"""Folders replaced whole or not at all, whatever happens on the way."""

import ctypes
import os
import platform
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ptt.errors import InputError
from ptt.files import cannot_write, left_behind, neighbour

OLD = ".old"
SWAP = {"Linux": ("renameat2", -100, 2), "Darwin": ("renameatx_np", -2, 2)}  # function, AT_FDCWD, flag of an exchange


@contextmanager
def write_folder(path: str | Path, own: frozenset[str]) -> Iterator[Path]:
    """Write a folder whole or not at all: a temporary neighbour, flushed to disk, then exchanged with the folder.

    Whoever is killed on the way leaves the old folder or the new one. What dead processes left is removed.

    Args:
        path: where to; missing folders above it are made.
        own: names of the files that such a folder holds.

    Yields:
        An empty folder to write them into.

    Raises:
        InputError: the folder holds anything else, which would be lost, or cannot be written.
    """
    target = Path(os.path.realpath(path))  # the rename would replace a link, not what it names
    require_own(target, own)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _sweep(target, own)
        new = neighbour(target)
        new.mkdir()
    except (OSError, ValueError) as error:
        raise cannot_write(path, error) from None
    try:
        yield new
        for each in [*new.iterdir(), new]:
            _flush(each)
        require_own(target, own)
        _put_in_place(new, target)
        _flush(target.parent)
    except OSError as error:
        raise cannot_write(path, error) from None
    finally:
        _remove(new, own)


def require_own(path: str | Path, own: frozenset[str]) -> None:
    """Refuse to replace a folder that holds more than the files that would replace it.

    Args:
        path: the folder; it need not be there.
        own: names of the files it may hold.

    Raises:
        InputError: it is a file, or holds anything else.
    """
    place = Path(path)
    if place.exists() and not place.is_dir():
        raise InputError("is a file, not a folder", where=str(place), fix="name another folder")
    other = _foreign(place, own) if place.exists() else []
    if other:
        what = f"holds '{other[0]}', which would be lost; nothing was written"
        raise InputError(what, where=str(place), fix="name a new folder, or move that file out")


def _foreign(folder: Path, own: frozenset[str]) -> list[str]:
    """What a folder holds beside our files, and beside what a broken writing of them or a file manager left."""
    names = {each.name for each in folder.iterdir()} - own - {".DS_Store"}
    return sorted(name for name in names if not name.startswith(tuple(f".{each}." for each in own)))


def _put_in_place(new: Path, target: Path) -> None:
    """Rename, or exchange where there is an old folder; `new` is the old one afterwards."""
    if not target.exists():
        os.rename(new, target)
    elif not _exchange(new, target):
        # No atomic exchange on this system: two renames, and `recover_folder` finishes what a kill left between them.
        aside = new.with_name(f"{new.name}{OLD}")
        os.rename(target, aside)
        os.rename(new, target)
        os.rename(aside, new)


def recover_folder(path: str | Path) -> None:
    """Put a folder back that was moved aside by a process that died before its successor was in place.

    Args:
        path: the folder.
    """
    target = Path(os.path.realpath(path))
    if target.exists() or not target.parent.is_dir():
        return
    for left in _left_folders(target):
        if left.name.endswith(OLD):
            os.rename(left, target)
            return


def _exchange(first: Path, second: Path) -> bool:
    """Exchange two folders in one step, False where system or file system has no such call."""
    name, here, flag = SWAP.get(platform.system(), ("", 0, 0))
    call = getattr(ctypes.CDLL(None), name, None) if name else None
    if call is None:
        return False
    code = call(here, os.fsencode(first), here, os.fsencode(second), ctypes.c_uint(flag))
    return bool(code == 0)


def _sweep(target: Path, own: frozenset[str]) -> None:
    """Remove what dead processes left beside a folder."""
    recover_folder(target)
    for left in _left_folders(target):
        _remove(left, own)


def _left_folders(target: Path) -> list[Path]:
    """Folders beside a target that processes of this machine left which are gone."""
    return [each for each in left_behind(target) if each.is_dir()]


def _remove(folder: Path, own: frozenset[str]) -> None:
    """Remove a folder of ours; one that anything was put into meanwhile stays."""
    if folder.is_dir() and not _foreign(folder, own):
        shutil.rmtree(folder, ignore_errors=True)


def _flush(path: Path) -> None:
    """Have a file or a folder's entries on disk before anything that follows."""
    if path.is_dir() and sys.platform == "win32":
        return  # a folder cannot be opened there
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
