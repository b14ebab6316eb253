"""`ptt check`: mistakes in the set-up of a run and its machine, before any physics; or what a machine file says."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ptt.commands.common import Also, Json, Map, Reading, Set, Targets, note, open_model, read_rows, show, states_units

if TYPE_CHECKING:
    from ptt.machine import MachineFile
    from ptt.setup import Check

First = Annotated[Path, typer.Argument(metavar="RUN.csv|MACHINE.toml", help="A run, or a machine file alone.")]
Machine = Annotated[Path | None, typer.Option("--model", metavar="M", help="machine.toml or compensator folder.")]
OutRun = Annotated[Path | None, typer.Option("--out-run", metavar="R2.csv", help="Write the run with mistakes undone.")]
OutModel = Annotated[
    Path | None, typer.Option("--out-model", metavar="M2.toml", help="Write the machine file with mistakes undone.")
]
Drawing = Annotated[Path | None, typer.Option("--drawing", metavar="PNG", help="Draw the machine as understood.")]


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
    json: Json = False,
) -> None:
    """Look for mistakes in the set-up: axes, units, sliders, lengths, rows, frames. A machine file alone is drawn."""
    from ptt.errors import InputError
    from ptt.setup import check_setup

    if model is None and (run.suffix == ".toml" or run.is_dir()):
        _show_machine(run, drawing, json)
        return
    if model is None:
        raise InputError("no machine to hold it against", where=str(run), fix="add --model MACHINE.toml")
    file = open_model(model).model.file
    reading = Reading(also, targets, set_, map_, json=json)
    table = read_rows(run, file, reading, _purpose(run, reading), checked=True, ordered=False)
    ordered = any(text.startswith("order=") for text in set_ or ())
    found = check_setup(file, table, ordered=ordered, units_said=states_units(map_))
    _write(found, file, out_run, out_model, several=bool(also))
    if drawing is not None:
        _draw(file, drawing)
    show(found.to_dict(), str(found), json)


def _purpose(run: Path, reading: Reading) -> str:
    """'run' where the file holds readings, else 'targets'."""
    from ptt.run.readers import Mapping, load_mapping
    from ptt.run.readers.export import Request, read_any

    if reading.targets is not None:
        return "run"
    known = load_mapping(reading.map_) if reading.map_ is not None and reading.map_.exists() else Mapping()
    export = read_any(run, Request("targets", known))
    return "run" if {"x_meas", "y_meas", "z_meas"} & set(export.columns) else "targets"


def _write(found: "Check", file: "MachineFile", out_run: Path | None, out_model: Path | None, several: bool) -> None:
    from ptt.commands.common import refuse_readings
    from ptt.errors import InputError
    from ptt.machine import save_machine
    from ptt.run.table import write_table

    if out_run is not None:
        if several:
            raise InputError("one file for several runs", where="--out-run", fix="check each run by itself")
        refuse_readings(out_run)
        if found.table is not None:
            write_table(found.table, out_run)
        note(f"{out_run}: the run, with what was sure undone")
    if out_model is not None:
        save_machine(found.file, out_model)
        changed = "with what was sure undone" if found.file.machine != file.machine else "as it was: nothing to undo"
        note(f"{out_model}: the machine file, {changed}")


def _show_machine(path: Path, drawing: Path | None, json: bool) -> None:
    from ptt.setup.machine import describe_machine

    file = open_model(path).model.file
    described = describe_machine(file)
    drawing = drawing or Path(f"{(path / 'machine' if path.is_dir() else path).with_suffix('')}_drawing.png")
    _draw(file, drawing)
    data: dict[str, Any] = described.to_dict() | {"drawing": str(drawing)}
    show(data, f"{described}\n{drawing}: what was understood, drawn", json)


def _draw(file: "MachineFile", path: Path) -> None:
    from ptt.show.plots.machine import plot_machine

    plot_machine(file, path)
    note(f"{path}: the machine as understood")
