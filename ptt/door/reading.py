"""Reading of files for a machine: checks of units and commands, and notes on what was understood."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from ptt.door.options import ReadOptions
from ptt.door.result import Note, ignore_note
from ptt.errors import TableError
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.run.lost import without_lost
from ptt.run.reach import require_closed
from ptt.run.readers import Ask, load_mapping
from ptt.run.readers.scale import scale_fix, scale_hint
from ptt.run.reading import read_table
from ptt.run.table import Table, unit_hint
from ptt.run.watched import watch

READINGS = {"x_meas", "y_meas", "z_meas"}


def read_rows(
    path: str | Path,
    file: MachineFile | None,
    reading: ReadOptions,
    purpose: str = "run",
    *,
    checked: bool = False,
    ordered: bool = True,
    ask: Ask | None = None,
    note: Note = ignore_note,
) -> Table:
    """Read a table for a machine, and tell what was understood of it.

    Args:
        path: the file.
        file: the machine; None where none is known.
        reading: how.
        purpose: 'run', 'targets' or 'sliders'.
        checked: whether the set-up is checked afterwards, which finds wrong units by itself.
        ordered: whether time stamps that go back are refused unless the order of the rows is stated.
        ask: who answers what the file leaves open; None makes that an error.
        note: told what was understood.

    Returns:
        The table.

    Raises:
        TableError: it cannot be read, or looks as if it were in another unit.
    """
    table = read_table(
        path,
        None if file is None else file.machine.joints,
        joint_prefix="b" if file is None else file.machine.letter,
        also=tuple(reading.also or ()),
        targets=reading.targets,
        set_values=reading.values,
        mapping=reading.map_,
        purpose=purpose,
        ask=ask,
        judge_scale=not checked,
        judge_order=ordered,
        ends=None if file is None else file.machine.travel_ends,
    )
    table = watch(without_lost(table) if purpose == "run" else table, reading.context or ())
    for line in table.understood.lines:
        note(line)
    if not checked:
        _require_size(table, file, reading)
    return table


def require_mm(table: Table, file: MachineFile | None, reading: ReadOptions) -> None:
    """Refuse metres in a mm column, unless saved answers state the units.

    Args:
        table: the rows.
        file: the machine, whose size tells more; None where none is known.
        reading: how the rows were read.

    Raises:
        TableError: they look as if they were in another unit.
    """
    hint = scale_hint(table.target, table.measured)
    if hint:
        raise TableError(hint, where=table.source, fix=f"{scale_fix(hint)} or convert them")
    _require_size(table, file, reading)


def _require_size(table: Table, file: MachineFile | None, reading: ReadOptions) -> None:
    hint = None if file is None else unit_hint(table, _size_of(file))
    if hint and not reading.states_units:
        raise TableError(hint, where=table.source, fix=f"{scale_fix(hint)}, or give their unit in a file for --map")


def require_commands(file: MachineFile, table: Table) -> None:
    """Refuse joint commands at which the links of the drawing do not meet, by line.

    Args:
        file: the machine.
        table: the rows.

    Raises:
        WorkspaceError: there are such rows.
    """
    if table.command is None:
        return
    rows = np.isfinite(table.command).all(axis=1)
    place = build_mechanism(file.machine).forward(torch.tensor(table.command[rows]))
    rows[rows] = ~torch.isfinite(place).all(dim=1).numpy()
    require_closed(table, rows)


def beyond_travel(file: MachineFile, table: Table) -> list[str]:
    """A note on each slider with no command of a run within its travel.

    Args:
        file: the machine.
        table: the rows.
    """
    if file.machine.kind != "three-ptt" or table.command is None or not np.isfinite(table.command).any(axis=0).all():
        return []
    least, most = np.nanmin(table.command, axis=0), np.nanmax(table.command, axis=0)
    return [
        f"no command of slider {leg} lies within its travel ({low:g} to {high:g} mm; the commands are "
        f"{least[leg - 1]:g} to {most[leg - 1]:g}), so none could be sent: is slider_travel_mm in {file.source} right?"
        for leg, (low, high) in enumerate(file.machine.travel_ends, 1)
        if least[leg - 1] > high or most[leg - 1] < low
    ]


def purpose_of(path: str | Path, reading: ReadOptions, ask: Ask | None = None) -> str:
    """'run' where every verb finds readings in a file, or it is paired with targets, else 'targets'.

    Bare x, y, z are readings beside commands or targets, as in any run, and targets where they stand alone.

    Args:
        path: the file.
        reading: how.
        ask: who answers what the file leaves open; None makes that an error.
    """
    from ptt.run.readers import Mapping as Answers
    from ptt.run.readers.export import Request, read_any

    if reading.targets is not None:
        return "run"
    known: Answers = load_mapping(reading.map_) if reading.map_ and Path(reading.map_).exists() else Answers()
    wanted = read_any(path, Request("targets", known, ask)).columns
    if wanted.keys() & READINGS:
        return "run"
    if all(len(column) < 2 for column in wanted.values()):
        return "targets"  # a single row, which no run has
    held = read_any(path, Request("run", known, ask)).columns
    return "run" if held.keys() & READINGS and any(name.endswith("_cmd") for name in held) else "targets"


def ask_once(ask: Ask) -> Ask:
    """Wrap a questioner so that each question is asked once, however often a file is read."""
    said: dict[tuple[str, ...], str] = {}

    def once(question: str, choices: Sequence[str]) -> str:
        key = (question, *choices)
        if key not in said:
            said[key] = ask(question, choices)
        return said[key]

    return once


def _size_of(file: MachineFile) -> float:
    """Length of a link, or of an arm stretched out, mm."""
    spec = file.machine
    if spec.kind == "three-ptt":
        return spec.link_length_mm
    return sum(math.hypot(joint.a_mm, joint.d_mm) for joint in spec.joint)
