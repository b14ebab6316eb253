"""`ptt.check`: mistakes in the set-up before any physics, or what a machine file alone says."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.door.handed import RowsLike
from ptt.door.model import Model, as_model
from ptt.door.opened import find_mistakes
from ptt.door.options import ReadOptions
from ptt.door.reading import ask_once, purpose_of, read_rows, require_commands
from ptt.door.result import Note, Result, ignore_note
from ptt.door.run import Run, Targets
from ptt.door.words import as_run, read_for
from ptt.errors import MachineError
from ptt.machine import MachineFile
from ptt.run.readers import Ask
from ptt.run.reading import same_rows
from ptt.run.table import Table
from ptt.setup import Check, Finding
from ptt.setup.machine import MachineSaid, describe_machine
from ptt.setup.unbuilt import read_unbuilt

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

USAGE = "check(model, run)"


@dataclass(frozen=True, eq=False, repr=False)
class Checked(Result):
    """What was found in the set-up of a run and its machine.

    Attributes:
        found: the findings, and machine file and run with the sure ones corrected.
        drawn: the machine file as it was given.
        read: the run as it was read.
    """

    found: Check
    drawn: MachineFile
    read: Table

    @property
    def machine_is_as_it_was(self) -> bool:
        """Whether nothing was corrected in the machine file."""
        return (self.file.machine, self.file.tracker) == (self.drawn.machine, self.drawn.tracker)

    @property
    def run_is_as_it_was(self) -> bool:
        """Whether nothing was corrected in the run."""
        return self.table is None or same_rows(self.table, self.read)

    @property
    def ok(self) -> bool:
        """Whether no finding is sure."""
        return self.found.ok

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings, the sure ones first."""
        return self.found.findings

    @property
    def file(self) -> MachineFile:
        """The machine file, with its sure mistakes corrected."""
        return self.found.file

    @property
    def table(self) -> Table | None:
        """The run, with its sure mistakes corrected."""
        return self.found.table

    def _figures(self) -> Mapping[str, Any]:
        return self.found.to_dict()

    def __str__(self) -> str:
        """The findings as text."""
        return str(self.found)

    def to_frame(self) -> "pd.DataFrame":
        """One row for each finding."""
        import pandas as pd

        return pd.DataFrame([{**each.pop("rms_um"), **each} for each in self._figures()["findings"]])

    def plot(self) -> "Figure":
        """Draw the machine as understood."""
        return draw(self.drawn)


@dataclass(frozen=True, eq=False, repr=False)
class Described(Result):
    """What a machine file alone says.

    Attributes:
        said: figures of the machine, and remarks.
        file: the machine.
    """

    said: MachineSaid
    file: MachineFile

    def _figures(self) -> Mapping[str, Any]:
        return self.said.to_dict()

    def __str__(self) -> str:
        """A few lines and the remarks."""
        return str(self.said)

    def plot(self) -> "Figure":
        """Draw the machine as understood."""
        return draw(self.file)


def check(model: Any, run: RowsLike = None) -> Checked | Described:
    """Look for mistakes in the set-up: axes, units, sliders, lengths, rows, frames.

    Args:
        model: the machine.
        run: a run, or targets; None tells what the machine file alone says.

    Returns:
        The findings, `Checked`; without a run a `Described`: figures in `.said`, machine in `.file`, no findings.

    Raises:
        InputError: a file that cannot be read.
        WorkspaceError: the links do not meet at some commands, and no mistake was found that explains it.
    """
    machine = as_model(model, USAGE)
    if run is None:
        return describe(machine)
    if isinstance(run, Run | Targets):
        return _checked(machine.file, read_for(run, machine))
    if hasattr(run, "columns"):
        return _checked(machine.file, as_run(run, machine, USAGE))
    return check_path(machine, run, ReadOptions(json=True))


def check_path(
    model: Model, run: RowsLike, reading: ReadOptions, *, ask: Ask | None = None, note: Note = ignore_note
) -> Checked:
    """Check a file as the command line does: rows out of order are a finding, not a refusal.

    Args:
        model: the machine.
        run: a run or targets.
        reading: how.
        ask: who answers what the file leaves open.
        note: told what was understood.
    """
    return _check_rows(model.file, run, reading, ask, note)


def check_unbuilt(
    path: Path,
    refused: MachineError,
    run: RowsLike,
    reading: ReadOptions,
    ask: Ask | None = None,
    note: Note = ignore_note,
) -> Checked:
    """`check_path` with a machine file whose sizes make no machine, as a diameter given for a radius does.

    Args:
        path: of the machine file.
        refused: the error that was raised when it was read.
        run: a run or targets.
        reading: how.
        ask: who answers what the file leaves open.
        note: told what was understood.

    Raises:
        MachineError: `refused`, where no radius is the cause or the run does not show which.
    """
    file = read_unbuilt(path) if path.is_file() else None
    if file is None:
        raise refused
    found = _check_rows(file, run, reading, ask, note, refused)
    if not any(each.mistake == "diameter-for-radius" for each in found.findings):
        raise refused
    return found


def _check_rows(
    file: MachineFile,
    run: RowsLike,
    reading: ReadOptions,
    ask: Ask | None,
    note: Note,
    refused: MachineError | None = None,
) -> Checked:
    ask = ask and ask_once(ask)
    purpose = purpose_of(run, reading, ask)
    table = read_rows(run, file, reading, purpose, checked=True, ordered=False, ask=ask, note=note)
    rows = (Run if purpose == "run" else Targets)(table, (run,), reading)
    return _checked(file, rows) if refused is None else Checked(find_mistakes(file, rows), file, table)


def _checked(file: MachineFile, rows: Run | Targets) -> Checked:
    """The findings; without any, commands at which the links do not meet are refused, as by every verb."""
    found = find_mistakes(file, rows)
    if not found.findings and not found.unexplained:
        require_commands(file, rows.table)
    return Checked(found, file, rows.table)


def describe(model: Model) -> Described:
    """Say what a machine file alone says."""
    return Described(describe_machine(model.file), model.file)


def draw(file: MachineFile) -> "Figure":
    """Draw a machine as understood: a 3-PTT with its sliders, an arm with its workspace."""
    from ptt.mechanisms import build_mechanism
    from ptt.mechanisms.serial import Serial

    mechanism = build_mechanism(file.machine)
    if isinstance(mechanism, Serial):
        from ptt.show.plots.arm_dexterity import draw_arm_dexterity

        return draw_arm_dexterity(mechanism)
    from ptt.show.plots.machine import draw_machine

    return draw_machine(file)
