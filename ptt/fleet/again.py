"""Has a machine changed since its model was made? `ptt recheck`; a diagnosis where the model has nothing to recheck."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.again.recheck import recheck
from ptt.diagnosis.diagnose import diagnose_run
from ptt.effects import Library
from ptt.fitting.solve import residual_of, rms
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem


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
    found = recheck(model, problem, known, progress=tell)
    added = [] if found.new is None else [step[0] for step in found.new.suggested]
    return Again(found.verdict, found.words, found.to_dict(), added, found.error_um["expected"], found.error_um["now"])


def _against_the_drawing(model: Model, problem: Problem, known: Library, tell: Tell) -> Again:
    """A machine on which nothing was found has no values that could change; whatever is found now is new."""
    found = diagnose_run(model, problem, known, progress=tell)
    verdict = "same" if found.verdict == "nothing-missing" else "new"
    as_given = residual_of(model, problem, found.noise)  # a diagnosis fits the frame, even one that reflectors hold
    rows = problem.used & ~as_given.outliers & np.isfinite(as_given.residual).all(axis=1)
    added, now = [step[0] for step in found.suggested], rms(as_given.residual, rows)["total"]
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
