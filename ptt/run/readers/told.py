"""Report of how a file was interpreted, and the answers that can be saved for files of its kind."""

from ptt.run.readers.columns import UNITS, Column, canonical, dimension_of, standard_unit
from ptt.run.readers.mapping import ABSENT, IGNORE, NOT_USED, Mapping, Understood
from ptt.run.readers.separators import DELIMITERS, is_number, split_line
from ptt.run.readers.text import RawText


def understood_of(
    raw: RawText, columns: list[Column], notes: list[str], dates: str | None, given: Mapping
) -> Understood:
    """Interpretation of a file, in words and as answers.

    Args:
        raw: its lines.
        columns: what each column holds.
        notes: what is to be said beside that.
        dates: order of day and month, where that was needed.
        given: answers known beforehand.

    Returns:
        The findings.
    """
    delimiter, decimal = DELIMITERS.get(raw.delimiter, repr(raw.delimiter)), {".": "point", ",": "comma"}[raw.decimal]
    lines = [f"{raw.source}: {len(raw.body)} rows, {raw.encoding}, {delimiter} between columns, decimal {decimal}"]
    if raw.comments:
        lines.append(f"{len(raw.comments)} comment line{'' if len(raw.comments) == 1 else 's'} skipped")
    rows = [
        text
        for text in raw.comments
        if sum(is_number(cell, raw.delimiter) for cell in split_line(text, raw.delimiter)) > 2
    ]
    if rows:
        lines.append(f"warning: {len(rows)} of them look like rows, first '{rows[0]}'; quote a name that starts with #")
    plain = [column.title for column in columns if column.quantity and canonical(column.title) and not column.note]
    if plain:
        lines.append(f"columns as named: {', '.join(plain)}")
    lines += [_meaning_line(column) for column in columns if column.quantity and column.title not in plain]
    ignored = tuple(column.title for column in columns if not column.quantity)
    if ignored:
        lines.append(f"{NOT_USED}{', '.join(ignored)}")
    absent = [title for title in {**given.columns, **given.units} if title not in {column.title for column in columns}]
    if absent:
        lines.append(f"{ABSENT}{', '.join(absent)}")
    return Understood((*lines, *notes), ignored, _answers(raw, columns, dates, given))


def _meaning_line(column: Column) -> str:
    quantity = column.quantity
    unit = f" [{column.unit}]" if column.unit and column.unit != "stamp" else ""
    is_turned = bool(unit) and UNITS[dimension_of(quantity)][column.unit] != (1.0, 0.0)
    turned = f", converted to {standard_unit(quantity) or 'N or N m'}" if is_turned else ""
    return f"'{column.title}' is {quantity}{unit}{turned}" + (f" ({column.note})" if column.note else "")


def _answers(raw: RawText, columns: list[Column], dates: str | None, given: Mapping) -> Mapping:
    return Mapping(
        encoding=raw.encoding,
        delimiter=raw.delimiter.replace(" ", "space"),
        decimal=raw.decimal,
        dates=dates or given.dates,
        pairing=given.pairing,
        targets=given.targets,
        columns={column.title: column.quantity or IGNORE for column in columns},
        units={column.title: column.unit for column in columns if column.quantity and column.unit},
    )
