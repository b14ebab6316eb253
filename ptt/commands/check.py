"""`ptt check`: mistakes in the set-up of a run and its machine, before any physics; or what a machine file says."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import Also, Effects, Json, Map, ReadOptions, Set, Targets, asker, note, show

if TYPE_CHECKING:
    from ptt.door.checking import Checked
    from ptt.machine import MachineFile

First = Annotated[Path, typer.Argument(metavar="RUN.csv|MACHINE.toml", help="A run, or a machine file alone.")]
Machine = Annotated[Path | None, typer.Option("--model", metavar="M", help="machine.toml or compensator folder.")]
OutRun = Annotated[
    Path | None, typer.Option("--out-run", metavar="R2.csv", help="Write the run with its mistakes corrected.")
]
OutModel = Annotated[
    Path | None,
    typer.Option("--out-model", metavar="M2.toml", help="Write the machine file with its mistakes corrected."),
]
Drawing = Annotated[
    Path | None, typer.Option("--drawing", metavar="PNG", help="Draw the machine as the program understands it.")
]


def check(
    run: First,
    model: Machine = None,
    out_run: OutRun = None,
    out_model: OutModel = None,
    drawing: Drawing = None,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Look for mistakes in the set-up: axes, units, sliders, lengths, rows, frames. Draw a machine file given alone."""
    from ptt.door.checking import check_path, check_unbuilt
    from ptt.door.model import load
    from ptt.errors import InputError, MachineError

    if drawing is not None and drawing.suffix.lower() != ".png":
        raise InputError("a drawing is a picture", where=str(drawing), fix="let its name end in .png")
    if model is None and (run.suffix == ".toml" or run.is_dir()):
        _show_machine(run, drawing, effects, json)
        return
    if model is None:
        raise InputError("no machine to check it against", where=str(run), fix="add --model MACHINE.toml")
    reading = ReadOptions(also, targets, set_, map_, effects, json)
    try:
        loaded = load(model, effects=effects or ())
    except MachineError as refused:
        found = check_unbuilt(model, refused, run, reading, asker(reading), note)
        drawn = found.file  # as it was given there is nothing to draw
    else:
        found = check_path(loaded, run, reading, ask=asker(reading), note=note)
        drawn = found.drawn
    _write(found, out_run, out_model, several=bool(also))
    if drawing is not None:
        _draw(drawn, drawing)
        note(f"{drawing}: the machine as understood")
    show(found.to_dict(), str(found), json)


def _write(found: "Checked", out_run: Path | None, out_model: Path | None, several: bool) -> None:
    from ptt.errors import InputError
    from ptt.machine import save_machine
    from ptt.run.written import write_table

    if out_run is not None:
        if several:
            raise InputError("one file for several runs", where="--out-run", fix="check each run separately")
        if found.table is not None:
            write_table(found.table, out_run, as_read=True)
        note(f"{out_run}: the run, {_undone(found.run_is_as_it_was)}")
    if out_model is not None:
        save_machine(found.file, out_model)
        note(f"{out_model}: the machine file, {_undone(found.machine_is_as_it_was)}")


def _undone(same: bool) -> str:
    return "unchanged: no certain mistake to correct" if same else "with its certain mistakes corrected"


def _show_machine(path: Path, drawing: Path | None, effects: list[Path] | None, json: bool) -> None:
    from ptt.door.checking import describe
    from ptt.door.model import load

    described = describe(load(path, effects=effects or ()))
    if drawing is None and described.file.machine.kind == "serial":  # an arm is told, not drawn
        show(described.to_dict(), str(described), json)
        return
    beside = Path(f"{(path / 'machine' if path.is_dir() else path).with_suffix('')}_drawing.png")
    drawn = _drawn_if_possible(described.file, beside) if drawing is None else drawing
    if drawing is not None:
        _draw(described.file, drawing)
    data = described.to_dict() | {"drawing": None if drawn is None else str(drawn)}
    show(data, "\n".join([str(described), *([] if drawn is None else [f"{drawn}: the machine as understood"])]), json)


def _drawn_if_possible(file: "MachineFile", path: Path) -> Path | None:
    """Draw without being asked: the picture's path, or None with a note where it cannot be written."""
    from ptt.errors import HostError, InputError

    try:
        _draw(file, path)
    except (InputError, HostError) as error:
        note(f"not drawn: {error} (--drawing PNG names another file)")
        return None
    return path


def _draw(file: "MachineFile", path: Path) -> None:
    from ptt.show.plots.common import save
    from ptt.show.plots.machine import draw_machine

    save(draw_machine(file), path)
