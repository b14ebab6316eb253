"""Screen: how much of the residual each candidate would take, and how likely chance alone would take as much."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from ptt.diagnosis.columns import Trial
from ptt.diagnosis.design import Design
from ptt.sums import gain, project, solve

FALSE_ALARM = 0.003  # chance that a sound run gets any effect named, all candidates and shapes together
AT_ODDS = 1e-4  # chance below which the saturated model's rest and the noise floor are at odds
AMPLE_FREEDOM = 100  # degrees of freedom that a saturated model with everything in it should leave
SIMPLE = 12  # columns up to which a candidate is taken into the saturated model of a short run
LEAST_FREEDOM = 20  # degrees of freedom a saturated model must leave to tell the noise


@dataclass(frozen=True)
class Finding:
    """One candidate on the screen.

    Attributes:
        trial: the candidate in its best shape.
        gain: reduction of the sum of squares, in noise units.
        freedom: seen directions behind it.
        p_value: after the toll for shapes and candidates.
        toll: reduction that chance explains at the false-alarm rate.
        share: of the residual's variance after the frame.
    """

    trial: Trial
    gain: float
    freedom: int
    p_value: float
    toll: float
    share: float

    @property
    def net(self) -> float:
        """Gain beyond the toll; positive for what is significant."""
        return self.gain - self.toll


@dataclass(frozen=True)
class Screen:
    """All candidates against the present model.

    Attributes:
        findings: the candidates in their best shapes, best net gain first.
        spread: variance that even the saturated model leaves, in noise units; one where the noise floor agrees.
        freedom: degrees of freedom behind the noise.
        left: sum of squares of the present model in noise units, divided by spread.
        count: coordinates less seen directions of the present model.
        candidates: how many effects were tested.
    """

    findings: tuple[Finding, ...]
    spread: float
    freedom: float
    left: float
    count: int
    candidates: int


def screen(design: Design) -> Screen:
    """Test every candidate's derivative at zero, projected off what the present model explains.

    Args:
        design: the linearised problem.

    Returns:
        The screen.
    """
    gram, side, square, count = design.sums.total
    projected = project(gram, side, square, design.base)
    best: dict[str, tuple[float, int, Trial]] = {}
    for trial in design.trials:
        took, freedom = gain(projected, trial.columns)
        if trial.effect.key not in best or took > best[trial.effect.key][0]:
            best[trial.effect.key] = (took, freedom, trial)
    spread, behind = _spread(design, saturating(design, [item[2] for item in best.values()]))
    present = projected.left / spread, max(count - projected.seen, 1)
    # What the frame alone leaves is what there was to explain.
    whole = project(gram, side, square, design.frame).left if len(design.frame) else square
    findings = [
        _find(trial, took / spread, seen, behind, len(best), took / max(whole, 1e-300), present)
        for took, seen, trial in best.values()
    ]
    findings.sort(key=lambda finding: -finding.net)
    return Screen(tuple(findings), spread, behind, present[0], count - projected.seen, len(best))


def toll(freedom: float, noise_freedom: float, tests: float) -> float:
    """Reduction of the sum of squares, in noise units, that chance reaches at the false-alarm rate.

    Args:
        freedom: seen directions of the candidate.
        noise_freedom: degrees of freedom behind the noise.
        tests: candidates times shapes.

    Returns:
        The toll.
    """
    return float(freedom * stats.f.isf(FALSE_ALARM / max(tests, 1), freedom, _finite(noise_freedom)))


def significant(screened: Screen) -> list[Finding]:
    """Candidates whose gain is beyond what chance explains, best first."""
    return [finding for finding in screened.findings if finding.net > 0.0]


def _find(
    trial: Trial, took: float, seen: int, freedom: float, candidates: int, share: float, present: tuple[float, int]
) -> Finding:
    """Test one candidate against the noise floor and against what it leaves itself: the weaker of both counts."""
    if not seen:  # the present model explains all that it could do; a swap may still want it
        return Finding(trial, 0.0, 0, 1.0, 0.0, 0.0)
    tests = candidates * effective_trials(trial)
    left, loose = present
    after = max(loose - seen, 1)
    own = max(left - took, 1e-12) / after
    against_noise = stats.f.sf(took / seen, seen, _finite(freedom))
    chance = float(max(against_noise, stats.f.sf(took / seen / own, seen, after)))
    least = toll(seen, freedom, tests)
    if chance * tests > FALSE_ALARM:
        least = max(least, took + 1e-9)
    return Finding(trial, took, seen, min(1.0, chance * tests), least, share)


def saturating(design: Design, trials: list[Trial]) -> list[Trial]:
    """Candidates that a saturated model takes in: all, or, where rows are few, those without many parameters."""
    *_, count = design.sums.total
    size = sum(len(trial.columns) for trial in trials) + len(design.base)
    return trials if count - size > AMPLE_FREEDOM else [trial for trial in trials if len(trial.columns) <= SIMPLE]


def effective_trials(trial: Trial) -> float:
    """Shapes that a search really tries: neighbouring shapes are nearly one test."""
    return max(1.0, trial.trials**0.75)


def _spread(design: Design, trials: list[Trial]) -> tuple[float, float]:
    """Variance that the saturated model leaves, in noise units, and the freedom of the noise that tests are against."""
    gram, side, square, count = design.sums.total
    chosen = np.concatenate([design.base, *(trial.columns for trial in trials)]).astype(int)
    saturated = solve(gram, side, square, chosen)
    freedom = count - saturated.seen
    behind = 3.0 * design.noise.freedom if design.noise.source == "repeats" else design.noise.freedom
    if freedom < LEAST_FREEDOM:
        return 1.0, behind
    spread = saturated.left / freedom
    chance = stats.f.cdf(spread, freedom, _finite(behind))
    if AT_ODDS < chance < 1.0 - AT_ODDS:
        return 1.0, behind
    return spread, float(freedom)


def _finite(freedom: float) -> float:
    return freedom if np.isfinite(freedom) else 1e6
