"""A task unpacked in the process that works on it: its table, its set-up check, its problem and its model."""

from collections.abc import Sequence
from dataclasses import dataclass

from ptt.diagnosis.telling.floor import noise_floor
from ptt.effects import Library, library
from ptt.fleet.task import Task
from ptt.machine import parse_machine
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.model.of_run import for_runs
from ptt.run.conditions import settle_conditions
from ptt.run.from_columns import columns_to_table
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table
from ptt.setup import Check, check_setup


@dataclass(frozen=True)
class Opened:
    """A run, and the model that it is compared with.

    Attributes:
        model: the model as it applies to this run.
        problem: the readings, with their noise floor.
        known: effects by name.
    """

    model: Model
    problem: Problem
    known: Library


def read_task(task: Task) -> tuple[Table, Check]:
    """The table of a run as `ptt.read` has it, and the check of its set-up; the store keeps what was read."""
    file = parse_machine(task.drawing, task.machine)
    read = columns_to_table(task.columns, task.file, task.run, file.machine.letter, file.machine.joints)
    table, _ = settle_conditions(read)
    return table, check_setup(file, table, ordered=task.ordered, units_said=task.units_said)


def open_task(task: Task, table: Table, effects: Sequence[str] = ()) -> Opened:
    """The problem that a run poses, and the model that it is compared with.

    Args:
        task: the run.
        table: its readings, from `read_task`.
        effects: paths, as this process sees them, of Python files with effects of the user's own.
    """
    known = library(*effects)
    given = read_model(parse_machine(task.solved or task.drawing, task.machine), known)
    problem = build_problem(given.file, table)
    model, _ = for_runs(given, problem)
    return Opened(model, problem.with_noise(noise_floor(model, problem, known)), known)
