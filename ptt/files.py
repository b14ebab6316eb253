"""Files read with a clear word when they cannot be, and written whole or not at all."""

import errno
import os
import platform
import secrets
import stat
import sys
from collections.abc import Iterable
from pathlib import Path

from ptt.digests import beside, is_kept, line_of, note_written, require_place
from ptt.digests import sha256 as sha256
from ptt.errors import HostError, InputError, shown

LARGEST = 2 * 1024**3  # bytes; ten million rows of a tracker run are 1.5 GB
LARGEST_TOML = 64 * 1024**2  # bytes; a model of every effect with a thousand steps of history is 2 MB
FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO)


def read_bytes(path: str | Path, error: type[InputError] = InputError, largest: int = LARGEST) -> bytes:
    """Read a plain file.

    Args:
        path: the file.
        error: which error to raise.
        largest: bytes that it may have.

    Returns:
        Its content.

    Raises:
        InputError: it is missing, a folder, no plain file (a pipe may never end), too large, or unreadable (as the
            given `error` type).
    """
    require_file(path, error, largest)
    try:
        return Path(path).read_bytes()
    except OSError as failed:
        raise error(f"cannot be read ({failed.strerror})", where=str(path), fix="check the path") from None


def require_file(path: str | Path, error: type[InputError], largest: float) -> None:
    """Refuse what is no plain file to be read; arguments and errors as `read_bytes`."""
    where = str(path)
    try:
        about = os.stat(path)
        if stat.S_ISDIR(about.st_mode):
            raise error("is a folder, not a file", where=where, fix="name a file in it")
        if not stat.S_ISREG(about.st_mode):
            raise error("is not a plain file", where=where, fix="save it to a file first")
        if about.st_size > largest:
            what = f"{about.st_size / 1e6:.0f} MB, more than the {largest / 1e6:.0f} MB that are read at once"
            raise error(what, where=where, fix="cut it into several files")
        with open(path, "rb"):
            pass
    except FileNotFoundError:
        raise error("no such file", where=where, fix="check the path") from None
    except OSError as failed:
        raise error(f"cannot be read ({failed.strerror})", where=where, fix="check the path") from None
    except ValueError as failed:  # a zero byte or half a character in the name
        raise error(f"is not a file name ({failed})", where=shown(where), fix="check the path") from None


def read_text(path: str | Path, error: type[InputError] = InputError) -> str:
    """Read a UTF-8 text file.

    Args:
        path: the file.
        error: which error to raise.

    Returns:
        Its text.

    Raises:
        InputError: it is missing, a folder, or not UTF-8 (as the given `error` type).
    """
    try:
        return read_bytes(path, error, LARGEST_TOML).decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        raise error("is not UTF-8 text", where=str(path), fix="save it as UTF-8") from None


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file whole or not at all; arguments and errors as `write_parts`."""
    write_parts(path, (data,))


def write_parts(path: str | Path, parts: Iterable[bytes]) -> None:
    """Write a file whole or not at all, one part after the other: a temporary neighbour, flushed, then a rename.

    A link is followed. What processes that died left beside the file is removed. A digest that is kept beside it is
    kept true.

    Args:
        path: where to; missing folders are made.
        parts: the content, in order; each is made when it is written.

    Raises:
        InputError: the folder cannot be made or written, or the file is a folder.
        HostError: the disk is full, or the file larger than this process may write.
    """
    target = Path(os.path.realpath(path))
    try:
        require_plain(target, path)
        target.parent.mkdir(parents=True, exist_ok=True)
        sweep(target)
    except (OSError, ValueError) as failed:
        raise cannot_write(path, failed) from None
    try:
        _put_in_place(put_beside(target, parts), target)
    except OSError as failed:
        raise cannot_write(path, failed) from None
    note_written(path)
    if is_kept(path):
        put_digest(path)


def put_beside(target: Path, parts: Iterable[bytes]) -> str:
    """Write a temporary neighbour of a file, flushed to disk and as readable as any other file.

    Args:
        target: the file that a rename is to put in place, its folder there.
        parts: the content, in order.

    Returns:
        The neighbour's name.

    Raises:
        OSError: it cannot be written; then nothing is left of it.
    """
    name = str(neighbour(target))  # not by tempfile, whose files are private whatever the umask says
    handle = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        with os.fdopen(handle, "wb") as file:
            file.writelines(parts)
            file.flush()
            os.fsync(file.fileno())
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return name


def _put_in_place(name: str, target: Path) -> None:
    try:
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def put_digest(path: str | Path) -> None:
    """Write the SHA-256 of a file beside it, NAME.sha256.

    Args:
        path: the file.

    Raises:
        InputError: something else is there, or it cannot be written.
    """
    require_place(path)
    write_bytes(beside(path), line_of(path))


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text whole or not at all.

    Args:
        path: where to; missing folders are made.
        text: the content.

    Raises:
        InputError: the folder cannot be made or written.
        HostError: the disk is full, or the file larger than this process may write.
    """
    write_bytes(path, text.encode("utf-8"))


def require_plain(target: Path, path: str | Path) -> None:
    """Refuse to write where there is something else than a file: a rename would put an end to a folder or a device.

    Args:
        target: where to, links followed.
        path: the same as it was given, for the message.

    Raises:
        InputError: a folder, a device, a pipe.
    """
    if target.is_dir():
        raise InputError("is a folder, not a file", where=str(path), fix="name a file in it")
    if target.is_symlink():
        raise InputError("is a link that leads to itself", where=str(path), fix="name a file")
    if target.exists() and not target.is_file():
        raise InputError("is a device, not a file", where=str(path), fix="name a file")


def cannot_write(path: str | Path, failed: OSError | ValueError) -> InputError | HostError:
    """The error that says why a file cannot be written: of the system where it is full, else of the path.

    Args:
        path: where to.
        failed: what the system said.

    Returns:
        The error, not raised.
    """
    why = getattr(failed, "strerror", None) or str(failed)
    if getattr(failed, "errno", None) in FULL:
        return HostError(f"{path}: cannot be written ({why}); nothing was written; make room and try again")
    return InputError(f"cannot be written ({why})", where=shown(str(path), 200), fix="check the folder")


def temporary(target: Path) -> str:
    """How names of temporary neighbours of a file or folder begin: its own name, this machine, this process."""
    return f".{target.name}.{platform.node().replace('.', '-')}.{os.getpid()}."


def neighbour(target: Path) -> Path:
    """A temporary neighbour of a file or folder that is not there yet."""
    return target.parent / f"{temporary(target)}{secrets.token_hex(8)}"


def left_behind(target: Path) -> list[Path]:
    """Temporary neighbours of a file or folder, by processes of this machine that are gone."""
    start = f".{target.name}."
    with os.scandir(target.parent) as entries:
        names = [entry.name for entry in entries if entry.name.startswith(start)]
    return sorted(target.parent / name for name in names if _dead(name.removeprefix(start).split(".")))


def sweep(target: Path) -> None:
    """Remove temporary files that processes which are gone left beside a file."""
    for left in left_behind(target):
        if left.is_file() and not left.is_symlink():
            left.unlink(missing_ok=True)


def _dead(words: list[str]) -> bool:
    """Whether machine and process at the head of a leftover's name are this machine and a process that is gone."""
    if len(words) < 3 or words[0] != platform.node().replace(".", "-") or not words[1].isdecimal():
        return False
    if sys.platform == "win32":
        return False  # there, asking after a process by a signal would end it
    try:
        os.kill(int(words[1]), 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False
