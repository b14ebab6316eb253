"""Weighted least squares of all effects and the tracker frame together, and what the fit does not know."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from ptt.chain import Prediction
from ptt.fit.gauss_newton import DONE, Equations, descend
from ptt.fit.layout import Layout, lay_out
from ptt.fit.outliers import inside, linear_residual
from ptt.fit.search import open_terms
from ptt.fit.whitened import Evaluator, System
from ptt.model import Model, Term
from ptt.noise import DEFAULT_SIGMA, Noise
from ptt.problem import Problem

NEAR = 0.01  # decrease of chi-squared at which a coarse fit ends
SEEN = 1.0  # a direction counts as seen where the data know it better than its usual size
PRIOR_SHARE = 0.02  # a parameter with more than this share in unseen directions is not measured
PRIOR_HALF = 0.5  # share of its prior's variance from which a parameter that is held near zero counts as unmeasured
ROUNDING = 1e-13  # share of the strongest direction's information that is rounding
ROUNDS = 3  # of leaving out gross errors and fitting again


@dataclass(frozen=True)
class FitResult:
    """A fit and its limits.

    Attributes:
        model: the model with fitted parameters.
        layout: order of the unknowns.
        unknowns: (u,) fitted values in usual sizes.
        covariance: (u, u) of the unknowns in their own units; what the prior holds has the prior's.
        information: what is known of the unknowns in usual sizes, (u, u): by the rows, and by what an effect is
            defined without; no prior on unseen directions.
        prediction: of all rows, masked ones included.
        residual: measured less predicted in the base frame, (n, 3) mm; NaN where not observed.
        outliers: rows left out as gross errors, (n,) bool.
        noise: the noise floor that weighted the fit.
        chi2: weighted sum of squares over the rows used.
        freedom: degrees of freedom.
        rank: number of directions that the data see.
        unseen: (u, m) directions, in usual sizes, that only the prior holds.
        iterations: evaluations of the derivative.
        status: 'converged' or what kept it from converging.
    """

    model: Model
    layout: Layout
    unknowns: np.ndarray
    covariance: np.ndarray
    information: np.ndarray
    prediction: Prediction
    residual: np.ndarray
    outliers: np.ndarray
    noise: Noise
    chi2: float
    freedom: int
    rank: int
    unseen: np.ndarray
    iterations: int
    status: str

    @property
    def values(self) -> np.ndarray:
        """Fitted unknowns in their own units, (u,)."""
        return self.unknowns * self.layout.scale

    @property
    def std(self) -> np.ndarray:
        """Standard errors of the unknowns in their own units, (u,); wider where the fit leaves more than noise."""
        return np.sqrt(np.diag(self.covariance)) * np.sqrt(max(1.0, self.chi2 / max(self.freedom, 1)))

    @property
    def measured(self) -> np.ndarray:
        """Unknowns that the data, not the prior, decide, (u,) bool."""
        own = np.diag(self.covariance) / self.layout.scale**2
        return ((self.unseen**2).sum(axis=1) <= PRIOR_SHARE) & ~(self.layout.held & (own > PRIOR_HALF))


def fit(
    model: Model,
    problem: Problem,
    *,
    robust: bool = True,
    noise: Noise | None = None,
    lean: bool = False,
    coarse: bool = False,
) -> FitResult:
    """Fit all effects and frames of a model.

    Args:
        model: effects without values start where `ptt.fit.search` finds them.
        problem: the readings.
        robust: leave out gross errors; they are named in the result.
        noise: the noise floor; None takes the problem's, or a first guess where it has none.
        lean: skip the confirmation that the set of outliers is stable.
        coarse: stop a hundredth of chi-squared from the end, which is near enough to compare models.

    Returns:
        The fit; what kept it from converging is in its status.
    """
    noise = noise or problem.noise or Noise(np.eye(3) * DEFAULT_SIGMA**2, "first guess")
    layout = lay_out(model, problem, open_terms(model.terms, problem, noise))
    evaluate = Evaluator(layout, problem, noise, coarse=coarse)
    unknowns = np.clip(layout.start(), layout.lower, layout.upper)
    system = evaluate(unknowns)
    kept = _without_outliers(system, problem, layout) if robust else problem.used.copy()
    status, unseen = "nothing to fit", np.zeros((len(unknowns), 0))
    for attempt in range(1 if lean or coarse else ROUNDS):
        unseen = unseen_directions(_informed(system, kept, layout))
        if len(unknowns):
            prior = unseen @ unseen.T + np.diag(layout.held.astype(float))
            done = NEAR if coarse else DONE
            ended = descend(_equations(evaluate, kept, prior), unknowns, layout.lower, layout.upper, done)
            unknowns, status = ended.unknowns, ended.status
        system = evaluate(unknowns)
        again = inside(system.residual, problem.used, problem) if robust else kept
        if (again == kept).all() and unseen_directions(_informed(system, kept, layout)).shape == unseen.shape:
            break
        kept = again if attempt < ROUNDS - 1 else kept
    return _result(model, problem, evaluate, unknowns, unseen, kept, status)


def residual_of(model: Model, problem: Problem, noise: Noise | None = None) -> FitResult:
    """Residual of a model as it is: only what a tracker frame may take is fitted; base reflectors hold the frame.

    Args:
        model: its effects are held.
        problem: the readings.
        noise: the noise floor; None as in `fit`.

    Returns:
        The fit of the frame alone.
    """
    held = tuple(hold(term) for term in model.terms if len(term.theta))
    result = fit(replace(model, terms=held), problem.anchored(), noise=noise)
    return replace(result, model=model)


def hold(term: Term) -> Term:
    """The term with all its parameters fixed."""
    return replace(term, fixed=frozenset(parameter.stem for parameter in term.effect.parameters))


def unseen_directions(information: np.ndarray) -> np.ndarray:
    """Directions that the rows know no better than the usual size.

    Args:
        information: J^T J in units of usual sizes, (u, u).

    Returns:
        (u, m), orthonormal columns.
    """
    if not len(information):
        return np.zeros((0, 0))
    strength, directions = np.linalg.eigh(information)
    return directions[:, strength < max(SEEN, ROUNDING * strength[-1])]


def _informed(system: System, kept: np.ndarray, layout: Layout) -> np.ndarray:
    """What is known of the unknowns: by the rows, and by what an effect is defined without; (u, u) in usual sizes."""
    return system.information(kept) + np.diag(layout.held.astype(float))


def _equations(evaluate: Evaluator, kept: np.ndarray, prior: np.ndarray) -> Equations:
    """Normal equations of the rows that count and of the prior."""

    def equations(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        residual, jacobian = evaluate(unknowns).stacked(kept)
        pull = prior @ unknowns
        return jacobian.T @ jacobian + prior, jacobian.T @ residual - pull, float(residual @ residual + unknowns @ pull)

    return equations


def _without_outliers(system: System, problem: Problem, layout: Layout) -> np.ndarray:
    """Rows that remain after a robust fit of the linearised problem, (n,) bool."""
    width = system.jacobian.shape[-1]
    base = np.concatenate(
        [
            system.base_jacobian.reshape(3 * len(system.base_jacobian), width),
            np.diag(layout.held.astype(float))[layout.held],
        ]
    )
    trusted = np.concatenate([system.base_residual.ravel(), np.zeros(int(layout.held.sum()))])
    whole, used = np.full_like(system.residual, np.nan), problem.used
    whole[used], _ = linear_residual(system.residual[used], system.jacobian[used], trusted, base)
    return inside(whole, used, problem)


def _result(
    model: Model, problem: Problem, evaluate: Evaluator, unknowns: np.ndarray, unseen: np.ndarray, kept: np.ndarray,
    status: str,
) -> FitResult:  # fmt: skip
    layout, noise, system = evaluate.layout, evaluate.noise, evaluate(unknowns)
    residual, _ = system.stacked(kept)
    information = _informed(system, kept, layout)
    covariance = np.linalg.pinv(information + unseen @ unseen.T, hermitian=True)
    rank = len(unknowns) - unseen.shape[1]
    result = FitResult(
        model, layout, unknowns, covariance * np.outer(layout.scale, layout.scale), information, system.prediction,
        system.residual @ np.linalg.inv(noise.whitener).T, problem.used & ~kept, noise, float(residual @ residual),
        max(len(residual) - rank + int(layout.held.sum()), 1), rank, unseen, evaluate.calls, status,
    )  # fmt: skip
    return replace(result, model=replace(model, terms=fitted_terms(result)))


def fitted_terms(result: FitResult) -> tuple[Term, ...]:
    """Terms at a fit's unknowns, with what is known of their accuracy.

    Args:
        result: the fit.

    Returns:
        The terms.
    """
    layout, terms, start = result.layout, [], 0
    for term, free, theta in zip(layout.terms, layout.free, layout.thetas(result.unknowns), strict=True):
        part = slice(start, start + int(free.sum()))
        std, measured = torch.full_like(theta, torch.nan), torch.ones(len(theta), dtype=torch.bool)
        mask = torch.as_tensor(free)
        std[mask] = torch.as_tensor(result.std[part])
        measured[mask] = torch.as_tensor(result.measured[part])
        terms.append(replace(term, theta=theta, std=std, measured=measured))
        start = part.stop
    return tuple(terms)


def rms(residual: np.ndarray, rows: np.ndarray | Sequence[bool]) -> dict[str, float]:
    """Root mean square of residuals per axis and in total, in micrometres.

    Args:
        residual: (n, 3) mm.
        rows: which rows count, (n,) bool.

    Returns:
        x, y, z, and total = sqrt(x^2 + y^2 + z^2).
    """
    squares = np.mean(np.square(residual[np.asarray(rows)]), axis=0)
    x, y, z = (float(value) * 1e3 for value in np.sqrt(squares))
    return {"x": x, "y": y, "z": z, "total": float(np.sqrt(squares.sum())) * 1e3}
