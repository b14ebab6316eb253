"""Is there a rest? What no effect of the library explains must not pass for noise."""

from dataclasses import dataclass, replace

import numpy as np

from nets import RbfSettings, train_rbf
from ptt.chain import linearise
from ptt.compare.lack_of_fit import lack_of_fit_of
from ptt.dependence.dependence import Dependence, dependence_of
from ptt.diagnosis.wander import Wander, take_off
from ptt.fit.solve import FitResult
from ptt.holdout import BLOCKS, blocks
from ptt.noise import Noise
from ptt.problem import Problem

CHANCE_LACK = 1e-3  # lack of fit
CHANCE_FIELD = 5e-4  # a network over position predicts held-out residuals
CHANCE_DEPENDS = 1e-3  # a smooth function of a context variable predicts residuals
LIGHT = RbfSettings(centre_counts=(12,), spreads=(1.0, 2.0), ridges=(1e-4, 1e-2), affine=(False,), restarts=1)
MOST_ROWS = 3000  # a field that 3,000 rows do not show is no field worth naming


@dataclass(frozen=True)
class Rest:
    """What is left after everything that fits has been added.

    Attributes:
        lack_p: lack of fit against true repeats; None with fewer than 30 degrees of freedom.
        field_p: gain of a network over position on held-out rows, three coordinates together.
        depends_on: what the rest depends on, significant entries only.
        significant: whether any of them is.
        reasons: the same in words.
    """

    lack_p: float | None
    field_p: float
    depends_on: tuple[Dependence, ...]
    significant: bool
    reasons: tuple[str, ...]

    def led_by(self, first: Dependence) -> "Rest":
        """The same rest, with one dependence, the likeliest cause, before the others."""
        others = tuple(item for item in self.depends_on if item is not first)
        return replace(self, depends_on=(first, *others))


def look_for_rest(
    fitted: FitResult,
    problem: Problem,
    noise: Noise,
    gross: np.ndarray,
    *,
    wander: Wander | None = None,
    seed: int = 0,
) -> Rest:
    """Test the residual against repeats, against position, and against every context variable.

    Args:
        fitted: the model at the end of its path.
        problem: the readings.
        noise: the noise floor.
        gross: rows held for gross errors, (n,) bool.
        wander: its memory; what it foretells is no rest.
        seed: of the permutations.

    Returns:
        The rest.
    """
    whole = np.where(problem.used[:, None], fitted.residual, np.nan)
    residual = np.where(gross[:, None], np.nan, whole)
    if wander is not None:
        residual = take_off(residual, wander, problem, problem.used & ~gross)
    lack = lack_of_fit_of(problem, residual, fitted.rank).p_value
    field = _field(fitted, problem, residual)
    # Rows that a fit takes for gross errors may be the local damage that is looked for, so here they are asked too.
    asked = whole if wander is None else residual
    depends = dependence_of(problem.with_noise(noise), asked, slopes=_slopes(fitted, problem), seed=seed)
    if wander is not None:  # what is left of a slow wander is no more news than the wander
        depends = tuple(item for item in depends if item.on not in ("time", "run"))
    reasons = []
    if lack is not None and lack < CHANCE_LACK:
        reasons.append(f"the rest is larger than repeats scatter (p = {lack:.1g})")
    if field < CHANCE_FIELD:
        reasons.append(f"a network over position predicts held-out rests (p = {field:.1g})")
    strong = [item for item in depends if item.p_value < CHANCE_DEPENDS]
    reasons += [f"{item.residual} depends on {item.on} (p = {item.p_value:.1g})" for item in strong[:3]]
    return Rest(lack, field, depends, bool(reasons), tuple(reasons))


def _slopes(fitted: FitResult, problem: Problem) -> np.ndarray | None:
    """Derivatives by what was fitted: an error that is missing bends them, and that bend is taken out again."""
    terms = [(term.effect, term.theta) for term in fitted.model.terms]
    return linearise(terms, problem.view).jacobian.numpy() if terms else None


def _field(fitted: FitResult, problem: Problem, residual: np.ndarray) -> float:
    rows = np.flatnonzero(np.isfinite(residual).all(axis=1))
    rows = rows[:: max(1, len(rows) // MOST_ROWS)]
    group = blocks(problem.table, 2 * BLOCKS)[rows]
    if len(rows) < 30 or len(np.unique(group)) < 5:
        return 1.0
    inputs = fitted.prediction.p.numpy()[rows]
    trained = train_rbf(inputs, residual[rows] / np.nanstd(residual[rows], axis=0), group, settings=LIGHT)
    return float(min(1.0, 3.0 * np.min(trained.p_value)))
