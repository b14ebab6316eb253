"""`ptt.simulate`: run the virtual machine through targets, or through commands that were corrected."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ptt.door.given import require_number
from ptt.door.handed import RowsLike, as_file
from ptt.door.options import ReadOptions
from ptt.door.reading import read_rows
from ptt.door.result import Note, Result, ignore_note
from ptt.errors import InputError, TableError, WorkspaceError
from ptt.rig import Rig, RunResult, load_rig, write_run
from ptt.rig import simulate as run_rig
from ptt.run.readers import Ask
from ptt.run.table import Table
from ptt.run.written import table_to_frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Simulated(Result):
    """A run of the virtual machine.

    Attributes:
        result: readings, and where tool and sliders really were.
        cycles: how often the targets were visited.
        given: whether the commands were given, not the controller's own.
        joints: b1.. in mm or q1.. in rad.
        notes: what was found on the way, a line each.
    """

    result: RunResult
    cycles: int
    given: bool
    joints: tuple[str, ...] = ("b1", "b2", "b3")
    notes: tuple[str, ...] = ()
    _written: list[str] = field(default_factory=list)

    @property
    def truth(self) -> pd.DataFrame:
        """Where tool (mm) and sliders (mm) or joints (rad) really were, and which readings are grossly wrong."""
        frame = self.result.frame[["name", "role", "repeat"]].copy()
        frame[["x_true", "y_true", "z_true"]] = self.result.truth
        frame[[f"{joint}_true" for joint in self.joints]] = self.result.slider_actual
        return frame.assign(outlier=self.result.outlier)

    def to_frame(self) -> pd.DataFrame:
        """The tracker run, as `ptt simulate` writes it; `ptt.read` takes it."""
        return self.result.frame

    def to_csv(self, path: str | Path) -> None:
        """Write the tracker run, whole or not at all.

        Args:
            path: CSV.
        """
        write_run(self.result.frame, path)
        self._written[:] = [str(path)]

    def _figures(self) -> Mapping[str, Any]:
        frame = self.result.frame
        return {
            "rows": len(frame),
            "poses": int((frame["role"] != "base").sum()),
            "cycles": self.cycles,
            "out": self._written[0] if self._written else None,
            "sliders": "given" if self.given else "controller",
            "outliers": int(self.result.outlier.sum()),
        }

    def __str__(self) -> str:
        """What the command prints."""
        data = self._figures()
        name = f"{data['out']}: " if data["out"] else ""
        return f"{name}{data['rows']} rows, {data['poses']} of them poses"

    def plot(self) -> "Figure":
        """Draw how far the readings are from the targets, along the run."""
        from ptt.show.plots.corrections import draw_misses

        return draw_misses(self.result.frame)


def simulate(
    rig: Rig | str | Path,
    targets: RowsLike,
    *,
    sliders: RowsLike = None,
    noise: bool = True,
    seed: int | None = None,
    map: str | Path | None = None,
) -> Simulated:
    """Run the virtual machine: targets or corrected commands in, a tracker run out.

    Args:
        rig: faults and conditions of the virtual machine.
        targets: tool positions to visit, in travel order; where they stand beside commands, as `predict` hands back,
            these are sent.
        sliders: commands to send; None: those beside the targets, else the controller's own.
        noise: with or without everything random.
        seed: of the noise of this run; the machine stays.
        map: saved answers on columns and units.

    Returns:
        The run.

    Raises:
        InputError: a file that cannot be read, or commands for other targets.
        WorkspaceError: targets that the machine cannot reach.
    """
    machine = _rig(rig)
    reading = ReadOptions(map_=None if map is None else Path(map), json=True)
    with as_file(targets, "simulate(rig, targets)") as path:
        if sliders is None:
            return simulate_path(machine, path, None, reading, noise=noise, seed=seed)
        with as_file(sliders, "simulate(rig, targets, sliders=...)") as commands:
            return simulate_path(machine, path, commands, reading, noise=noise, seed=seed)


def simulate_path(
    machine: Rig,
    targets: Path,
    sliders: Path | None,
    reading: ReadOptions,
    *,
    noise: bool = True,
    seed: int | None = None,
    ask: Ask | None = None,
    note: Note = ignore_note,
) -> Simulated:
    """Simulate as the command line does.

    Args:
        machine: the rig.
        targets: CSV of targets.
        sliders: CSV of commands; None: those beside the targets, else the controller's own.
        reading: how they are read.
        noise: with or without everything random.
        seed: of the noise.
        ask: who answers what the files leave open.
        note: told what was understood.
    """
    require_number(seed, 0, "seed", whole=True)
    wanted = read_rows(targets, machine.machine, reading, "targets", ask=ask, note=note)
    notes = []
    if sliders is None and _holds_commands(wanted, machine.sent):
        sliders = targets
        notes.append(f"driven by the commands {wanted.joint_prefix}1.. in {targets}, as with --sliders {targets}")
        note(notes[0])
    sent = None
    if sliders is not None:
        sent = _sliders(sliders, wanted, read_rows(sliders, machine.machine, reading, "sliders", ask=ask, note=note))
    with _named(wanted):
        result = run_rig(machine, _commands(wanted), sliders=sent, noise=noise, seed=seed)
    return Simulated(result, machine.conditions.cycles, sent is not None, tuple(machine.sent), tuple(notes))


@contextmanager
def _named(targets: Table) -> Iterator[None]:
    """Restate an error on a target with the line of its file; the rig only knows its row number."""
    try:
        yield
    except WorkspaceError as error:
        first = error.rows[0] if error.rows else 0
        counted = f"row {first + 1} of the targets "
        if not error.what.startswith(counted):
            raise
        what = error.what.removeprefix(counted)
        raise WorkspaceError(what, error.rows, where=targets.place(first), fix=error.fix) from error


def _rig(rig: Rig | str | Path) -> Rig:
    if isinstance(rig, Rig):
        return rig
    if isinstance(rig, str | Path):
        return load_rig(rig)
    what = f"simulate(rig, targets): got a {type(rig).__name__} where the rig belongs"
    raise InputError(what, fix="give the path of a RIG.toml")


def _commands(table: Table) -> pd.DataFrame:
    """The targets as the rig reads them; every pose keeps its role."""
    frame = table_to_frame(table)
    frame["role"] = table.role
    return frame


def _holds_commands(table: Table, joints: list[str]) -> bool:
    """Whether the file of targets has columns of commands too, as `ptt predict` writes them."""
    beside = {title.strip().lower() for title in table.understood.ignored}
    return {*joints} <= beside


def _sliders(path: Path, wanted: Table, sent: Table) -> pd.DataFrame:
    """Columns b1.. or q1.., refused where they were made for other targets."""
    if sent.rows != wanted.rows:
        fix = f"predict the commands from {wanted.source}"
        raise TableError(f"{sent.rows} rows for {wanted.rows} targets of {wanted.source}", where=str(path), fix=fix)
    apart = np.abs(sent.target - wanted.target).max(axis=1) > 1e-6
    if apart.any():
        row = int(np.argmax(apart))
        fix = f"predict the commands from {wanted.source}"
        raise TableError(f"made for another target than {wanted.place(row)}", where=sent.place(row), fix=fix)
    return pd.DataFrame(sent.command, columns=[f"{sent.joint_prefix}{joint + 1}" for joint in range(sent.joints)])
