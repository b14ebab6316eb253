"""Comparison of a later run with the machine's model: a recheck, or a diagnosis where the model has no effects."""

from dataclasses import dataclass
from typing import Any

from ptt.again.recheck import recheck
from ptt.diagnosis.diagnose import diagnose_run
from ptt.effects import Library
from ptt.fitting.result import left_um
from ptt.fitting.solve import residual_of
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem


@dataclass(frozen=True)
class Rechecked:
    """How a later run compares with the machine's model.

    Attributes:
        verdict: 'same', 'changed' or 'new'.
        words: the verdict for a person.
        result: as `ptt recheck --json`.
        added: effects that are new.
        expected_um: rms error of this run if the machine has not changed; None where unknown.
        now_um: rms error of this run with the model as it was.
    """

    verdict: str
    words: str
    result: dict[str, Any]
    added: list[str]
    expected_um: float | None
    now_um: float | None


def recheck_or_diagnose(model: Model, problem: Problem, known: Library, tell: Tell, unexplained: str = "") -> Rechecked:
    """Compare a later run with the model that was fitted to an earlier one.

    Args:
        model: the model as it applies to the run.
        problem: the run, with its noise floor.
        known: effects by name.
        tell: told what is being done.
        unexplained: words of the set-up check on columns that disagree beyond any machine's errors; '' for none.

    Returns:
        The comparison.
    """
    if not any(len(term.theta) for term in model.terms):
        return _against_the_drawing(model, problem, known, tell, unexplained)
    found = recheck(model, problem, known, progress=tell).with_unexplained(unexplained)
    added = [] if found.new is None else found.new.to_add
    error = found.error_um
    return Rechecked(found.verdict, found.words, found.to_dict(), added, error["expected"], error["now"])


def _against_the_drawing(model: Model, problem: Problem, known: Library, tell: Tell, unexplained: str) -> Rechecked:
    """A model without effects has no values that could have changed; whatever a diagnosis finds is new."""
    found = diagnose_run(model, problem, known, progress=tell).with_unexplained(unexplained)
    verdict = "same" if found.verdict == "nothing-missing" else "new"
    as_given = residual_of(model, problem, found.noise)  # a diagnosis fits the frame, even one that reflectors hold
    added, now = found.to_add, left_um(as_given, problem)
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
    return Rechecked(verdict, found.words, result, added, expected, now)
