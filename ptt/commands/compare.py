"""`ptt compare`: how large the error is, how much of it is noise, where it is and what it depends on."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ptt.commands.common import (
    Also,
    Context,
    Effects,
    Json,
    Map,
    ModelPath,
    ReadOptions,
    Run,
    Set,
    Targets,
    load_both,
    note,
    progress,
    show,
)

After = Annotated[
    Path | None, typer.Option("--after", metavar="AFTER.csv", help="A later run, to compare with this one.")
]
Plots = Annotated[Path | None, typer.Option("--plots", metavar="DIR", help="Also draw pictures into this folder.")]


def compare(
    run: Run,
    model: ModelPath,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    context: Context = None,
    effects: Effects = None,
    after: After = None,
    plots: Plots = None,
    json: Json = False,
) -> None:
    """Compare a run with a model: errors per axis, noise floor, where it fails, what it depends on."""
    from ptt.door.comparing import compare as held_against

    reading = ReadOptions(also, targets, set_, map_, effects, json, context=context)
    loaded, rows = load_both(run, model, reading)
    later = None if after is None else load_both(after, model, replace(reading, also=None))[1]
    with progress() as tell:
        result = held_against(loaded, rows, after=later, progress=tell, note=note)
        pictures = () if plots is None else result.pictures(plots, progress=tell)
    if plots is not None:
        note(f"{len(pictures)} pictures in {plots}: {', '.join(picture.name for picture in pictures)}")
    show(result.to_dict(), str(result), json)
