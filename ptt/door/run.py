"""A tracker run, or a list of targets, as `ptt.read` and `ptt.read_targets` understand it."""

import html
import shutil
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ptt.door.model import Model, as_model
from ptt.door.options import Reading
from ptt.door.reading import read_rows
from ptt.door.result import Note, unheard
from ptt.errors import InputError
from ptt.run.readers import Ask
from ptt.run.table import Table, table_to_frame

if TYPE_CHECKING:
    import pandas as pd

FRAME = "frame.csv"  # what a data frame is called where a file's name is wanted
ANSWERS = "answers.toml"
RowsLike = Any  # a path, a data frame, an array of positions, or something read before


@dataclass(frozen=True, eq=False, repr=False)
class Rows:
    """Rows of a file, and how they were read.

    Attributes:
        table: the rows, in travel order.
        files: what they were read from, in the order given.
        reading: how.
        notes: what was understood of the files, a line each.
    """

    table: Table
    files: tuple[Path, ...]
    reading: Reading
    notes: tuple[str, ...] = ()
    _kept: tuple[object, ...] = field(default=(), repr=False)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.table.rows

    def __len__(self) -> int:
        return self.table.rows

    def to_frame(self) -> "pd.DataFrame":
        """Columns of the file format, in its units; columns without content are left out."""
        return table_to_frame(self.table)

    def __str__(self) -> str:
        """What was understood."""
        return "\n".join([f"{self.table.source}: {self.rows} rows", *self.notes])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """The text, for a notebook."""
        return f"<pre>{html.escape(str(self))}</pre>"


AnyRows = TypeVar("AnyRows", bound=Rows)


class Run(Rows):
    """A tracker run: targets or joint commands, and readings."""


class Targets(Rows):
    """Tool positions to reach, in travel order."""


def read(
    run: RowsLike,
    model: Model | str | Path,
    *,
    also: Sequence[RowsLike] = (),
    targets: RowsLike = None,
    set: Mapping[str, float | str] | None = None,
    map: str | Path | Mapping[str, Any] | None = None,
    context: Sequence[str] = (),
) -> Run:
    """Read a tracker run.

    Args:
        run: a CSV or an export of tracker software; a data frame with the columns of one is taken as well.
        model: the machine, which says how many joints there are.
        also: further runs.
        targets: the targets of an export that holds readings only: a file, a data frame, or an array (n, 3) in mm.
        set: column -> one value for all rows, as {"payload_kg": 2}; {"order": "time"} sorts the rows.
        map: saved answers on columns and units, a file or what is in one: {"columns": {"Pos X": "x_meas"}}.
        context: titles of columns of your own, with a number in every pose, that the error may depend on.

    Returns:
        The run. What in its set-up looks mistaken is said by whoever uses it, or by `check`.

    Raises:
        InputError: it cannot be read; the message names file, row, column and a way out.
    """
    machine = as_model(model, "read(run, model)")
    given = (run, *((also,) if isinstance(also, str | Path) else also))
    usage = "read(run, model)"
    written = [_file_of(each, usage, f"data frame {number}".removesuffix(" 1")) for number, each in enumerate(given, 1)]
    paths = [each.path for each in written]
    beside = None if targets is None else _file_of(_positions(targets), usage, "targets")
    answers = _answers(map)
    reading = Reading(paths[1:], _path(beside), _pairs(set), _path(answers), json=True, context=_titles(context))
    written += [each for each in (beside, answers) if each is not None]
    with _worded(written):
        return _renamed(read_path(paths[0], machine, reading), written)


def read_path(path: str | Path, model: Model, reading: Reading, *, ask: Ask | None = None, note: Note = unheard) -> Run:
    """Read a run as the command line does.

    Args:
        path: the file.
        model: the machine.
        reading: how.
        ask: who answers what the file leaves open; None makes that an error.
        note: told what was understood.

    Returns:
        The run.
    """
    table = read_rows(path, model.file, reading, checked=True, ask=ask, note=note)
    return Run(table, (Path(path), *map(Path, reading.also or ())), reading, tuple(table.understood.lines))


def read_targets(
    targets: RowsLike,
    model: Model | str | Path,
    *,
    set: Mapping[str, float | str] | None = None,
    map: str | Path | Mapping[str, Any] | None = None,
) -> Targets:
    """Read tool positions to reach.

    Args:
        targets: a CSV; a data frame, or an array (n, 3) in mm, is taken as well.
        model: the machine.
        set: column -> one value for all rows, as {"payload_kg": 2}.
        map: saved answers on columns and units, a file or what is in one.

    Returns:
        The targets.

    Raises:
        InputError: they cannot be read.
    """
    machine = as_model(model, "read_targets(targets, model)")
    written = [_file_of(_positions(targets), "read_targets(targets, model)")]
    answers = _answers(map)
    reading = Reading(set_=_pairs(set), map_=_path(answers), json=True)
    written += [each for each in (answers,) if each is not None]
    with _worded(written):
        return _renamed(targets_path(written[0].path, machine, reading), written)


def targets_path(
    path: str | Path, model: Model, reading: Reading, *, ask: Ask | None = None, note: Note = unheard
) -> Targets:
    """Read targets as the command line does; arguments as `read_path`."""
    table = read_rows(path, model.file, reading, "targets", checked=True, ask=ask, note=note)
    return Targets(table, (Path(path),), reading, tuple(table.understood.lines))


@contextmanager
def as_file(given: RowsLike, usage: str) -> Iterator[Path]:
    """A file with the rows that were handed over.

    Args:
        given: a path; rows that were read before, a data frame, or an array of positions (n, 3) in mm.
        usage: how the verb is called.

    Yields:
        The path.

    Raises:
        InputError: it is something else.
    """
    written = _file_of(_positions(given), usage)
    with _worded([written]):
        yield written.path


class _Folder:
    """A folder that lives as long as whoever keeps it."""

    def __init__(self) -> None:
        self.path = Path(mkdtemp(prefix="ptt_"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


@dataclass(frozen=True)
class _File:
    """A file to read, and what it is called where it had to be written first."""

    path: Path
    called: str = ""
    folder: "_Folder | None" = None


def _pairs(values: Mapping[str, float | str] | None) -> list[str]:
    """The same as a person types it after --set."""
    if values is not None and not isinstance(values, Mapping):
        raise InputError(f"got a {type(values).__name__}", where="set", fix='write it as set={"payload_kg": 2}')
    return [
        f"{name}={value if isinstance(value, str) else repr(float(value))}" for name, value in (values or {}).items()
    ]


def _titles(given: Sequence[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(map(str, given))


def _path(given: "_File | None") -> Path | None:
    return None if given is None else given.path


def _answers(given: str | Path | Mapping[str, Any] | None) -> "_File | None":
    """The file of saved answers, written where they were handed over as a mapping."""
    if given is None or isinstance(given, str | Path):
        return None if given is None else _File(Path(given))
    if not isinstance(given, Mapping):
        usage = 'name a file, or write it as map={"columns": {"Pos X": "x_meas"}}'
        raise InputError(f"got a {type(given).__name__}", where="map", fix=usage)
    import tomlkit

    folder = _Folder()
    path = folder.path / ANSWERS
    path.write_text(tomlkit.dumps(given), encoding="utf-8")
    return _File(path, "map", folder)


def _file_of(given: RowsLike, usage: str, called: str = "data frame") -> _File:
    if isinstance(given, str | Path):
        return _File(Path(given))
    frame = given if hasattr(given, "to_csv") and hasattr(given, "columns") else None
    if frame is None and hasattr(given, "to_frame"):
        frame = given.to_frame()
    if frame is None:
        kind = "nothing" if given is None else f"a {type(given).__name__}"
        raise InputError(f"{usage}: got {kind} where rows belong", fix="give the path of a file, or a data frame")
    folder = _Folder()
    path = folder.path / FRAME
    frame.to_csv(path, index=False, lineterminator="\n")
    return _File(path, called, folder)


def _positions(given: RowsLike) -> RowsLike:
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


def _called(text: str, written: Sequence[_File]) -> str:
    """A text with data frames instead of the files that they were written to."""
    for each in written:
        text = text.replace(str(each.path), each.called) if each.called else text
    return text


@contextmanager
def _worded(written: Sequence[_File]) -> Iterator[None]:
    """Errors speak of data frames, not of the files that they were written to."""
    try:
        yield
    except InputError as error:
        if type(error).__init__ is not InputError.__init__ or not any(each.called for each in written):
            raise
        what, where, fix = (_called(text, written) for text in (error.what, error.where, error.fix))
        raise type(error)(what, where=where, fix=fix) from None


def _renamed(rows: AnyRows, written: Sequence[_File]) -> AnyRows:
    """Rows that speak of data frames, too; their files stay as long as they do."""
    if not any(each.called for each in written):
        return rows
    labels = tuple(_called(label, written) for label in rows.table.run_label)
    table = rows.table.replace(source=_called(rows.table.source, written), run_label=labels)
    notes = tuple(_called(line, written) for line in rows.notes)
    return replace(rows, table=table, notes=notes, _kept=tuple(each.folder for each in written))
