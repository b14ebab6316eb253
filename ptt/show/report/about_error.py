"""What the report says of the error: how large, where, and what it depends on."""

from ptt.dependence.dependence import Dependence
from ptt.judge.compare.comparison import Comparison
from ptt.run.problem import Problem
from ptt.show.plots.depends import variable_label
from ptt.show.report.blocks import Block, Grid, Picture, Section, Words, grid
from ptt.show.report.contents import Contents
from ptt.show.report.numbers import AXES, NONE, axes, chance, percent, um

WORST, DEPENDENCES = 8, 10
SURE = 0.01  # chance below which lack of fit counts


def error_section(contents: Contents) -> Section:
    """The error of the machine as drawn, where it fails, what that depends on."""
    result = contents.drawing.comparison
    blocks: list[Block] = [
        figures_grid(result),
        Words(meaning(result)),
        Picture("field-drawing", "Where the tool is compared with where the drawing puts it, after frame alignment."),
        *_where(result),
        *_depends(result, contents.problem),
    ]
    if result.depends_on:
        blocks.append(Picture("depends-drawing", "Readings, and their means, against the variables that tell most."))
    return Section("error", "Error of the machine as drawn", tuple(blocks))


def left_section(contents: Contents) -> Section:
    """What the model leaves."""
    result = contents.given.comparison
    blocks: list[Block] = [figures_grid(result), Words(meaning(result))]
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
    """Figures of a comparison before and after frame alignment.

    Args:
        result: the comparison.

    Returns:
        The table, um.
    """
    data = result.to_dict()
    rows = [
        ("measured less target, as they come: RMS", data["raw_um"]["rms_um"]),
        ("measured less model, before frame alignment: RMS", data["unaligned_um"]["rms_um"]),
        (f"what the frame took ({result.frame}): RMS", data["frame_removed_um"]),
        ("after frame alignment: RMS", data["rms_um"]),
        ("after frame alignment: mean size", data["mean_um"] | {"total": data["length_um"]["mean_um"]}),
        ("after frame alignment: 95 % below", data["p95_um"] | {"total": data["length_um"]["p95_um"]}),
        ("after frame alignment: largest", data["max_um"] | {"total": data["length_um"]["max_um"]}),
    ]
    if data["base_frame_um"] is not None:
        rows.insert(3, ("in the frame of the base reflectors alone: RMS", data["base_frame_um"]["rms_um"]))
    if result.noise is not None:
        rows.append((f"noise floor ({result.noise.source})", data["noise_um"]))
    strong = frozenset(index for index, (words, _) in enumerate(rows) if words.endswith("alignment: RMS"))
    cells = [(words, *axes(values)) for words, values in rows]
    return grid(f"Error of {result.rows} readings, um", ("", *AXES), cells, strong=strong)


def meaning(result: Comparison) -> str:
    """How much of an error is more than noise.

    Args:
        result: the comparison.

    Returns:
        One or two sentences.
    """
    share, test = result.explainable_share, result.lack_of_fit
    if share is None:
        words = "How much of the error is noise is unknown."
    elif result.is_noise:
        words = "What is left after the frame is no more than noise."
    else:
        words = f"{percent(share)} of what is left after the frame is more than noise."
    if result.outliers:
        words += f" {len(result.outliers)} gross errors are left out of every figure."
    if test.p_value is None:
        return f"{words} Lack of fit was not tested: {test.to_dict()['untested_because']}."
    verb = "more" if test.p_value < SURE else "no more"
    return f"{words} The model misses {verb} than repeats scatter (lack of fit, p {chance(test.p_value, equals=True)})."


def _where(result: Comparison) -> list[Block]:
    """The worst part of the workspace, the joints, loads, quarters of the run, and the worst readings."""
    if result.is_noise:
        return [Words("No part of the workspace or of the run stands out from noise.")]
    blocks: list[Block] = []
    region = result.where.region
    if region is not None:
        spans = (
            f"{a} {um(low, 0)} to {um(high, 0)}" for a, low, high in zip("xyz", region.low, region.high, strict=True)
        )
        size = f"{1e3 * region.mean:.0f} \N{PLUS-MINUS SIGN} {1e3 * region.error:.0f} um"
        words = f"Worst part of the workspace: {', '.join(spans)} mm, mean error {size} ({region.rows} readings)."
        blocks.append(Words(words))
    blocks.append(_joints(result))
    parts = [*result.where.by_payload, *result.where.by_time]
    if parts:
        rows = [(part.label, str(part.rows), um(1e3 * part.rms)) for part in parts]
        blocks.append(grid("Error by payload and by time", ("part of the run", "readings", "RMS um"), rows))
    blocks.append(_worst(result))
    return blocks


def _joints(result: Comparison) -> Grid:
    factor, unit, ways = (1e6, "urad", ("forward", "back")) if result.serial else (1e3, "um", ("up", "down"))
    sides = {part.label: part for part in result.where.by_direction}
    rows = []
    for part in result.where.by_joint:
        pair = [sides.get(f"{part.label} {way}") for way in ways]
        means = [None if side is None else factor * side.mean for side in pair]
        gap = None if means[0] is None or means[1] is None else means[0] - means[1]
        rows.append((part.label, um(factor * part.rms), um(means[0]), um(means[1]), um(gap)))
    head = ("", "RMS", f"mean arriving {ways[0]}", f"mean arriving {ways[1]}", "difference")
    return grid(f"The same as errors of the {'joints' if result.serial else 'sliders'}, {unit}", head, rows)


def _worst(result: Comparison) -> Grid:
    several = " + " in result.source
    rows = []
    for row in result.where.rows[:WORST]:
        place = f"{row.run} line {row.line}" if several else f"line {row.line}"
        target = ", ".join(um(value) for value in row.target)
        error = ", ".join(um(1e3 * value, 0) for value in row.residual)
        rows.append((place, row.name or NONE, target, error, um(1e3 * row.size, 0)))
    return grid("Worst readings", ("where", "name", "target x, y, z mm", "error x, y, z um", "size um"), rows, left=2)


def _depends(result: Comparison, problem: Problem) -> list[Block]:
    found = result.depends_on
    if not found:
        return [Words("The error depends on no recorded variable.")]
    shown = f", the first {DEPENDENCES} of {len(found)}" if len(found) > DEPENDENCES else ""
    return [depends_grid(found[:DEPENDENCES], f"What the error depends on, each by itself{shown}", problem)]


def depends_grid(found: tuple[Dependence, ...], title: str, problem: Problem) -> Grid:
    """What an error depends on.

    Args:
        found: largest share first.
        title: of the table.
        problem: for the names of the variables.

    Returns:
        The table.
    """
    rows = [
        (
            one.residual,
            variable_label(one.on, problem),
            percent(one.share),
            chance(one.p_value),
            one.how(one.with_ and variable_label(one.with_, problem)),
        )
        for one in found
    ]
    return grid(title, ("error of", "on", "share of variance", "p-value", "how"), rows, left=2, wordy=True)
