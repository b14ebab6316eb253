"""One file, in whatever form it comes, as columns of known quantity in the program's units."""

from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

import numpy as np

from ptt.errors import TableError, shown
from ptt.run.pasted import taken_as
from ptt.run.readers.clock import counts_days, goes_back, joined, with_date_for_time
from ptt.run.readers.columns import Column, Meaning, to_standard
from ptt.run.readers.footer import refuse_footer
from ptt.run.readers.head import titles_of, untitled
from ptt.run.readers.layout import understand
from ptt.run.readers.mapping import Ask, Mapping, Understood
from ptt.run.readers.numbers import read_cells, refuse_beyond
from ptt.run.readers.series import settle_likely
from ptt.run.readers.spatial_analyzer import check_axes, is_spatial_analyzer, reshape
from ptt.run.readers.stamps import read_seconds, through_a_night
from ptt.run.readers.text import RawText, read_text
from ptt.run.readers.told import understood_of


@dataclass(frozen=True)
class Request:
    """How a file is to be read.

    Attributes:
        purpose: 'run' (readings), 'targets' (poses wanted), 'sliders' (commands to send) or 'beside' (what the
            readings of another file were taken at).
        mapping: answers known beforehand.
        ask: who answers what is ambiguous; None makes that an error.
        joints: number k of joints of the machine; None where it is not known.
        letter: 'b' (sliders) or 'q' (joint angles).
    """

    purpose: str = "run"
    mapping: Mapping = field(default_factory=Mapping)
    ask: Ask | None = None
    joints: int | None = None
    letter: str = "b"


@dataclass(frozen=True)
class Export:
    """Columns of one file.

    Attributes:
        source: file name.
        columns: quantity -> (n,) float64 in the program's unit (NaN = empty), or str for name, role and run.
        extra: title -> (n,) str, columns that are no quantity, as written.
        line: (n,) int, line numbers in the file.
        understood: how the file was interpreted.
    """

    source: str
    columns: dict[str, np.ndarray]
    extra: dict[str, np.ndarray]
    line: np.ndarray
    understood: Understood

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.line)


def read_any(path: str | Path, request: Request | None = None) -> Export:
    """Read a tracker CSV or an export of tracker or robot software.

    Args:
        path: the file.
        request: purpose, known answers and who to ask.

    Returns:
        The columns and what was understood.

    Raises:
        TableError: whatever cannot be read, with file, row and column.
    """
    request = request or Request()
    return read_raw(read_text(path, request.mapping, request.ask), request)


def read_raw(raw: RawText, request: Request) -> Export:
    """Read the lines of a file, or some of them; arguments, return and errors as `read_any`."""
    check_axes(raw)
    notes, delimiter = list[str](), raw.delimiter
    if is_spatial_analyzer(raw):
        raw, notes = reshape(raw)
    raw, titles, meanings = titles_of(raw)
    machine = request.joints, request.letter
    columns = understand(titles, meanings, request.purpose, raw.source, request.mapping, request.ask, *machine)
    if not any(column.quantity for column in columns):
        _refuse_unknown(raw, titles)
    refuse_footer(raw, len(titles))
    if request.purpose == "run":
        _refuse_single(raw)
    cells = read_cells(raw, columns)
    columns, days = with_date_for_time(columns, cells, request.mapping, raw.decimal)
    every = [_read_column(raw, column, cells[column.index], request) for column in columns]
    read = _with_days([one for one in every if not _is_nothing(one)], days, raw, cells, request)
    known = {one.column.quantity: one.values for one in read if one.column.quantity}
    extra = _apart([(one.column.title, one.values) for one in read if not one.column.quantity])
    notes += [note for one in read for note in one.notes]
    notes += _copies(raw, known) if request.purpose == "run" else []
    dates = next((one.dates for one in read if one.dates), None)
    raw = replace(raw, delimiter=delimiter)
    columns = [one.column for one in read if one.column != days]
    understood = understood_of(raw, columns, notes, dates, request.mapping)
    return Export(raw.source, known, extra, raw.line, understood)


def read_titles(path: str | Path, request: Request) -> tuple[RawText, tuple[str, ...], list[Meaning | None]]:
    """The lines of a file, the titles of its columns, and what each title says by itself; nothing is asked.

    Args:
        path: the file.
        request: purpose and known answers.

    Returns:
        Lines, titles and meanings.

    Raises:
        TableError: the file cannot be cut into cells.
    """
    raw = read_text(path, request.mapping, request.ask)
    raw, titles, meanings = titles_of(reshape(raw)[0] if is_spatial_analyzer(raw) else raw)
    return raw, titles, settle_likely(meanings, request.joints, request.letter)


@dataclass(frozen=True)
class ReadColumn:
    """A column of a file, read.

    Attributes:
        column: its meaning; without a quantity where its values are kept as text.
        values: (n,) in the program's unit, or str.
        dates: order of day and month in its stamps, where that was needed.
        notes: what is to be said of it.
    """

    column: Column
    values: np.ndarray
    dates: str | None = None
    notes: tuple[str, ...] = ()


def _read_column(raw: RawText, column: Column, content: np.ndarray, request: Request) -> ReadColumn:
    """A column from its cells, (n,) numbers or str; damaged time stamps are kept aside."""
    if column.quantity and column.unit == "stamp":
        seconds, note, dates = read_seconds(content, raw, column.title, request.mapping.dates, request.ask)
        notes = (f"{column.title}: {note}",)
        if seconds is None:
            return ReadColumn(replace(column, quantity=""), content, dates, notes)
        refuse_beyond(raw, column, seconds)
        return ReadColumn(column, seconds, dates, notes)
    if not column.quantity or content.dtype.kind != "f":
        return ReadColumn(column, content)
    values, night = to_standard(content, column.quantity, column.unit), ""
    if column.quantity == "time":
        values, night = through_a_night(values)
    refuse_beyond(raw, column, values)
    return ReadColumn(column, values, notes=(f"{column.title}: seconds{night}",) if night else ())


def _with_days(
    read: list[ReadColumn], days: Column | None, raw: RawText, cells: dict[int, np.ndarray], request: Request
) -> list[ReadColumn]:
    """The columns with a continuous clock, by a column of dates or by spreadsheet day numbers."""
    place = next((place for place, one in enumerate(read) if one.column.quantity == "time"), None)
    if place is None:
        return read
    clock = read[place]
    if days is not None:
        clock = _with_dates(clock, days, raw, cells, request)
    others = {one.column.quantity: one.values for one in read if one.column.quantity}
    if clock.column.unit in ("s", "stamp") and counts_days(clock.column.title, clock.values, others):
        column = replace(clock.column, unit="day", note="as a spreadsheet counts them")
        clock = ReadColumn(column, to_standard(clock.values, "time", "day"))
    return [*read[:place], clock, *read[place + 1 :]]


def _with_dates(
    clock: ReadColumn, days: Column, raw: RawText, cells: dict[int, np.ndarray], request: Request
) -> ReadColumn:
    """Times of day with their dates, unless these cannot be read or stand still through a night."""
    try:
        dated = _read_column(raw, clock.column, joined(cells[days.index], cells[clock.column.index]), request)
    except TableError as error:
        return replace(clock, notes=(*clock.notes, f"dates of {days.title} not used: {error.what}"))
    if goes_back(dated.values) and not goes_back(clock.values):
        return replace(clock, notes=(*clock.notes, f"dates of {days.title} not used: time would go back"))
    return replace(dated, notes=(*dated.notes, f"{days.title}: the days of {clock.column.title}"))


def _apart(columns: list[tuple[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Columns that are no quantity by title, numbered where several have one, so that none replaces another."""
    titles, kept = {title for title, _ in columns}, dict[str, np.ndarray]()
    for title, values in columns:
        numbered = (f"{title} ({number})" for number in count(2))
        kept[title if title not in kept else next(one for one in numbered if one not in {*titles, *kept})] = values
    return kept


def _is_nothing(read: ReadColumn) -> bool:
    """Whether a column has neither a title nor a cell with something in it: a delimiter that ends every line."""
    column = read.column
    return column.title == untitled(column.index) and not column.quantity and not (read.values != "").any()


def _refuse_unknown(raw: RawText, titles: tuple[str, ...]) -> None:
    listed = ", ".join(map(shown, titles[:20]))
    raise TableError(
        f"no column is understood ({listed})",
        where=raw.source,
        fix="name the columns as in the tracker CSV, or say what they hold with --map FILE.toml",
    )


def _refuse_single(raw: RawText) -> None:
    if len(raw.body) == 1:
        where = f"{raw.source} row {raw.line[0]}"
        raise TableError("only one row; nothing can be learned from one reading", where=where, fix="measure more poses")


def _copies(raw: RawText, values: dict[str, np.ndarray]) -> list[str]:
    """A warning on rows identical in every column, which count as repeats; those without a reading may be alike."""
    if len(set(raw.body)) == len(raw.body):
        return []
    measured = [values[name] for name in ("x_meas", "y_meas", "z_meas") if name in values]
    read = (
        ~np.all([np.isnan(column) for column in measured], axis=0) if measured else np.ones(len(raw.body), dtype=bool)
    )
    seen: dict[str, int] = {}
    copied = [index for index, line in enumerate(raw.body) if seen.setdefault(line, index) != index and read[index]]
    if not copied:
        return []
    first = f"row {raw.line[copied[0]]} is identical to row {raw.line[seen[raw.body[copied[0]]]]} in every column"
    more = f", and {len(copied) - 1} more rows are copies" if len(copied) > 1 else ""
    return [f"warning: {first}{more}: {taken_as(raw.body)}"]
