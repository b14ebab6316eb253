"""`ptt add`: add effects to a model one after the other, refit, and show the error fall."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import Also, Anyway, Effects, Json, Map, ModelPath, ReadOptions, Run, Set, Targets

if TYPE_CHECKING:
    from ptt.door.changing import Changed

Out = Annotated[Path, typer.Option("--out", metavar="M2.toml", help="Where the new model is written.")]
Plots = Annotated[Path | None, typer.Option("--plots", metavar="DIR", help="Folder for a picture of the ladder.")]
Sizes = Annotated[
    bool,
    typer.Option(
        "--sizes", help="Then add every other dimension of the drawing, for targets outside the measured region."
    ),
]
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
    sizes: Sizes = False,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Add effects to a model, refit everything jointly, and show the error fall step by step."""
    from ptt.commands.common import load_both, note, progress
    from ptt.door import changing

    loaded, rows = load_both(run, model, ReadOptions(also, targets, set_, map_, effects, json, anyway))
    with progress() as tell:
        result = changing.add(loaded, rows, *effect, sizes=sizes, anyway=anyway, progress=tell, note=note)
    finish(result, out, plots, json)


def finish(result: "Changed", out: Path | None, plots: Path | None, json: bool) -> None:
    """Write the model with its history, draw and print the ladder."""
    from ptt.commands.common import show

    if out is not None:
        result.save(out)
    if plots is not None:
        from ptt.show.plots.common import save

        save(result.plot(), plots / "ladder.png")
    show(result.to_dict(), str(result), json)
