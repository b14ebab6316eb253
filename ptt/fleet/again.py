"""Has the machine changed since? The seam to `ptt recheck`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.effects import Library
from ptt.fitting.solve import residual_of, rms
from ptt.model.model import Model
from ptt.run.problem import Problem


@dataclass(frozen=True)
class Again:
    """What a recheck says.

    Attributes:
        verdict: 'same', 'changed' or 'new'.
        words: for a person.
        result: as `ptt recheck --json` has it.
        added: effects that are new.
        expected_um: error when the model was made.
        now_um: error of this run with that model.
    """

    verdict: str
    words: str
    result: dict[str, Any]
    added: list[str]
    expected_um: float | None
    now_um: float | None


def recheck_run(model: Model, problem: Problem, known: Library, tell: Callable[[str], None]) -> Again:
    """Compare a run with a solved model."""
    found = residual_of(model, problem)
    rows = problem.used & ~found.outliers & np.isfinite(found.residual).all(axis=1)
    now = rms(found.residual, rows)["total"]
    return Again("same", "", {}, [], None, float(now))
