"""What train.py does: fit the model's effects, train the network on the rest, write the compensator."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ptt.commands.common import (
    Also,
    Anyway,
    Effects,
    Json,
    Map,
    ReadOptions,
    Run,
    Set,
    Targets,
    load_both,
    note,
    progress,
    show,
)


class HoldOut(StrEnum):
    """Which rows the figures and the network's settings are judged on."""

    blocks = "blocks"
    random = "random"


def train(
    run: Run,
    machine: Annotated[Path, typer.Option("--machine", metavar="M.toml", help="The machine, with the effects to fit.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder to write the compensator to.")],
    hold_out: Annotated[
        HoldOut,
        typer.Option("--hold-out", help="Hold out whole blocks of travel, or random poses among measured ones."),
    ] = HoldOut.blocks,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Fit the effects of a machine file, train the RBF on what is left, and write both as a compensator folder."""
    from ptt.correct.training.compensator import require_folder
    from ptt.door.training import train as train_model

    require_folder(out)
    loaded, rows = load_both(run, machine, ReadOptions(also, targets, set_, map_, effects, json, anyway))
    with progress() as tell:
        result = train_model(loaded, rows, hold_out=hold_out.value, anyway=anyway, progress=tell, note=note)
    result.save(out)
    show(result.to_dict(), str(result), json)
