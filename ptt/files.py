"""Files read with a clear word when they cannot be, and written whole or not at all."""

import hashlib
import os
import tempfile
from pathlib import Path

from ptt.errors import InputError


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
        return Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise error("no such file", where=str(path), fix="check the path") from None
    except IsADirectoryError:
        raise error("is a folder, not a file", where=str(path)) from None
    except UnicodeDecodeError:
        raise error("is not UTF-8 text", where=str(path), fix="save it as UTF-8") from None


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file whole or not at all: a temporary neighbour, then a rename.

    Args:
        path: where to; missing folders are made.
        data: the content.

    Raises:
        InputError: the folder cannot be made or written.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", where=str(path), fix="check the folder") from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, 0o666 & ~mask)  # mkstemp makes files private; a result is as readable as any other file
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text whole or not at all.

    Args:
        path: where to; missing folders are made.
        text: the content.

    Raises:
        InputError: the folder cannot be made or written.
    """
    write_bytes(path, text.encode("utf-8"))


def sha256(path: str | Path) -> str:
    """Hash a file.

    Args:
        path: the file.

    Returns:
        SHA-256 as hexadecimal.
    """
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
