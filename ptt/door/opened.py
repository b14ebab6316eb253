"""A run opened with a model: the checks before every verb, and the noise floor of the run."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ptt.correct.training.compensator import Compensator
from ptt.diagnosis.telling.floor import noise_floor
from ptt.door.model import Model, load
from ptt.door.options import ReadOptions
from ptt.door.reading import require_commands
from ptt.door.result import Note, ignore_note
from ptt.door.run import Run, Targets, read_path
from ptt.effects.registry import Library
from ptt.errors import SetupError, TableError
from ptt.machine import MachineFile
from ptt.model.model import Model as Physics
from ptt.model.of_run import for_runs
from ptt.progress import Progress, unwatched
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.readers import Ask
from ptt.run.table import Table
from ptt.run.taken import set_up, set_up_lines
from ptt.setup import Check, check_setup


@dataclass(frozen=True)
class Opened:
    """A run and a model for it, checked.

    Attributes:
        compensator: the model, and the network where there is one.
        table: the rows.
        problem: the rows with the kinematics of the machine.
        files: the run files, in the order given.
        library: effects by name, the user's own included.
        check: findings about the set-up.
        run: as it was read; keeps the temporary files of data frames alive.
        model_path: file or folder of the model; None where it has none.
    """

    compensator: Compensator
    table: Table
    problem: Problem
    files: tuple[str, ...]
    library: Library
    check: Check
    run: Run = field(repr=False)
    model_path: Path | None = None

    @property
    def model(self) -> Physics:
        """The physics."""
        return self.compensator.model

    @property
    def set_up(self) -> dict[str, Any]:
        """Frames of targets and tracker, and effects of other runs that are left out, for JSON."""
        return set_up(self.problem) | {"other_runs": [term.effect.key for term in self.model.aside]}

    def noise(self) -> Noise:
        """The noise floor: from repeats, standard deviations or the machine file, else from the saturated model.

        Raises:
            TableError: nothing tells it.
        """
        return noise_floor(self.model, self.problem, self.library)

    def noisy(self, progress: Progress = unwatched) -> Problem:
        """The problem with its noise floor."""
        progress("noise", 0, 1)
        return self.problem.with_noise(self.noise())

    def as_noisy(self, note: Note = ignore_note) -> Problem:
        """The problem with its noise floor, without it where nothing tells it."""
        noise = self.noise_or_none(note)
        return self.problem if noise is None else self.problem.with_noise(noise)

    def noise_or_none(self, note: Note = ignore_note) -> Noise | None:
        """The noise floor; None where nothing tells it."""
        try:
            return self.noise()
        except TableError as error:
            note(f"noise floor unknown: {error}")
            return None


def open_run(
    run: str | Path, model: str | Path, reading: ReadOptions, *, ask: Ask | None = None, note: Note = ignore_note
) -> Opened:
    """Read a run and a model, and check the run against the model.

    Args:
        run: tracker CSV.
        model: machine.toml or compensator folder.
        reading: how.
        ask: who answers what the file leaves open; None makes that an error.
        note: told what was understood and found.

    Returns:
        Both.

    Raises:
        InputError: whatever cannot be read or used.
        SetupError: a mistake in the set-up that makes the rest worthless, unless `reading.anyway`.
    """
    loaded = load(model, effects=reading.effects or ())
    return open_checked(loaded, read_path(run, loaded, reading, ask=ask, note=note), anyway=reading.anyway, note=note)


def open_checked(model: Model, run: Run, *, anyway: bool = False, note: Note = ignore_note) -> Opened:
    """Check a run against a model, and build the problem.

    Args:
        model: machine, effects, network.
        run: as read.
        anyway: whether to go on although the set-up looks mistaken.
        note: told what was found and assumed.

    Returns:
        Both, the model as it holds for this run.

    Raises:
        InputError: the run does not fit this machine.
        SetupError: a mistake in the set-up that is sure, unless `anyway`.
    """
    physics, table = model.physics, run.table
    setup = check_rows(physics.file, run, anyway=anyway, note=note)
    try:
        require_commands(physics.file, table)
        table, problem = _seen(physics.file, table, anyway=anyway and bool(setup.sure), note=note)
    except Exception as error:
        if not setup.sure:
            raise
        raise SetupError(f"{_told(table, setup)}; nothing more can be said before that ({error})", setup) from error
    fitting, lines = for_runs(physics, problem)
    for line in (*set_up_lines(problem), *lines):
        note(line)
    compensator = replace(model.compensator, model=fitting)
    files = tuple(str(path) for path in run.files)
    return Opened(compensator, table, problem, files, model.library, setup, run, model.path)


def _seen(file: MachineFile, table: Table, *, anyway: bool, note: Note) -> tuple[Table, Problem]:
    """Build the problem; with `anyway` without the targets where these contradict the joint commands."""
    try:
        return table, build_problem(file, table)
    except TableError as error:
        if not anyway or table.command is None:
            raise
        note(f"{error}; going on without the targets")
        table = table.replace(target=np.full_like(table.target, np.nan))
        return table, build_problem(file, table)


def find_mistakes(file: MachineFile, rows: Run | Targets) -> Check:
    """Look for set-up mistakes before any physics.

    Args:
        file: the machine.
        rows: a run or targets.

    Returns:
        What was found.
    """
    return check_setup(file, rows.table, ordered=rows.reading.ordered, units_said=rows.reading.states_units)


def check_rows(file: MachineFile, rows: Run | Targets, *, anyway: bool = False, note: Note = ignore_note) -> Check:
    """Look for set-up mistakes before any physics; what is not sure is a note.

    Args:
        file: the machine.
        rows: a run or targets.
        anyway: whether a mistake that is sure is a note as well.
        note: told what is not sure.

    Returns:
        What was found.

    Raises:
        SetupError: a mistake that is sure.
    """
    setup = find_mistakes(file, rows)
    if setup.sure and not anyway:
        raise SetupError(f"{_told(rows.table, setup)}. `ptt check` writes cured files, --anyway goes on", setup)
    for finding in setup.findings:
        if finding.mistake == "target-frame":
            continue  # `build_problem` handles it, and `set_up_lines` reports it
        note(f"set-up: {'' if finding.sure else 'perhaps '}{finding.mistake}: {finding.words}; {finding.fix}")
    if setup.unexplained:
        note(f"set-up: {setup.unexplained}")
    return setup


def _told(table: Table, setup: Check) -> str:
    told = "; ".join(f"{item.mistake}: {item.words}. Cure: {item.fix}" for item in setup.sure)
    return f"{table.source}: {told}"
