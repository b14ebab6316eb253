"""`ptt challenge`: a run with a sealed hidden effect, and the score."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ptt.commands.common import Effects, Json, note, show

app = typer.Typer(
    help="A run with hidden faults for you to find; then open the seal and see how well you did.",
    add_completion=False,
    rich_markup_mode=None,
)


class LevelName(StrEnum):
    """How much is hidden."""

    single = "single"
    multi = "multi"
    unknown = "unknown"
    none = "none"
    any = "any"


Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the challenge.")]


@app.command()
def new(
    folder: Folder,
    level: Annotated[
        LevelName,
        typer.Option(
            "--level", help="One effect, several, one unknown to the library, or none; any: one of these at random."
        ),
    ] = LevelName.any,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed, to draw the same machine again (default: random).")
    ] = None,
    rows: Annotated[int, typer.Option("--rows", max=1_000_000, help="Approximate number of readings.")] = 300,
    machine: Annotated[
        Path | None,
        typer.Option("--machine", metavar="M.toml", help="Drawing of a machine or arm (default: the bench)."),
    ] = None,
    foreign: Annotated[
        bool, typer.Option("--foreign", help="Draw machine, path and tracker at random too, instead of the bench.")
    ] = False,
    json: Json = False,
) -> None:
    """Draw a machine with hidden faults, measure it, and seal what is wrong with it."""
    from ptt.challenge.challenge import new_challenge
    from ptt.machine import load_machine

    file = None if machine is None else load_machine(machine)
    made = new_challenge(folder, level.value, seed=seed, rows=rows, machine=file, foreign=foreign)
    data = made.to_dict()
    lines = [
        f"{data['run']}: {made.rows} rows; {data['machine']}: the drawing; {data['targets']}: where the tool should be",
        f"find out what is missing:  ptt diagnose {data['run']} --model {data['machine']}",
        f"then open the seal:        ptt challenge reveal {folder} --model YOUR_MODEL.toml",
    ]
    show(data, "\n".join(lines), json)


@app.command()
def reveal(
    folder: Folder,
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="M", help="Your solved model (default: the drawing as handed out)."),
    ] = None,
    rig_out: Annotated[
        Path | None,
        typer.Option(
            "--rig",
            metavar="RIG.toml",
            help="Also write the rig as the run left it, so that `ptt simulate` can run DIR/targets.csv on it.",
        ),
    ] = None,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Open the seal: what was hidden, what the model says, and where its commands put the real tool."""
    from ptt.challenge.challenge import MACHINE
    from ptt.challenge.remeasure import to_run_again
    from ptt.door.model import load
    from ptt.door.revealing import reveal as open_seal
    from ptt.files import write_text
    from ptt.rig import format_rig

    if model is None:
        note("no --model: the drawing itself is judged")
    result = open_seal(load(model or folder / MACHINE, effects=effects or ()), folder)
    if rig_out is not None:
        write_text(rig_out, format_rig(to_run_again(result.sealed.drawn.rig)))
        note(f"{rig_out}: the rig as the run left it")
    show(result.to_dict(), str(result), json)
