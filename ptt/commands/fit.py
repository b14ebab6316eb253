"""`ptt fit`: refit the effects that a model has."""

from pathlib import Path
from typing import Annotated

import typer

from ptt.commands.add import Plots
from ptt.commands.common import Also, Anyway, Effects, Json, Map, ModelPath, ReadOptions, Run, Set, Targets

Out = Annotated[Path | None, typer.Option("--out", metavar="M2.toml", help="Where the refitted model is written.")]


def fit(
    run: Run,
    model: ModelPath,
    out: Out = None,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    plots: Plots = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Refit the effects of a model to a run, and show which parameters the run can and cannot determine."""
    from ptt.commands.add import finish
    from ptt.commands.common import load_both, note, progress
    from ptt.door import changing

    loaded, rows = load_both(run, model, ReadOptions(also, targets, set_, map_, effects, json, anyway))
    with progress() as tell:
        result = changing.fit(loaded, rows, anyway=anyway, progress=tell, note=note)
    finish(result, out, plots, json)
