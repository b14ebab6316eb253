"""Rows passed as a path, a data frame or an array, turned into files for the readers."""

import shutil
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

from ptt.errors import InputError, WorkspaceError

FRAME = "frame.csv"  # file that a data frame is written to
ANSWERS = "answers.toml"
RowsLike = Any  # a path, a data frame, an array of positions, or something read before


@contextmanager
def as_file(given: RowsLike, usage: str) -> Iterator[Path]:
    """A file with the given rows.

    Args:
        given: a path; rows that were read before, a data frame, or an array of positions (n, 3) in mm.
        usage: how the verb is called.

    Yields:
        The path.

    Raises:
        InputError: it is something else.
    """
    written = file_of(positions(given), usage)
    with worded([written]):
        yield written.path


class _Folder:
    """A temporary folder that is deleted with this object."""

    def __init__(self) -> None:
        self.path = Path(mkdtemp(prefix="ptt_"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


@dataclass(frozen=True)
class Handed:
    """A file to read; of one written for a data frame, its name in messages and the folder that holds it."""

    path: Path
    called: str = ""
    folder: _Folder | None = None


def pairs(values: Mapping[str, float | str] | None) -> list[str]:
    """Values for all rows as typed after --set: 'name=value' each."""
    if values is not None and not isinstance(values, Mapping):
        raise InputError(f"got a {type(values).__name__}", where="set", fix='write it as set={"payload_kg": 2}')
    return [
        f"{name}={value if isinstance(value, str) else repr(float(value))}" for name, value in (values or {}).items()
    ]


def titles(given: Sequence[str]) -> tuple[str, ...]:
    """Titles of columns; a single one may stand by itself."""
    return (given,) if isinstance(given, str) else tuple(map(str, given))


def path_of(given: Handed | None) -> Path | None:
    """Path of a file, or None."""
    return None if given is None else given.path


def answers_of(given: str | Path | Mapping[str, Any] | None) -> Handed | None:
    """The file of saved answers, written first where they are a mapping."""
    if given is None or isinstance(given, str | Path):
        return None if given is None else Handed(Path(given))
    if not isinstance(given, Mapping):
        usage = 'name a file, or write it as map={"columns": {"Pos X": "x_meas"}}'
        raise InputError(f"got a {type(given).__name__}", where="map", fix=usage)
    import tomlkit

    folder = _Folder()
    path = folder.path / ANSWERS
    path.write_text(tomlkit.dumps(given), encoding="utf-8")
    return Handed(path, "map", folder)


def file_of(given: RowsLike, usage: str, called: str = "data frame") -> Handed:
    """The file of rows, written first where they are a data frame or were read before.

    Args:
        given: a path, a data frame, or rows.
        usage: how the verb is called, for messages.
        called: name of a data frame in messages.

    Raises:
        InputError: it is something else.
    """
    if isinstance(given, str | Path):
        return Handed(Path(given))
    frame = given if hasattr(given, "to_csv") and hasattr(given, "columns") else None
    if frame is None and hasattr(given, "to_frame"):
        frame = given.to_frame()
    if frame is None:
        kind = "nothing" if given is None else f"a {type(given).__name__}"
        raise InputError(f"{usage}: got {kind} where rows belong", fix="give the path of a file, or a data frame")
    folder = _Folder()
    path = folder.path / FRAME
    frame.to_csv(path, index=False, lineterminator="\n")
    return Handed(path, called, folder)


def positions(given: RowsLike) -> RowsLike:
    """Positions (n, 3) mm as a data frame; everything else as it is."""
    if given is None or isinstance(given, str | Path) or hasattr(given, "columns") or hasattr(given, "to_frame"):
        return given
    import pandas as pd

    try:
        place = np.atleast_2d(np.asarray(given, dtype=np.float64))
    except (TypeError, ValueError):
        place = np.empty((0, 0))
    if place.ndim != 2 or place.shape[1] != 3 or not len(place):
        what = "targets are an array (n, 3) in mm, a data frame, or the path of a file"
        raise InputError(what, where=f"a {type(given).__name__}")
    return pd.DataFrame(place, columns=["x_cmd", "y_cmd", "z_cmd"])


def called_in(text: str, written: Sequence[Handed]) -> str:
    """A text in which files written for data frames are replaced by the names of these."""
    for each in written:
        text = text.replace(str(each.path), each.called) if each.called else text
    return text


@contextmanager
def worded(written: Sequence[Handed]) -> Iterator[None]:
    """Replace the files written for data frames by the names of these in errors that are raised inside."""
    try:
        yield
    except InputError as error:
        rows = (error.rows,) if isinstance(error, WorkspaceError) else ()
        plain = bool(rows) or type(error).__init__ is InputError.__init__
        if not plain or not any(each.called for each in written):
            raise
        what, where, fix = (called_in(text, written) for text in (error.what, error.where, error.fix))
        raise type(error)(what, *rows, where=where, fix=fix) from None
