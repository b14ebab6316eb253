"""Several files that appear together or not at all."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from ptt.errors import InputError


def write_all(texts: Mapping[Path, str | bytes]) -> tuple[Path, ...]:
    """Write files beside their names, and give them their names once all of them are on disk.

    Other files in the folders stay as they are.

    Args:
        texts: where to -> content, text as UTF-8; missing folders are made.

    Returns:
        The files, in the given order.

    Raises:
        InputError: a folder cannot be made or written.
    """
    ready: dict[Path, str] = {}
    try:
        for path, text in texts.items():
            ready[path] = _put_beside(path, text.encode() if isinstance(text, str) else text)
        for path, name in list(ready.items()):
            os.replace(name, path)
            del ready[path]
    except OSError as error:
        where = str(error.filename or next(iter(texts)))
        raise InputError(f"cannot be written ({error.strerror})", where=where, fix="check the folder") from None
    finally:
        for name in ready.values():
            Path(name).unlink(missing_ok=True)
    return tuple(texts)


def _put_beside(path: Path, data: bytes) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise IsADirectoryError(21, "is a folder", str(path))
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    with os.fdopen(handle, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(handle)
    mask = os.umask(0)
    os.umask(mask)
    os.chmod(name, 0o666 & ~mask)  # mkstemp makes files private
    return name
