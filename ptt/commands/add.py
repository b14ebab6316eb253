"""`ptt add`: add effects to a model one after the other, refit, and show the error fall."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import Also, Anyway, Effects, Json, Map, ModelPath, Reading, Run, Set, Targets

if TYPE_CHECKING:
    from ptt.commands.common import Opened, Progress
    from ptt.judge.ladder.climb import Ladder
    from ptt.run.problem import Problem

Out = Annotated[Path, typer.Option("--out", metavar="M2.toml", help="Where the new model is written.")]
Plots = Annotated[Path | None, typer.Option("--plots", metavar="DIR", help="Folder for a picture of the ladder.")]
EffectNames = Annotated[
    list[str], typer.Argument(metavar="EFFECT...", help="Effects, in this order; setup-jump[second] for a second one.")
]


def add(
    run: Run,
    effect: EffectNames,
    model: ModelPath,
    out: Out,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    plots: Plots = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Add effects to a model, refit everything jointly, and show the error fall step by step."""
    from ptt.commands.common import open_run, progress
    from ptt.effects.registry import library, make_effect, parse_key
    from ptt.judge.ladder.climb import climb

    opened = open_run(run, model, Reading(also, targets, set_, map_, effects, json, anyway))
    known = opened.library or library()
    new = [make_effect(known, *parse_key(text)) for text in effect]
    with progress() as tell:
        ladder = climb(opened.model, noisy(opened, tell), new, progress=tell)
    finish(ladder, opened, "add", out, plots, json)


def noisy(opened: "Opened", tell: "Progress") -> "Problem":
    """The problem with its noise floor, from the saturated model where nothing else tells it."""
    from ptt.diagnosis.noise import noise_floor
    from ptt.effects.registry import library

    tell("noise", 0, 1)
    return opened.problem.with_noise(noise_floor(opened.model, opened.problem, opened.library or library()))


def finish(ladder: "Ladder", opened: "Opened", verb: str, out: Path | None, plots: Path | None, json: bool) -> None:
    """Write the model with its history, draw and print the ladder."""
    from dataclasses import replace

    from ptt.commands.common import show
    from ptt.diagnosis.words import sentences
    from ptt.fitting.report import format_fit
    from ptt.judge.history import record
    from ptt.judge.ladder.text import format_ladder
    from ptt.machine import save_machine

    if opened.compensator.network is not None:
        stale = "the RBF of the compensator is dropped: it had learned what the old model left over; train it again"
        ladder = replace(ladder, notes=(*ladder.notes, stale))
    if out is not None:
        save_machine(record(ladder, verb, opened.files), out)
    if plots is not None:
        from ptt.show.plots.ladder import plot_ladder

        plot_ladder(ladder, plots / "ladder.png")
    last = ladder.steps[-1].fitted
    widen = max(1.0, last.chi2 / max(last.freedom, 1)) ** 0.5
    told = sentences(last.model.terms, opened.problem, last.noise, widen)
    words = "".join(f"{line}\n" for line in told) + "\n" if told else ""
    text = f"{format_ladder(ladder)}\n\n{words}{format_fit(ladder.report)}"
    show(ladder.to_dict() | opened.set_up, text, json)
