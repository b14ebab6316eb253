"""A comparison in words and tables."""

from io import StringIO

from rich import box
from rich.console import Console
from rich.table import Table

from ptt.dependence.parts import PartError
from ptt.dependence.said import by_chance
from ptt.dependence.where import WorstRow
from ptt.judge.compare.comparison import UM, Comparison, figures, one_figure

SHOWN_ROWS = 5
SHOWN_DEPENDENCES = 8
WIDTH = 1000  # tables take what they need; a narrower page would cut digits off
FAR = 3.0  # times the error after alignment from which it is worth a word what the one before it is
STANDS = (
    "Before alignment the error is mostly where the tracker stands and how it is turned (what zeros and leans of all",
    "joints have in common looks the same); the machine is judged after alignment.",
)
SURE = 0.01  # chance below which lack of fit counts


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
        *_meaning(result),
        "",
    ]
    parts += [_joint_title(result), _joints(result), "", *_places(result), "", "worst readings", _worst(result), ""]
    if result.outliers:
        parts += [_outliers(result), ""]
    parts += _dependences(result)
    text = StringIO()
    console = Console(file=text, width=WIDTH, color_system=None, highlight=False)
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
    """Per axis, and of the length of the error vector of each reading: the largest of one axis may be another row's."""
    table = _table("", "x", "y", "z", "length")
    after, before = figures(result.residual[result.kept]), figures(result.unaligned[result.kept])
    raw, length = figures(result.raw[result.kept]), one_figure(result.lengths, UM)
    base = {} if result.by_base is None else figures(result.by_base[result.kept])["rms_um"]
    rows = [
        ("rms of measured - target, as they come", raw["rms_um"]),
        ("rms of measured - model, before frame alignment", before["rms_um"]),
        ("rms of what the frame took", result.frame_removed),
        *([] if result.by_base is None else [("in the frame of the base reflectors alone: rms", base)]),
        ("after frame alignment: rms", after["rms_um"]),
        ("                       mean |error|", after["mean_um"] | {"total": length["mean_um"]}),
        ("                       95 % below", after["p95_um"] | {"total": length["p95_um"]}),
        ("                       largest", after["max_um"] | {"total": length["max_um"]}),
    ]
    if result.noise is not None:
        rows.append((f"noise floor, 1 sigma ({result.noise.source})", result.noise.to_dict()))
    for name, values in rows:
        table.add_row(name, *(f"{values[axis]:.1f}" for axis in ("x", "y", "z", "total")))
    return table


def _meaning(result: Comparison) -> list[str]:
    """How much is more than noise, and whether repeats say so too."""
    share, test = result.explainable_share, result.lack_of_fit
    before, after = (figures(each[result.kept])["rms_um"]["total"] for each in (result.unaligned, result.residual))
    stands = [*STANDS] if before > FAR * after else []
    if share is None:
        words = "How much of the error is noise is unknown."
    elif result.is_noise:
        words = "What is left after the frame is no more than noise."
    else:
        words = f"{_percent(share)} of what is left after the frame is more than noise."
    if test.p_value is None:
        return [*stands, words, f"Lack of fit not tested: {test.to_dict()['untested_because']}."]
    if test.p_value < SURE:
        return [*stands, words, f"The model misses more than repeats scatter (lack of fit, {by_chance(test.p_value)})."]
    return [*stands, words, f"The model misses no more than repeats scatter (lack of fit, {by_chance(test.p_value)})."]


def _joint_title(result: Comparison) -> str:
    return f"the same as errors of the {'joints, urad' if result.serial else 'sliders, um'}"


def _joints(result: Comparison) -> Table:
    """Errors of the joints that would cause the residual, by side of arrival."""
    factor, words = (1e6, ("forward", "back")) if result.serial else (1e3, ("up", "down"))
    sides = {part.label: part for part in result.where.by_direction}
    table = _table("", "rms", f"mean arriving {words[0]}", f"mean arriving {words[1]}", "difference")
    for part in result.where.by_joint:
        first, second = (sides.get(f"{part.label} {word}") for word in words)
        cells = [f"{factor * side.mean:+.1f}" if side else "-" for side in (first, second)]
        gap = f"{factor * (first.mean - second.mean):+.1f}" if first and second else "-"
        table.add_row(part.label, f"{factor * part.rms:.1f}", *cells, gap)
    return table


def _places(result: Comparison) -> list[str]:
    lines, where = [], result.where
    if result.is_noise:
        return ["No part of the workspace or of the run stands out from noise."]
    if where.region is not None:
        spans = (
            f"{axis} {low:.0f} to {high:.0f}"
            for axis, low, high in zip("xyz", where.region.low, where.region.high, strict=True)
        )
        size = f"{1e3 * where.region.mean:.0f} +- {1e3 * where.region.error:.0f} um"
        lines.append(
            f"worst part of the workspace: {', '.join(spans)} mm, mean error {size} ({where.region.rows} readings)"
        )
    if where.by_payload:
        lines.append(f"by payload, rms: {_parts(where.by_payload)}")
    if where.by_time:
        lines.append(f"by time, rms: {_parts(where.by_time)}")
    return lines


def _parts(parts: tuple[PartError, ...]) -> str:
    return ", ".join(f"{part.label} {1e3 * part.rms:.0f} um" for part in parts)


def _worst(result: Comparison) -> Table:
    table = _table("line", "name", "target mm", "error um", "size um")
    for row in result.where.rows[:SHOWN_ROWS]:
        target = " ".join(f"{value:.1f}" for value in row.target)
        error = " ".join(f"{1e3 * value:+.0f}" for value in row.residual)
        table.add_row(_line(result, row), row.name, target, error, f"{1e3 * row.size:.0f}")
    return table


def _line(result: Comparison, row: WorstRow) -> str:
    """Where a row stands; the file too where several were read."""
    return f"{row.run} {row.line}" if " + " in result.source else str(row.line)


def _outliers(result: Comparison) -> str:
    named = [
        f"line {_line(result, row)}{f' ({row.name})' if row.name else ''} {1e3 * row.size:.0f} um"
        for row in result.outliers
    ]
    more = f" and {len(named) - SHOWN_ROWS} more" if len(named) > SHOWN_ROWS else ""
    return f"gross errors: {', '.join(named[:SHOWN_ROWS])}{more}"


def _dependences(result: Comparison) -> list[str | Table]:
    found = result.depends_on
    if not found:
        return ["The error depends on nothing that the run tells of."]
    table = _table("error of", "on", "share", "by chance", "how")
    for item in found[:SHOWN_DEPENDENCES]:
        table.add_row(item.residual, item.on, _percent(item.share), by_chance(item.p_value), item.how())
    more = f", the first {SHOWN_DEPENDENCES} of {len(found)}" if len(found) > SHOWN_DEPENDENCES else ""
    parts: list[str | Table] = [f"what the error depends on, each by itself{more}", table]
    if found[0].rivals:
        rivals = ", ".join(found[0].rivals[:SHOWN_ROWS])
        parts.append(f"explain as much as the first, but are less likely the cause: {rivals}")
    return parts


def _percent(share: float) -> str:
    """Percent, without turning nearly all into all."""
    return f"{100.0 * share:.1f} %" if 0.99 <= share < 1.0 else f"{100.0 * share:.0f} %"
