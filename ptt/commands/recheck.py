"""`ptt recheck`: has the machine changed since its model was fitted?"""

from pathlib import Path
from typing import Annotated

import typer

from ptt.commands.common import (
    Also,
    Anyway,
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

Plots = Annotated[Path | None, typer.Option("--plots", metavar="DIR", help="Folder for a picture of what has changed.")]


def recheck(
    run: Run,
    model: ModelPath,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    plots: Plots = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Compare a new run with a solved model: is the machine the same, what has changed, what is new?"""
    from ptt.door import rechecking

    loaded, rows = load_both(run, model, ReadOptions(also, targets, set_, map_, effects, json, anyway))
    with progress() as tell:
        result = rechecking.recheck(loaded, rows, anyway=anyway, progress=tell, note=note)
    if plots is not None:
        from ptt.show.plots.common import save

        save(result.plot(), plots / "recheck.png")
    show(result.to_dict(), str(result), json)
