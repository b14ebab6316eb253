"""The physics of a training: effects fitted, or kept as given, and their residual."""

from dataclasses import dataclass, replace

import numpy as np

from ptt.fitting.outliers import inside
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit, residual_of
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.noise import Noise, guessed_noise
from ptt.run.problem import Problem


@dataclass(frozen=True)
class Physics:
    """A model with its parameters, and its residual.

    Attributes:
        model: the model with fitted parameters.
        residual: measured less predicted in the base frame, (n, 3) mm; NaN where not observed.
        outliers: rows left out as gross errors, (n,) bool.
        noise: the noise floor that weighted the fit.
        status: 'converged', 'nothing to fit', or why the fit did not converge.
        fitted: the fit itself; None where no effect was fitted.
    """

    model: Model
    residual: np.ndarray
    outliers: np.ndarray
    noise: Noise
    status: str
    fitted: FitResult | None = None


def fit_physics(model: Model, problem: Problem, *, lean: bool = False) -> Physics:
    """Fit the effects of a model.

    Args:
        model: the model; a bare drawing whose frame is known leaves nothing to fit.
        problem: the readings.
        lean: skip the confirmation that the set of outliers is stable.

    Returns:
        The physics.
    """
    if not model.terms:
        return keep_physics(model, problem)
    found = fit(model, problem, lean=lean)
    return Physics(found.model, found.residual, found.outliers, found.noise, found.status, found)


def keep_physics(model: Model, problem: Problem) -> Physics:
    """The residual of a model with its given parameters; only unknown tracker frames and mounts are fitted.

    Args:
        model: the model; effects without values are left aside.
        problem: the readings.

    Returns:
        The physics.
    """
    if problem.frames or problem.mounts:
        found = residual_of(replace(model, terms=tuple(term for term in model.terms if len(term.theta))), problem)
        return Physics(model, found.residual, found.outliers, found.noise, found.status)
    noise = problem.noise or guessed_noise()
    terms = [(term.effect, term.theta) for term in model.terms if len(term.theta)]
    residual = problem.measured - predict(terms, problem.view).reading.numpy()
    gross = problem.used & ~inside(residual @ noise.whitener.T, problem.used, problem, noise)
    return Physics(model, residual, gross, noise, "nothing to fit")
