"""A run and a model brought together, as every worker does it: read, checked, seen through its machine."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ptt.diagnosis.telling.floor import noise_floor
from ptt.effects import Library, library
from ptt.fleet.readings import columns_to_table
from ptt.fleet.task import Task
from ptt.machine import parse_machine
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.model.of_run import for_runs
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table
from ptt.run.target_frame import kept_frame
from ptt.setup import Check, check_setup


@dataclass(frozen=True)
class Opened:
    """A run beside a model.

    Attributes:
        model: as it holds for this run.
        problem: the readings, with their noise floor.
        known: effects by name.
    """

    model: Model
    problem: Problem
    known: Library


def read_task(task: Task) -> tuple[Table, Check]:
    """The table of a run, and what is mistaken in its set-up."""
    table = columns_to_table(task.columns, task.file, task.run)
    file = parse_machine(task.drawing, task.machine)
    return table, check_setup(file, table, ordered=task.ordered, units_said=task.units_said)


def open_task(task: Task, table: Table, effects: Sequence[str] = ()) -> Opened:
    """A run seen through its machine, with the model that it is held against.

    Args:
        task: the run.
        table: its readings.
        effects: Python files with effects of the user's own, where this process sees them.
    """
    known = library(*effects)
    given = read_model(parse_machine(task.solved or task.drawing, task.machine), known)
    problem = build_problem(given.file, table)
    model, _ = for_runs(given, problem)
    model = replace(model, file=replace(model.file, targets=kept_frame(model.file.targets, problem.stated_in)))
    return Opened(model, problem.with_noise(noise_floor(model, problem, known)), known)
