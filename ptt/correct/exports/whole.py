"""Atomic writing of several files."""

import os
from collections.abc import Mapping
from pathlib import Path

from ptt.digests import beside, is_kept, note_written
from ptt.files import cannot_write, put_beside, put_digest, require_plain, sweep
from ptt.folders import recover_folder, write_folder


def write_all(texts: Mapping[Path, str | bytes]) -> tuple[Path, ...]:
    """Write files that belong together.

    A folder that is new, or holds nothing but them, is exchanged as one: an interrupted process leaves either the old
    or the new files. Among other files, which stay, they are written to temporary names and renamed once all of them
    are on disk. A link is followed; temporary files of processes that died are removed.

    Args:
        texts: where to -> content, text as UTF-8; missing folders are made.

    Returns:
        The files, in the given order.

    Raises:
        InputError: a folder cannot be made or written.
        HostError: the disk is full.
    """
    data = {path: text.encode() if isinstance(text, str) else text for path, text in texts.items()}
    kept = [path for path in data if is_kept(path)]
    if _alone(data):
        _exchange(data)
    else:
        _rename(data)
    for path in data:
        note_written(path)
    for path in kept:
        put_digest(path)
    return tuple(texts)


def _alone(data: Mapping[Path, bytes]) -> bool:
    """Whether several files are the only content of their folder; the current folder is never exchanged."""
    folders = {path.parent for path in data}
    if len(data) < 2 or len(folders) > 1:
        return False
    (folder,) = folders
    recover_folder(folder)
    if not os.path.lexists(folder):
        return True
    if not folder.is_dir() or folder.is_symlink() or Path.cwd().is_relative_to(folder.resolve()):
        return False
    own = {path.name for path in data} | {beside(path).name for path in data}
    return all(each.name in own and each.is_file() and not each.is_symlink() for each in folder.iterdir())


def _exchange(data: Mapping[Path, bytes]) -> None:
    folder = next(iter(data)).parent
    with write_folder(folder, frozenset(each.name for path in data for each in (path, beside(path)))) as new:
        for path, content in data.items():
            (new / path.name).write_bytes(content)


def _rename(data: Mapping[Path, bytes]) -> None:
    ready: dict[Path, str] = {}
    try:
        for path, content in data.items():
            target = Path(os.path.realpath(path))
            require_plain(target, path)
            target.parent.mkdir(parents=True, exist_ok=True)
            sweep(target)
            ready[target] = put_beside(target, (content,))
        for path, name in list(ready.items()):
            os.replace(name, path)
            del ready[path]
    except OSError as error:
        raise cannot_write(str(error.filename or next(iter(data))), error) from None
    finally:
        for name in ready.values():
            Path(name).unlink(missing_ok=True)
