"""The error of the model as given under other assumptions on the tracker, where that helps to read the verdict."""

from dataclasses import replace

from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.verdict_words import held_to_base, with_free_mount
from ptt.fitting.result import left_um
from ptt.fitting.solve import residual_of
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem

# Share of the error that may be left with a free mount for it to be mentioned: else the model misses the rest
MUCH_LESS = 0.5


def with_other_setups(result: Diagnosis, model: Model, problem: Problem, how: str) -> Diagnosis:
    """A diagnosis with words on other set-ups of the tracker; a free reflector that explains much comes first.

    Args:
        result: the diagnosis.
        model: as given.
        problem: as of `by_base`.
        how: words that follow the verdict; '' for none.
    """
    first = by_mount(model, problem)
    if not first and result.suggested:  # joint zeros, say, may be the larger part of the error
        first = by_mount(result.model, problem, "the model with the named effects")
    head = f"{first}\n" if first else ""
    return replace(result, first=first, words=f"{head}{result.words}{how}{by_base(model, problem)}")


def by_base(model: Model, problem: Problem) -> str:
    """Words on the error of the model as given in the frame of the base reflectors; '' where there are none.

    Args:
        model: as given.
        problem: all readings, as in `ptt compare` and `ptt add`, rows that open a run included.
    """
    return "" if problem.base is None else held_to_base(left_um(residual_of(model, problem), problem))


def by_mount(model: Model, problem: Problem, called: str = "the model as given") -> str:
    """Words where an arm's reflector beside the tool point would explain much; '' else, or where it is not trusted.

    No link value does the same as a tool point off the last axis, so links, joints and the tracker's scale would take
    values that no machine has, and the corrected arm would be worse.

    Args:
        model: whose error it is.
        problem: as of `by_base`.
        called: the model in words.
    """
    tracker = problem.file.tracker
    if problem.file.machine.kind != "serial" or tracker.tool != "trusted":
        return ""
    free = replace(model, file=replace(model.file, tracker=tracker.model_copy(update={"tool": "fitted"})))
    there = build_problem(free.file, problem.table).masked(~problem.used)
    before, after = left_um(residual_of(model, problem), problem), left_um(residual_of(free, there), there)
    return with_free_mount(before, after, called) if after < MUCH_LESS * before else ""
