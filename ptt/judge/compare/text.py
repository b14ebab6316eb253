"""A comparison in words and tables."""

from io import StringIO

from rich import box
from rich.console import Console
from rich.table import Table

from ptt.dependence.parts import PartError
from ptt.dependence.said import by_chance
from ptt.judge.compare.comparison import Comparison
from ptt.judge.compare.rows import (
    NO_PLACE,
    NO_VARIABLE,
    error_rows,
    joint_head,
    joint_rows,
    joint_title,
    meaning,
    percent,
    place_of,
    worst_part,
)
from ptt.run.axes import AXES_TOTAL

SHOWN_ROWS = 5
SHOWN_DEPENDENCES = 8
WIDTH = 1000  # columns of the console: tables take what they need, and a narrower one would cut digits off


def format_comparison(result: Comparison) -> str:
    """The comparison as text.

    Args:
        result: the comparison.

    Returns:
        Lines and tables.
    """
    parts: list[str | Table] = [
        _heading(result),
        *(stretch.words for stretch in result.stretches),
        "",
        "error in um",
        _errors(result),
        "",
        *meaning(result),
        "",
    ]
    parts += [joint_title(result), _joints(result), "", *_places(result), "", "worst readings", _worst(result), ""]
    if result.outliers:
        parts += [_outliers(result), ""]
    parts += _dependences(result)
    text = StringIO()
    # Names of files and points may hold brackets, which are no markup here.
    console = Console(file=text, width=WIDTH, color_system=None, highlight=False, markup=False)
    for part in parts:
        console.print(part, soft_wrap=isinstance(part, str))
    return "\n".join(line.rstrip() for line in text.getvalue().rstrip().splitlines())


def _heading(result: Comparison) -> str:
    effects = ", ".join(result.effects) or "no effects"
    left = f", {len(result.outliers)} more left out as gross errors" if result.outliers else ""
    frame = f"tracker frame {result.frame}"
    return f"{result.rows} readings of {result.source}{left}\nmodel: {result.machine}, {effects}; {frame}"


def _table(*columns: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="right" if index else "left", no_wrap=True)
    return table


def _errors(result: Comparison) -> Table:
    table = _table("", "x", "y", "z", "length")
    for name, values in error_rows(result):
        table.add_row(name, *(f"{values[axis]:.1f}" for axis in AXES_TOTAL))
    return table


def _joints(result: Comparison) -> Table:
    table = _table("", *joint_head(result))
    for row in joint_rows(result):
        cells = ("-" if value is None else f"{value:+.1f}" for value in (*row.ways, row.gap))
        table.add_row(row.label, f"{row.rms:.1f}", *cells)
    return table


def _places(result: Comparison) -> list[str]:
    if result.is_noise:
        return [NO_PLACE]
    where, part = result.where, worst_part(result)
    lines = [] if part is None else [part]
    if where.by_payload:
        lines.append(f"by payload, rms: {_parts(where.by_payload)}")
    if where.by_time:
        lines.append(f"by time, rms: {_parts(where.by_time)}")
    return lines


def _parts(parts: tuple[PartError, ...]) -> str:
    return ", ".join(f"{part.label} {1e3 * part.rms:.0f} um" for part in parts)


def _worst(result: Comparison) -> Table:
    table = _table("where", "name", "target mm", "error um", "size um")
    for row in result.where.rows[:SHOWN_ROWS]:
        target = " ".join(f"{value:.1f}" for value in row.target)
        error = " ".join(f"{1e3 * value:+.0f}" for value in row.residual)
        table.add_row(place_of(result, row), row.name, target, error, f"{1e3 * row.size:.0f}")
    return table


def _outliers(result: Comparison) -> str:
    named = [
        f"{place_of(result, row)}{f' ({row.name})' if row.name else ''} {1e3 * row.size:.0f} um"
        for row in result.outliers
    ]
    more = f" and {len(named) - SHOWN_ROWS} more" if len(named) > SHOWN_ROWS else ""
    return f"gross errors: {', '.join(named[:SHOWN_ROWS])}{more}"


def _dependences(result: Comparison) -> list[str | Table]:
    found = result.depends_on
    if not found:
        return [NO_VARIABLE]
    table = _table("error of", "on", "share", "by chance", "how")
    for item in found[:SHOWN_DEPENDENCES]:
        table.add_row(item.residual, item.on, percent(item.share), by_chance(item.p_value), item.how())
    more = f", the first {SHOWN_DEPENDENCES} of {len(found)}" if len(found) > SHOWN_DEPENDENCES else ""
    parts: list[str | Table] = [f"what the error depends on, each variable taken alone{more}", table]
    if found[0].rivals:
        rivals = ", ".join(found[0].rivals[:SHOWN_ROWS])
        parts.append(f"these explain as much as the first, but are less likely to be the cause: {rivals}")
    return parts
