"""Sections of the report on the error: how large it is, where, and what it depends on."""

from ptt.dependence.dependence import Dependence
from ptt.effects.phrases import capital
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
from ptt.run.problem import Problem
from ptt.show.plots.depends import variable_label
from ptt.show.report.blocks import Block, Grid, Picture, Section, Words, grid
from ptt.show.report.contents import Contents
from ptt.show.report.numbers import NONE, axes, chance, um

WORST, DEPENDENCES = 8, 10  # most readings and dependences that are listed


def error_section(contents: Contents) -> Section:
    """The error of the bare drawing: how large it is, where, and what it depends on."""
    result = contents.drawing.comparison
    blocks: list[Block] = [
        figures_grid(result),
        Words(_meaning(result)),
        Picture("field-drawing", "Where the tool is compared with where the drawing puts it, after frame alignment."),
        *_where(result),
        *_depends(result, contents.problem),
    ]
    if result.depends_on:
        blocks.append(Picture("depends-drawing", "Readings, and their means, against the variables that explain most."))
    return Section("error", "Error of the machine as drawn", tuple(blocks))


def left_section(contents: Contents) -> Section:
    """The error that the model leaves: how large it is, where, and what it depends on."""
    result = contents.given.comparison
    blocks: list[Block] = [figures_grid(result), Words(_meaning(result))]
    if result.without_values:
        blocks.append(Words(f"Not fitted yet, so left out: {', '.join(result.without_values)}.", "lack"))
    blocks += [
        Picture("histogram-model", "Errors that the model leaves, against what noise alone would do."),
        Picture("course-model", "The same in the order of measurement."),
        *([] if result.is_noise else [Picture("field-model", "Where the model still fails."), *_where(result)]),
        *_depends(result, contents.problem),
    ]
    return Section("left", "What the model leaves", tuple(blocks))


def figures_grid(result: Comparison) -> Grid:
    """Table of a comparison's errors before and after frame alignment.

    Args:
        result: the comparison.

    Returns:
        The table, um.
    """
    rows = error_rows(result)
    strong = frozenset(index for index, (words, _) in enumerate(rows) if words.endswith("alignment: RMS"))
    cells = [(words, *axes(values)) for words, values in rows]
    return grid(f"Error of {result.rows} readings, um", ("", *AXES_TOTAL), cells, strong=strong)


def _meaning(result: Comparison) -> str:
    sentences, count = meaning(result), len(result.outliers)
    if count:
        sentences.append(f"Left out of every figure: {'one gross error' if count == 1 else f'{count} gross errors'}.")
    return " ".join(sentences)


def _where(result: Comparison) -> list[Block]:
    """Errors by part of the workspace, by joint, by payload, by quarter of the run, and the worst readings."""
    if result.is_noise:
        return [Words(NO_PLACE)]
    blocks: list[Block] = []
    part = worst_part(result)
    if part is not None:
        typeset = part.replace("+-", "\N{PLUS-MINUS SIGN}").replace("-", "\N{MINUS SIGN}")
        blocks.append(Words(f"{capital(typeset)}."))
    blocks.append(_joints(result))
    parts = [*result.where.by_payload, *result.where.by_time]
    if parts:
        rows = [(part.label, str(part.rows), um(1e3 * part.rms)) for part in parts]
        blocks.append(grid("Error by payload and by time", ("part of the run", "readings", "RMS um"), rows))
    blocks.append(_worst(result))
    return blocks


def _joints(result: Comparison) -> Grid:
    rows = [(row.label, um(row.rms), *map(um, (*row.ways, row.gap))) for row in joint_rows(result)]
    return grid(capital(joint_title(result)), ("", *joint_head(result)), rows)


def _worst(result: Comparison) -> Grid:
    rows = []
    for row in result.where.rows[:WORST]:
        target = ", ".join(um(value) for value in row.target)
        error = ", ".join(um(1e3 * value, 0) for value in row.residual)
        rows.append((place_of(result, row), row.name or NONE, target, error, um(1e3 * row.size, 0)))
    return grid("Worst readings", ("where", "name", "target x, y, z mm", "error x, y, z um", "size um"), rows, left=2)


def _depends(result: Comparison, problem: Problem) -> list[Block]:
    found = result.depends_on
    if not found:
        return [Words(NO_VARIABLE)]
    shown = f", the first {DEPENDENCES} of {len(found)}" if len(found) > DEPENDENCES else ""
    return [depends_grid(found[:DEPENDENCES], f"What the error depends on, each variable taken alone{shown}", problem)]


def depends_grid(found: tuple[Dependence, ...], title: str, problem: Problem) -> Grid:
    """Table of what an error depends on.

    Args:
        found: the dependences, largest share first.
        title: of the table.
        problem: the run; names and units of variables depend on it.

    Returns:
        The table.
    """
    rows = [
        (
            one.residual,
            ", ".join(variable_label(name, problem) for name in one.together or (one.on,)),
            percent(one.share),
            chance(one.p_value),
            one.how(one.with_ and variable_label(one.with_, problem)),
        )
        for one in found
    ]
    return grid(title, ("error of", "on", "share of variance", "p-value", "how"), rows, left=2, wordy=True)
