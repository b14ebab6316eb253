"""Which processes work on a store: each locks a file, which the system unlocks when the process ends, even killed."""

import os
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

if sys.platform == "win32":
    import msvcrt

    def _lock(file: Any) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: Any) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def owner(folder: Path) -> Iterator[str]:
    """Give this process a name, with a locked file by which others can tell that it is alive.

    Args:
        folder: where the lock file lies.

    Yields:
        The name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    name = uuid.uuid4().hex
    path = folder / name
    with path.open("w") as file:
        _lock(file)
        file.write(f"{os.getpid()}\n")
        file.flush()
        try:
            yield name
        finally:
            path.unlink(missing_ok=True)


def alive(folder: Path, name: str) -> bool:
    """Whether the process of that name still runs: its file is locked. The file of one that ended is removed."""
    path = folder / name
    try:
        with path.open("r+") as file:
            _lock(file)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    path.unlink(missing_ok=True)
    return False
