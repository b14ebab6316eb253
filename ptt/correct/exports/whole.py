"""Several files that appear together or not at all."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from ptt.digests import is_kept, note_written
from ptt.files import cannot_write, put_digest, require_plain, sweep, temporary


def write_all(texts: Mapping[Path, str | bytes]) -> tuple[Path, ...]:
    """Write files beside their names, and give them their names once all of them are on disk.

    Other files in the folders stay as they are; a link is followed; what processes that died left beside is removed.

    Args:
        texts: where to -> content, text as UTF-8; missing folders are made.

    Returns:
        The files, in the given order.

    Raises:
        InputError: a folder cannot be made or written.
        HostError: the disk is full.
    """
    ready: dict[Path, str] = {}
    try:
        for path, text in texts.items():
            target = Path(os.path.realpath(path))
            require_plain(target, path)
            ready[target] = _put_beside(target, text.encode() if isinstance(text, str) else text)
        for path, name in list(ready.items()):
            os.replace(name, path)
            del ready[path]
        for path in texts:
            note_written(path)
            if is_kept(path):
                put_digest(path)
    except OSError as error:
        raise cannot_write(str(error.filename or next(iter(texts))), error) from None
    finally:
        for name in ready.values():
            Path(name).unlink(missing_ok=True)
    return tuple(texts)


def _put_beside(path: Path, data: bytes) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    sweep(path)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=temporary(path))
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(handle)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, 0o666 & ~mask)  # mkstemp makes files private
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return name
