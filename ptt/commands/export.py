"""`ptt export`: the model in a form that a controller runs."""

from pathlib import Path
from typing import Annotated

import typer

from ptt.commands.common import (
    Also,
    Effects,
    Json,
    Map,
    ModelPath,
    ReadOptions,
    Set,
    Targets,
    asker,
    note,
    progress,
    refuse_idle,
    show,
)


def export(
    model: ModelPath,
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help="Format: c, onnx, klipper, ..., table.")],
    out: Annotated[Path, typer.Option("--out", metavar="PATH", help="File or folder to write.")],
    step: Annotated[
        float | None, typer.Option("--step", metavar="MM", min=1e-6, help="Spacing of table entries, mm.")
    ] = None,
    run: Annotated[
        Path | None,
        typer.Option("--run", metavar="RUN.csv", help="Compute the error at the loads and speeds of this run."),
    ] = None,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Write the model for a controller: what the format holds, what it cannot hold, and what error that leaves."""
    from ptt.correct.exports.registry import find_format
    from ptt.door.exporting import export_as
    from ptt.door.model import load
    from ptt.door.run import read_path

    chosen = find_format(to)
    reading = ReadOptions(also, targets, set_, map_, effects, json)
    if run is None:
        idle = {"--also": also, "--targets": targets, "--set": set_, "--map": map_}
        refuse_idle(idle, "says how to read a run, but no run is named", "add --run RUN.csv")
    loaded = load(model, effects=effects or ())
    table = None if run is None else read_path(run, loaded, reading, ask=asker(reading), note=note).table
    if step is not None and not chosen.stepped:
        note(f"--step does not apply to format {chosen.name}")
    with progress() as tell:
        result = export_as(loaded, chosen, out, model, step=step, table=table, progress=tell)
    show(result.to_dict(), str(result), json)
