"""A diagnosis: what a run says of the model, as it is told, shown and written."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ptt.dependence.dependence import Dependence
from ptt.diagnosis.noise.slow import Slow
from ptt.diagnosis.search.rest import Rest
from ptt.diagnosis.telling.explanation import Candidate
from ptt.effects.phrases import capital
from ptt.fitting.result import FitResult
from ptt.model.model import Model
from ptt.plan.elsewhere import Elsewhere
from ptt.plan.separation import Separation
from ptt.run.noise import Noise

Verdict = Literal["missing", "nothing-missing", "unknown", "setup"]


@dataclass(frozen=True)
class Diagnosis:
    """What the run says about the model.

    Attributes:
        verdict: 'missing', 'nothing-missing' or 'unknown'.
        verdict_probability: of each of these.
        suggested: for each step the effects that fit equally well, the pick first.
        candidates: the steps, then what else the data would call for on the model as given, best first.
        not_testable: effect -> what the data lack.
        depends_on: what the unknown depends on, largest share first.
        rest: tests of what the whole explanation leaves.
        separation: what to measure to part what cannot be told apart; None where nothing is confused.
        noise: the noise floor.
        wander: of the noise, if it has a memory.
        rms_um: error before and after the steps.
        rows: readings that counted.
        outliers: rows left out as gross errors, (n,) bool.
        elsewhere: how far commands may be off at the poses of the run and all over the workspace; None where nothing is
            named, or in runs that are diagnosed in chunks.
        opening: rows set aside: their direction of arrival, or the side on which a pin lies, is unknown, (n,) bool.
        model: the model as given with the steps, at the values that they have without unknowns beside them.
        fitted: the fit that everything was linearised at.
        words: the verdict for a machinist.
        unexplained: what nothing explains in the set-up, where that comes before any effect; '' where nothing does.
        perhaps: effects that the readings call for beside an unknown, not sure enough to be suggested.
    """

    verdict: Verdict
    verdict_probability: dict[str, float]
    suggested: tuple[tuple[str, ...], ...]
    candidates: tuple[Candidate, ...]
    not_testable: dict[str, str]
    depends_on: tuple[Dependence, ...]
    rest: Rest
    separation: Separation | None
    noise: Noise
    wander: Slow | None
    rms_um: dict[str, dict[str, float]]
    rows: int
    outliers: np.ndarray
    model: Model
    fitted: FitResult
    words: str
    elsewhere: Elsewhere | None = None
    opening: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    unexplained: str = ""
    perhaps: tuple[str, ...] = ()

    def with_unexplained(self, words: str) -> "Diagnosis":
        """An unknown of columns that disagree by more than any machine is built off: that first, no poses beside it.

        Args:
            words: what the check of the set-up says of them, '' where it says nothing.
        """
        if self.verdict != "unknown" or not words:
            return self
        return replace(self, separation=None, unexplained=words, words=f"{capital(words)}\n{self.words}")

    @property
    def measure_next(self) -> tuple[str, ...]:
        """What to measure next, in words."""
        return tuple(self.separation.lines) if self.separation else ()

    @property
    def names_size(self) -> bool:
        """Whether a size of the drawing is suggested."""
        named = {step[0] for step in self.suggested}
        return any(term.effect.of_drawing for term in self.model.terms if term.effect.key in named)

    def to_dict(self) -> dict[str, Any]:
        """For JSON, keys as documented."""
        return {
            "verdict": self.verdict,
            "verdict_probability": self.verdict_probability,
            "suggested": [list(step) for step in self.suggested],
            "candidates": [candidate.to_dict() for candidate in self.candidates],
            "not_testable": [{"effect": name, "needs": lack} for name, lack in self.not_testable.items()],
            "depends_on": [item.to_dict() for item in self.depends_on],
            "measure_next": list(self.measure_next),
            "separation": self.separation and self.separation.to_dict(),
            "noise_um": self.noise.to_dict(),
            "noise_wanders": self.wander and self.wander.to_dict(),
            "rms_um": self.rms_um,
            "elsewhere_um": self.elsewhere and self.elsewhere.to_dict(),
            "rows": self.rows,
            "outlier_rows": [int(row) for row in np.flatnonzero(self.outliers)],
            "rows_aside": [int(row) for row in np.flatnonzero(self.opening)],
            "rest": {"significant": self.rest.significant, "reasons": list(self.rest.reasons)},
            "words": self.words,
            "perhaps": list(self.perhaps),
            "unexplained": self.unexplained or None,
        }
