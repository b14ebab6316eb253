"""A tracker run, or a list of targets, as `ptt.read` and `ptt.read_targets` understand it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ptt.door.handed import Handed, RowsLike, answers_of, called_in, file_of, pairs, path_of, positions, titles, worded
from ptt.door.model import Model, as_model
from ptt.door.options import ReadOptions
from ptt.door.reading import ask_once, beyond_travel, read_rows
from ptt.door.result import Note, ignore_note
from ptt.notebook import InNotebook
from ptt.run.blanks import fill_between
from ptt.run.conditions import settle_conditions
from ptt.run.readers import Ask
from ptt.run.readers.order import OrderError
from ptt.run.table import Table
from ptt.run.written import table_to_frame
from ptt.setup.order import find_disorder
from ptt.setup.setup import Setup

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Rows(InNotebook):
    """Rows of a file, and how they were read.

    Attributes:
        table: the rows, in travel order.
        files: what they were read from, in the order given.
        reading: how.
        notes: what was understood of the files, a line each.
    """

    table: Table
    files: tuple[Path, ...]
    reading: ReadOptions
    notes: tuple[str, ...] = ()
    _kept: tuple[object, ...] = field(default=(), repr=False)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.table.rows

    @property
    def of_frames(self) -> bool:
        """Whether data frames were given, so that files are temporary."""
        return bool(self._kept)

    def __len__(self) -> int:
        return self.table.rows

    def to_frame(self) -> "pd.DataFrame":
        """Columns of the file format, in its units; columns without content are left out."""
        return table_to_frame(self.table)

    def __str__(self) -> str:
        """What was understood."""
        return "\n".join([f"{self.table.source}: {self.rows} rows", *self.notes])

    __repr__ = __str__


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
    written = [file_of(each, usage, f"data frame {number}".removesuffix(" 1")) for number, each in enumerate(given, 1)]
    paths = [each.path for each in written]
    beside = None if targets is None else file_of(positions(targets), usage, "targets")
    answers = answers_of(map)
    reading = ReadOptions(paths[1:], path_of(beside), pairs(set), path_of(answers), json=True, context=titles(context))
    written += [each for each in (beside, answers) if each is not None]
    with worded(written):
        return _renamed(read_path(paths[0], machine, reading), written)


def read_path(
    path: str | Path, model: Model, reading: ReadOptions, *, ask: Ask | None = None, note: Note = ignore_note
) -> Run:
    """Read a run as the command line does.

    Args:
        path: the file.
        model: the machine.
        reading: how.
        ask: who answers what the file leaves open; None makes that an error.
        note: told what was understood.

    Returns:
        The run; where time goes back again and again in it, as it stands, for the check of the set-up to say.

    Raises:
        InputError: it cannot be read, or time goes back once, which may be a clock that was set.
    """
    ask = ask and ask_once(ask)
    try:
        table = read_rows(path, model.file, reading, checked=True, ask=ask, note=note)
    except OrderError:
        table = read_rows(path, model.file, reading, checked=True, ordered=False, ask=ask, note=note)
        if not any(found.sure for found in find_disorder(Setup(model.file, table))[0]):
            raise
    table, settled = settle_conditions(table)
    lines = (*settled, *beyond_travel(model.file, table))
    for line in lines:
        note(line)
    files = (Path(path), *map(Path, reading.also or ()))
    return Run(table, files, reading, (*table.understood.lines, *lines))


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
    written = [file_of(positions(targets), "read_targets(targets, model)")]
    answers = answers_of(map)
    reading = ReadOptions(set_=pairs(set), map_=path_of(answers), json=True)
    written += [each for each in (answers,) if each is not None]
    with worded(written):
        return _renamed(targets_path(written[0].path, machine, reading), written)


def targets_path(
    path: str | Path, model: Model, reading: ReadOptions, *, ask: Ask | None = None, note: Note = ignore_note
) -> Targets:
    """Read targets as the command line does; arguments as `read_path`."""
    table, blanks = fill_between(read_rows(path, model.file, reading, "targets", checked=True, ask=ask, note=note))
    for line in blanks:
        note(line)
    return Targets(table, (Path(path),), reading, (*table.understood.lines, *blanks))


def _renamed(rows: AnyRows, written: Sequence[Handed]) -> AnyRows:
    """Rows whose notes and labels name data frames instead of their files, which they keep alive."""
    if not any(each.called for each in written):
        return rows
    labels, files = (
        tuple(called_in(each, written) for each in names) for names in (rows.table.run_label, rows.table.files)
    )
    table = rows.table.replace(source=called_in(rows.table.source, written), run_label=labels, files=files)
    notes = tuple(called_in(line, written) for line in rows.notes)
    return replace(rows, table=table, notes=notes, _kept=tuple(each.folder for each in written))
