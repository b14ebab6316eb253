"""`ptt compare`: how large the error is, how much of it is noise, where it is and what it depends on."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import (
    Also,
    Effects,
    Json,
    Map,
    ModelPath,
    Opened,
    Reading,
    Run,
    Set,
    Targets,
    note,
    open_run,
    progress,
    show,
)

if TYPE_CHECKING:
    from ptt.run.noise import Noise

Plots = Annotated[Path | None, typer.Option("--plots", metavar="DIR", help="Also draw pictures into this folder.")]


def compare(
    run: Run,
    model: ModelPath,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    plots: Plots = None,
    json: Json = False,
) -> None:
    """Compare a run with a model: errors per axis, noise floor, where it fails, what it depends on."""
    from dataclasses import replace

    from ptt.fitting.chunks import LONG, sample_stretches, take
    from ptt.judge.compare.comparison import compare_run
    from ptt.judge.compare.text import format_comparison

    opened = open_run(run, model, Reading(also, targets, set_, map_, effects, json, anyway=True))
    aside = opened.compensator.network is not None
    if aside:
        note("the compensator's network is left aside: the physics alone is compared")
    if opened.table.rows > LONG:
        opened = replace(opened, problem=take(opened.problem, sample_stretches(opened.problem)))
        rows = opened.problem.table.rows
        note(f"compared are {rows} rows of {opened.table.rows}, in stretches of travel that are spread over the run")
    with progress() as tell:
        result = compare_run(opened.model, opened.problem, noise=_noise_of(opened), progress=tell)
        if plots is not None:
            from ptt.show.plots.compare import plot_comparison

            pictures = plot_comparison(result, opened.problem, plots, progress=tell)
    if plots is not None:
        note(f"{len(pictures)} pictures in {plots}: {', '.join(picture.name for picture in pictures)}")
    if result.without_values:
        note(f"not fitted yet, so left out: {', '.join(result.without_values)}; `ptt fit` fits them")
    setup = opened.check.to_dict()["findings"] if opened.check else []
    data = result.to_dict() | opened.set_up | {"network_left_aside": aside, "setup": setup}
    first = f"{opened.check}\n\n" if setup else ""
    show(data, first + format_comparison(result), json)


def _noise_of(opened: Opened) -> "Noise | None":
    """The noise floor as diagnose takes it; a run that cannot tell it is compared all the same."""
    from ptt.diagnosis.noise import noise_floor
    from ptt.effects.registry import library
    from ptt.errors import TableError

    try:
        return noise_floor(opened.model, opened.problem, opened.library or library())
    except TableError as error:
        note(f"noise floor unknown: {error}")
        return None
