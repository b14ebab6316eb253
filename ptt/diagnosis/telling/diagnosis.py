"""The result of a diagnosis, with its JSON."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ptt.dependence.dependence import Dependence
from ptt.diagnosis.noise.slow import Slow
from ptt.diagnosis.search.rest import Rest
from ptt.diagnosis.telling.explanation import Candidate
from ptt.diagnosis.telling.mimic import is_growth
from ptt.diagnosis.telling.next_look import asks_for_poses, next_look
from ptt.diagnosis.telling.verdict_words import mostly_untold
from ptt.effects.phrases import capital
from ptt.fitting.result import FitResult
from ptt.model.model import Model
from ptt.plan.elsewhere import Elsewhere
from ptt.plan.separation import Separation
from ptt.run.noise import Noise

Verdict = Literal["missing", "nothing-missing", "unknown"]

SCALE_BAR = (
    "Read a calibrated scale bar with the tracker: no pose tells its scale from that of the machine, which is longer "
    "in all its parts where it is warmer than its drawing says."
)


@dataclass(frozen=True)
class Diagnosis:
    """What a run shows about a model.

    Attributes:
        verdict: 'missing', 'nothing-missing' or 'unknown'.
        verdict_probability: of each of these.
        suggested: for each step the effects that fit equally well, the pick first.
        candidates: the steps, then other effects that would improve the model as given, best first.
        not_testable: effect -> what the data lack.
        depends_on: what the unknown depends on, largest share first.
        rest: tests of the residuals.
        separation: poses that would separate effects that cannot be told apart; None where there are none.
        noise: the noise floor.
        wander: the noise's wander; None for none.
        rms_um: error before and after the steps.
        rows: readings that counted.
        outliers: rows left out as gross errors, (n,) bool.
        elsewhere: expected error of commands at the poses of the run and all over the workspace; None where nothing is
            named, or for runs that are diagnosed in chunks.
        opening: rows set aside: their direction of arrival, or the side on which a pin lies, is unknown, (n,) bool.
        model: the model as given with the steps, at the values that they have without unknowns beside them.
        fitted: the fit that everything was linearised at.
        words: the verdict for a machinist.
        first: words on what to settle before any effect is added, which the words begin with; '' for nothing.
        unexplained: words on columns that disagree beyond any machine's errors, from the set-up check; '' for none.
        perhaps: effects that are not certain enough to be suggested, or too large to be true: those of the best set
            beside an unknown; where something is missing, those that are likelier than not.
        oversized: those of them that would do for the unknown, at a size that their cause has never been seen to reach.
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
    first: str = ""
    unexplained: str = ""
    perhaps: tuple[str, ...] = ()
    oversized: tuple[str, ...] = ()

    def with_unexplained(self, words: str) -> "Diagnosis":
        """An `unknown` diagnosis headed by a set-up problem, without suggesting poses; any other one as it is.

        Args:
            words: of the set-up check on columns that disagree beyond any machine's errors; '' for none.
        """
        if self.verdict != "unknown" or not words:
            return self
        return replace(self, separation=None, unexplained=words, words=f"{capital(words)}\n{self.words}")

    @property
    def is_settled(self) -> bool:
        """Whether nothing in the set-up is to be settled before an effect is added."""
        return not (self.unexplained or self.first)

    @property
    def to_add(self) -> list[str]:
        """Keys of effects to add, the pick of each step; none while the set-up is to be settled first."""
        return [step[0] for step in self.suggested] if self.is_settled else []

    @property
    def measure_next(self) -> tuple[str, ...]:
        """What to measure next, and where to look, in words."""
        lines = tuple(self.separation.lines) if self.separation else ()
        if self.unexplained:
            return lines
        if any(is_growth(one.effect, one.sum_of) for one in self.candidates[: len(self.suggested)]):
            lines += (SCALE_BAR,)
        if self.verdict != "unknown":
            return lines
        return (*lines, *next_look(self.depends_on, untold=mostly_untold(self)))

    @property
    def asks_for_poses(self) -> bool:
        """Whether more poses would show an unknown better."""
        unknown = self.verdict == "unknown" and not self.unexplained
        return unknown and asks_for_poses(self.depends_on, untold=mostly_untold(self))

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
            "oversized": list(self.oversized),
            "unexplained": self.unexplained or None,
            "first": self.first or None,
        }
