"""The error of the model as given under other assumptions on the tracker, where that helps to read the verdict."""

from dataclasses import replace

from ptt.diagnosis.telling.verdict_words import held_to_base, with_free_mount
from ptt.fitting.result import left_um
from ptt.fitting.solve import residual_of
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem

# Share of the error that may be left with a free mount for it to be mentioned: else the model misses the rest
MUCH_LESS = 0.5


def other_setups(model: Model, problem: Problem) -> str:
    """Words on the error of the model as given in the frame of the base reflectors, and with the reflector free.

    Args:
        model: as given.
        problem: all readings, as in `ptt compare` and `ptt add`, rows that open a run included.

    Returns:
        The words; empty where there are no base reflectors and no trusted reflector whose position would explain the
        error.
    """
    return _by_base(model, problem) + _by_mount(model, problem)


def _by_base(model: Model, problem: Problem) -> str:
    return "" if problem.base is None else held_to_base(left_um(residual_of(model, problem), problem))


def _by_mount(model: Model, problem: Problem) -> str:
    """Words where a free reflector explains much: no link value does the same as a tool point off the last axis."""
    tracker = problem.file.tracker
    if problem.file.machine.kind != "serial" or tracker.tool != "trusted":
        return ""
    free = replace(model, file=replace(model.file, tracker=tracker.model_copy(update={"tool": "fitted"})))
    there = build_problem(free.file, problem.table).masked(~problem.used)
    after = left_um(residual_of(free, there), there)
    return with_free_mount(after) if after < MUCH_LESS * left_um(residual_of(model, problem), problem) else ""
