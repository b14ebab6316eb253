"""Has a machine changed since its model was made? `ptt recheck`; a diagnosis where the model has nothing to recheck."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

from scipy import stats

from ptt.diagnosis.long import choose_diagnosis
from ptt.effects import Library
from ptt.fitting.solve import fit, residual_of
from ptt.model.model import Model
from ptt.run.problem import Problem

Tell = Callable[[str], None]
CHANCE = 0.01  # that a machine that has not changed is said to have
OTHERWISE = "The values of the model are no longer those of the machine; what moves stands with the trends."


@dataclass(frozen=True)
class Again:
    """What a later run says.

    Attributes:
        verdict: 'same', 'changed' or 'new'.
        words: for a person.
        result: as `ptt recheck --json` has it.
        added: effects that are new.
        expected_um: error of a machine that has not changed.
        now_um: error of this run with the model as it was.
    """

    verdict: str
    words: str
    result: dict[str, Any]
    added: list[str]
    expected_um: float | None
    now_um: float | None


def hold_against(model: Model, problem: Problem, known: Library, tell: Tell) -> Again:
    """Hold a later run against the model that an earlier one made.

    Args:
        model: as it holds for the run.
        problem: the run, with its noise floor.
        known: effects by name.
        tell: told what is being done.

    Returns:
        What it says.
    """
    if not any(len(term.theta) for term in model.terms):
        return _against_the_drawing(model, problem, known, tell)
    try:
        recheck = import_module("ptt.recheck.recheck").recheck
    except ModuleNotFoundError:
        again = _against_the_drawing(model, problem, known, tell)
        changed = again.verdict == "same" and _otherwise(model, problem)
        return replace(again, verdict="changed", words=OTHERWISE) if changed else again
    found = recheck(model, problem, known, progress=tell)
    added = [] if found.new is None else [step[0] for step in found.new.suggested]
    return Again(found.verdict, found.words, found.to_dict(), added, found.error_um["expected"], found.error_um["now"])


def _otherwise(model: Model, problem: Problem) -> bool:
    """Whether the model's values fit this run worse than its own do, by more than chance (F test).

    The values of the model are as uncertain as those of the run, which halves what their difference is worth.
    """
    held, free = residual_of(model, problem), fit(model, problem)
    count = len(free.unknowns) - len(held.unknowns)
    scatter = max(1.0, free.chi2 / max(free.freedom, 1))
    worse = (held.chi2 - free.chi2) / max(count, 1) / 2.0 / scatter
    return count > 0 and bool(stats.f.sf(worse, count, max(free.freedom, 1)) < CHANCE)


def _against_the_drawing(model: Model, problem: Problem, known: Library, tell: Tell) -> Again:
    """A machine on which nothing was found has no values that could change; whatever is found now is new."""
    found = choose_diagnosis(problem.table.rows)(model, problem, known, progress=tell)
    verdict = "same" if found.verdict == "nothing-missing" else "new"
    added, now = [step[0] for step in found.suggested], float(found.rms_um["before"]["total"])
    expected = 1e3 * found.noise.total
    result = {
        "verdict": verdict,
        "changed": [],
        "suggested": [list(step) for step in found.suggested],
        "new": found.to_dict() if verdict == "new" else None,
        "error_um": {"expected": expected, "now": now},
        "since": None,
        "words": found.words,
    }
    return Again(verdict, found.words, result, added, expected, now)
