"""`ptt predict`: corrected commands for a list of targets."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ptt.commands.common import (
    Anyway,
    Effects,
    Json,
    Map,
    ModelPath,
    ReadOptions,
    Set,
    asker,
    note,
    progress,
    show,
)

if TYPE_CHECKING:
    from ptt.door.model import Model
    from ptt.door.predicting import Predicted
    from ptt.door.streaming import Streamed

CANNOT_WORK = 3  # exit code: poses that cannot work

Limit = Annotated[float, typer.Option("--limit-mm", min=0.0, help="Largest correction to send, mm at the tool.")]


class Reversal(StrEnum):
    """Who compensates the play at a reversal: these commands, or nobody here."""

    software = "software"
    none = "none"


def predict(
    targets: Annotated[Path, typer.Argument(metavar="TARGETS.csv", help="Tool positions to reach, in travel order.")],
    model: ModelPath,
    out: Annotated[Path, typer.Option("--out", metavar="SLIDERS.csv", help="Commands to write.")],
    reversal: Annotated[
        Reversal | None,
        typer.Option("--reversal", help="Include reversal compensation in the commands, or leave it out."),
    ] = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    limit_mm: Limit = 5.0,
    anyway: Anyway = False,
    json: Json = False,
) -> int:
    """Compute the commands that put the real tool on its targets: physics and network are inverted, never the tracker.

    A row that cannot be sent has a status, no command, and the nearest command that works; the exit code is then 3.
    """
    from ptt.door import predicting
    from ptt.door.model import load
    from ptt.door.run import targets_path

    reading = ReadOptions(set_=set_, map_=map_, effects=effects, json=json, anyway=anyway)
    loaded = load(model, effects=effects or ())
    way: Literal["software", "none"] | None = None if reversal is None else reversal.value
    asked: dict[str, Any] = {"reversal": way, "limit_mm": limit_mm, "anyway": anyway, "note": note}
    done = _in_parts(loaded, targets, reading, out, asked)
    if done is None:
        rows = targets_path(targets, loaded, reading, ask=asker(reading), note=note)
        with progress() as tell:
            done = predicting.predict(loaded, rows, progress=tell, **asked)
        done.to_csv(out)
    for line in done.warnings:
        note(f"warning: {line}")
    figures = done.to_dict()
    show(figures, str(done), json)
    return 0 if figures["sent"] == figures["rows"] else CANNOT_WORK


def _in_parts(
    model: "Model", targets: Path, reading: ReadOptions, out: Path, asked: dict[str, Any]
) -> "Streamed | Predicted | None":
    """Commands of a long list, written; None where it is short, or has to be read at once."""
    from ptt.door.streaming import NotInParts, is_long, predict_file

    if not is_long(targets):
        return None
    try:
        with progress() as tell:
            return predict_file(model, targets, reading, out, ask=asker(reading), progress=tell, **asked)
    except NotInParts:
        return None
