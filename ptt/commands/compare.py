"""`ptt compare`: how large the error is, how much of it is noise, where it is and what it depends on."""

from pathlib import Path
from typing import Annotated

import typer

from ptt.commands.common import (
    Also,
    Effects,
    Json,
    Map,
    ModelPath,
    Reading,
    Run,
    Set,
    Targets,
    load_both,
    note,
    progress,
    show,
)

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
    from ptt.door.comparing import compare as held_against

    loaded, rows = load_both(run, model, Reading(also, targets, set_, map_, effects, json))
    with progress() as tell:
        result = held_against(loaded, rows, progress=tell, note=note)
        pictures = () if plots is None else result.pictures(plots, progress=tell)
    if plots is not None:
        note(f"{len(pictures)} pictures in {plots}: {', '.join(picture.name for picture in pictures)}")
    show(result.to_dict(), str(result), json)
