"""The noise floor where nothing else tells it: what is left of a model with every testable effect at once."""

import numpy as np

from ptt.diagnosis.design import build_design, present_candidates
from ptt.effects import Library
from ptt.errors import TableError
from ptt.fit import fit
from ptt.model import Model
from ptt.noise import DEFAULT_SIGMA, Noise
from ptt.problem import Problem
from ptt.sums import solve

ROUNDS = 3


def noise_floor(model: Model, problem: Problem, known: Library) -> Noise:
    """The noise floor: the problem's own, else that of the saturated model.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name.

    Returns:
        The noise.

    Raises:
        TableError: too few rows for the saturated model.
    """
    if problem.noise is not None:
        return problem.noise
    noise = Noise(np.eye(3) * DEFAULT_SIGMA**2, "first guess")
    for _ in range(ROUNDS):
        noise = _left_over(model, problem, known, noise)
    return noise


def _left_over(model: Model, problem: Problem, known: Library, noise: Noise) -> Noise:
    fitted = fit(model, problem, noise=noise)
    candidates, _ = present_candidates(fitted, problem, known)
    design = build_design(fitted, problem, candidates, noise)
    first: dict[str, np.ndarray] = {}
    for trial in design.trials:
        first.setdefault(trial.effect.key, trial.columns)
    chosen = np.concatenate([design.base, *first.values()]).astype(int)
    solution = solve(*design.sums.total[:3], chosen)
    left = (design.values - design.columns[..., chosen] @ solution.values)[design.rows]
    # Gross errors would be taken for noise, so the middle of the distribution decides which rows count.
    distance = np.square(left).sum(axis=1)
    kept = distance <= 16.3 / 2.366 * np.median(distance)  # chi-squared of 3: 99.9 % against the median
    freedom = 3 * int(kept.sum()) - solution.seen
    if freedom < 12:
        raise TableError(
            f"{int(design.rows.sum())} readings without repeats do not tell the noise",
            where=problem.table.source,
            fix="give sigma_mm under [tracker] in the machine file, or measure more rows",
        )
    color = np.linalg.inv(noise.whitener)
    scatter = left[kept] @ color.T
    covariance = scatter.T @ scatter * (3.0 / freedom)
    return Noise(covariance, "saturated model", float(freedom))
