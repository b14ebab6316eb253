"""The noise floor, checked against what a model with every testable effect at once leaves."""

from dataclasses import replace

import numpy as np
from scipy import stats

from ptt.diagnosis.design import Design, build_design, present_candidates
from ptt.diagnosis.screen import saturating, screen
from ptt.effects import Library
from ptt.errors import TableError
from ptt.fit.solve import fit
from ptt.model import Model
from ptt.noise import DEFAULT_SIGMA, Noise
from ptt.problem import Problem
from ptt.sums import solve

ROUNDS = 3
AT_ODDS = 1e-4  # chance below which two figures of the noise do not belong together
LEAST_FREEDOM = 12


def noise_floor(model: Model, problem: Problem, known: Library) -> Noise:
    """The noise floor: the problem's own, checked; else that of the saturated model.

    Repeats that were read before and after a knock scatter by the knock: where the saturated model leaves
    significantly less than repeats do, it tells the noise. Where both agree they are pooled.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name.

    Returns:
        The noise.

    Raises:
        TableError: nothing tells the noise.
    """
    given = problem.noise
    if given is not None and given.source != "repeats":
        return given
    saturated = given or Noise(np.eye(3) * DEFAULT_SIGMA**2, "first guess")
    for _ in range(1 if given is not None else ROUNDS):
        fitted = fit(model, problem, noise=saturated)
        candidates, _ = present_candidates(fitted, problem, known)
        left = _left_over(build_design(fitted, problem, candidates, saturated))
        if left is None:
            break
        saturated = left
    if saturated.source != "saturated model":
        if given is None:
            raise TableError(
                f"{int(problem.used.sum())} readings without repeats do not tell the noise",
                where=problem.table.source,
                fix="give sigma_mm under [tracker] in the machine file, or measure more rows",
            )
        return given
    return saturated if given is None else _join(given, saturated)


def _join(repeats: Noise, saturated: Noise) -> Noise:
    ratio = (saturated.total / repeats.total) ** 2
    both = 3.0 * repeats.freedom, saturated.freedom
    if stats.f.cdf(ratio, both[1], both[0]) < AT_ODDS:
        return replace(saturated, source="saturated model; repeats scatter by more, as after a knock")
    if stats.f.sf(ratio, both[1], both[0]) < AT_ODDS:
        return repeats
    share = both[0] / (both[0] + both[1])
    covariance = share * repeats.covariance + (1.0 - share) * saturated.covariance
    return Noise(covariance, "repeats", sum(both) / 3.0)


def confirm_noise(problem: Problem, design: Design, noise: Noise) -> Noise:
    """The noise floor again, told by a design at the end of a path, where nothing large hides it any more.

    Args:
        problem: the readings.
        design: linearised at the end of the path.
        noise: the noise floor so far.

    Returns:
        The noise floor.
    """
    given = problem.noise
    if given is not None and given.source != "repeats":
        return given
    left = _left_over(design)
    if left is None:
        return noise
    return left if given is None else _join(given, left)


def saturated_rest(design: Design) -> np.ndarray:
    """What the saturated model leaves, (n, 3) in noise units, NaN on rows that do not count."""
    trials = saturating(design, [finding.trial for finding in screen(design).findings])
    chosen = np.concatenate([design.base, *(trial.columns for trial in trials)]).astype(int)
    solution = solve(*design.sums.total[:3], chosen)
    left = design.values - design.columns[..., chosen] @ solution.values
    return np.where(design.rows[:, None], left, np.nan)


def _left_over(design: Design) -> Noise | None:
    """Scatter that the saturated model leaves; None where rows are too few."""
    trials = saturating(design, [finding.trial for finding in screen(design).findings])
    chosen = np.concatenate([design.base, *(trial.columns for trial in trials)]).astype(int)
    solution = solve(*design.sums.total[:3], chosen)
    left = (design.values - design.columns[..., chosen] @ solution.values)[design.rows]
    # Gross errors would be taken for noise, so the middle of the distribution decides which rows count.
    distance = np.square(left).sum(axis=1)
    kept = distance <= 16.3 / 2.366 * np.median(distance)  # chi-squared of 3: 99.9 % against the median
    freedom = 3 * int(kept.sum()) - solution.seen
    if freedom < LEAST_FREEDOM:
        return None
    color = np.linalg.inv(design.noise.whitener)
    scatter = left[kept] @ color.T
    covariance = scatter.T @ scatter * (3.0 / freedom)
    return Noise(covariance, "saturated model", float(freedom))
