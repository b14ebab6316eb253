"""Weighted least squares of all effects and the tracker frame together, and what the fit does not know."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, optimize, stats
from torch import Tensor

from ptt.layout import Layout, lay_out
from ptt.model import Model, Prediction, Term, linearise, predict, start_term
from ptt.noise import DEFAULT_SIGMA, Noise
from ptt.problem import Problem, apply_frames

SEEN = 1.0  # a direction counts as seen where the data know it better than its usual size
PRIOR_SHARE = 0.02  # a parameter with more than this share in unseen directions is not measured
OUTLIER_CHANCE = 1e-3  # chance that a sound table of readings loses one to the outlier rule
OPENING = 0.2  # where parameters that cannot be negative start, in usual sizes


@dataclass(frozen=True)
class FitResult:
    """A fit and its limits.

    Attributes:
        model: the model with fitted parameters.
        layout: order of the unknowns.
        unknowns: (u,) fitted values in usual sizes.
        covariance: (u, u) of the unknowns in their own units; what the prior holds has the prior's.
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
        return (self.unseen**2).sum(axis=1) <= PRIOR_SHARE


@dataclass(frozen=True)
class _System:
    """Whitened residual and Jacobian at one point: data rows (n, 3), then base reflectors (m, 3)."""

    residual: np.ndarray
    jacobian: np.ndarray
    base_residual: np.ndarray
    base_jacobian: np.ndarray


def fit(
    model: Model, problem: Problem, *, robust: bool = True, noise: Noise | None = None, lean: bool = False
) -> FitResult:
    """Fit all effects and frames of a model.

    Args:
        model: effects without values start at zero, with the first trial of what they search.
        problem: the readings.
        robust: leave out gross errors; they are named in the result.
        noise: the noise floor; None takes the problem's, or a first guess where it has none.
        lean: skip the confirmation that the set of outliers is stable.

    Returns:
        The fit; what kept it from converging is in its status.
    """
    noise = noise or problem.noise or Noise(np.eye(3) * DEFAULT_SIGMA**2, "first guess")
    layout = lay_out(model, problem, [_opened(term, problem) for term in model.terms])
    evaluate = _Evaluator(layout, problem, noise)
    start = layout.start()
    system = evaluate(start)
    kept = problem.used.copy()
    if robust:
        kept = _without_outliers(system, problem.used)
    unknowns, unseen, status = start, np.zeros((len(start), 0)), "converged"
    for attempt in range(1 if lean else 3):
        unseen = _unseen(system, kept)
        unknowns, status = _solve(evaluate, layout, unknowns, kept, unseen)
        system = evaluate(unknowns)
        again = _inside(system.residual, problem.used) if robust else kept
        if (again == kept).all() and _unseen(system, kept).shape == unseen.shape:
            break
        kept = again if attempt < 2 else kept
    return _result(model, problem, layout, evaluate, system, unknowns, unseen, kept, noise, status)


def residual_of(model: Model, problem: Problem, noise: Noise | None = None) -> FitResult:
    """Residual of a model as it is: only what the tracker frame may take is fitted.

    Args:
        model: its effects are held.
        problem: the readings.
        noise: the noise floor; None as in `fit`.

    Returns:
        The fit of the frame alone.
    """
    held = tuple(
        replace(term, fixed=frozenset(p.stem for p in term.effect.parameters)) for term in model.terms if len(term.theta)
    )
    result = fit(replace(model, terms=held), problem, noise=noise)
    return replace(result, model=model)


def weighted_rows(system_rows: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Rows that count, flattened: (n, 3, ...) -> (3 kept, ...)."""
    return system_rows[kept].reshape(-1, *system_rows.shape[2:])


class _Evaluator:
    """Whitened system at given unknowns; the last one is remembered, because residual and Jacobian come together."""

    def __init__(self, layout: Layout, problem: Problem, noise: Noise) -> None:
        self.layout, self.problem, self.whitener = layout, problem, noise.whitener
        self.calls = 0
        self._at: np.ndarray | None = None
        self._system: _System | None = None
        self.prediction: Prediction | None = None

    def __call__(self, unknowns: np.ndarray) -> _System:
        if self._at is not None and np.array_equal(self._at, unknowns) and self._system is not None:
            return self._system
        self.calls += 1
        self._system, self.prediction = _system(self.layout, self.problem, self.whitener, unknowns)
        self._at = unknowns.copy()
        return self._system


def _system(
    layout: Layout, problem: Problem, whitener: np.ndarray, unknowns: np.ndarray
) -> tuple[_System, Prediction]:
    terms = [(term.effect, theta) for term, theta in zip(layout.terms, layout.thetas(unknowns), strict=True)]
    at = linearise(terms, problem.view)
    machine = at.jacobian[..., layout.columns()]
    if not layout.frames:
        residual = problem.measured - at.prediction.reading.numpy()
        jacobian = machine.numpy() * layout.scale
        empty = np.zeros((0, 3)), np.zeros((0, 3, len(unknowns)))
        return _System(residual @ whitener.T, whitener @ jacobian, *empty), at.prediction
    motion = layout.frame_parameters(unknowns)
    moved, by_frame = apply_frames(at.prediction.reading, problem.frame, motion)
    blocks = [_turned(machine, motion, problem.frame).numpy(), *_by_own_frame(by_frame, problem.frame, layout.frames)]
    jacobian = np.concatenate(blocks, axis=-1) * layout.scale
    residual = problem.measured - moved.numpy()
    base = _base_rows(problem, layout, motion, machine.shape[-1])
    return _System(residual @ whitener.T, whitener @ jacobian, *base), at.prediction


def _turned(machine: Tensor, motion: Tensor, frame: np.ndarray) -> Tensor:
    """Machine columns (n, 3, P) as the small rotations of the frames show them."""
    if not bool(motion[:, 3:].any()) or not machine.shape[-1]:
        return machine
    from ptt.frames import rotation

    return rotation(motion[:, 3:])[0][frame] @ machine


def _by_own_frame(by_frame: Tensor, frame: np.ndarray, frames: int) -> list[np.ndarray]:
    columns = by_frame.numpy()
    return [np.where((frame == index)[:, None, None], columns, 0.0) for index in range(frames)]


def _base_rows(problem: Problem, layout: Layout, motion: Tensor, machine: int) -> tuple[np.ndarray, np.ndarray]:
    base = problem.base
    if base is None:
        return np.zeros((0, 3)), np.zeros((0, 3, machine + 6 * layout.frames))
    import torch

    moved, by_frame = apply_frames(torch.as_tensor(base.place), base.frame, motion)
    own = _by_own_frame(by_frame, base.frame, layout.frames)
    jacobian = np.concatenate([np.zeros((len(base.place), 3, machine)), *own], axis=-1) * layout.scale
    weight = 1.0 / base.sigma
    return (base.reading - moved.numpy()) * weight[:, None], jacobian * weight[:, None, None]


def _stacked(system: _System, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    residual = np.concatenate([system.residual[kept].ravel(), system.base_residual.ravel()])
    width = system.jacobian.shape[-1]
    jacobian = np.concatenate([system.jacobian[kept].reshape(-1, width), system.base_jacobian.reshape(-1, width)])
    return residual, jacobian


def _unseen(system: _System, kept: np.ndarray) -> np.ndarray:
    """Directions, in usual sizes, that the rows know no better than the usual size, (u, m)."""
    _, jacobian = _stacked(system, kept)
    if not jacobian.shape[1]:
        return np.zeros((0, 0))
    strength, directions = linalg.eigh(jacobian.T @ jacobian)
    return directions[:, strength < SEEN**2]


def _solve(
    evaluate: _Evaluator, layout: Layout, start: np.ndarray, kept: np.ndarray, unseen: np.ndarray
) -> tuple[np.ndarray, str]:
    if not len(start):
        return start, "nothing to fit"

    def residual(unknowns: np.ndarray) -> np.ndarray:
        return np.concatenate([_stacked(evaluate(unknowns), kept)[0], -unseen.T @ unknowns])

    def jacobian(unknowns: np.ndarray) -> np.ndarray:
        return np.concatenate([-_stacked(evaluate(unknowns), kept)[1], -unseen.T])

    inside = np.clip(start, layout.lower + 1e-9, layout.upper - 1e-9)
    outcome = optimize.least_squares(
        residual, inside, jacobian, bounds=(layout.lower, layout.upper), xtol=1e-10, ftol=1e-9, gtol=1e-10, max_nfev=40
    )
    return outcome.x, "converged" if outcome.success else f"not converged: {outcome.message}"


def _distances(whitened: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, float]:
    """Distance of each row in noise units, and how much wider than noise the bulk of them lies."""
    squared = np.einsum("nc,nc->n", whitened, whitened)
    return squared, max(1.0, float(np.median(squared[used])) / stats.chi2.median(3))


def _inside(whitened: np.ndarray, used: np.ndarray) -> np.ndarray:
    squared, width = _distances(whitened, used)
    limit = stats.chi2.isf(OUTLIER_CHANCE / max(used.sum(), 1), 3) * width
    return used & (np.nan_to_num(squared, nan=np.inf) <= limit)


def _without_outliers(system: _System, used: np.ndarray, rounds: int = 8) -> np.ndarray:
    """Find gross errors on the linearised problem by iteratively reweighted least squares (Cauchy weights by row)."""
    width = system.jacobian.shape[-1]
    if not width:
        return _inside(system.residual, used)
    rows, columns = system.residual[used], system.jacobian[used]
    base = system.base_jacobian.reshape(-1, width)
    pull = np.eye(width) * 1e-9
    weight = np.ones(len(rows))
    left = rows
    for _ in range(rounds):
        heavy = columns * weight[:, None, None]
        normal = np.einsum("ncp,ncq->pq", heavy, columns, optimize=True) + base.T @ base
        side = np.einsum("ncp,nc->p", heavy, rows) + base.T @ system.base_residual.ravel()
        step = linalg.solve(normal + pull * np.trace(normal), side, assume_a="pos")
        left = rows - columns @ step
        squared, spread = _distances(left, np.ones(len(left), dtype=bool))
        weight = 1.0 / (1.0 + squared / (6.0 * spread))
    whole = np.full_like(system.residual, np.nan)
    whole[used] = left
    return _inside(whole, used)


def _opened(term: Term, problem: Problem) -> Term:
    """Values to start from: those it has, else zero, a little open where zero is the bound."""
    if len(term.theta):
        return term
    started = start_term(term.effect, problem.view)
    theta, place = started.theta.clone(), 0
    kind = problem.file.machine.kind
    for parameter in (p.on(kind) for p in term.effect.parameters):
        size = parameter.size(problem.view.joints)
        if parameter.role == "linear" and parameter.lower == 0.0:
            theta[place : place + size] = OPENING * parameter.usual
        place += size
    return replace(started, theta=theta, fixed=term.fixed)


def _result(
    model: Model, problem: Problem, layout: Layout, evaluate: _Evaluator, system: _System, unknowns: np.ndarray,
    unseen: np.ndarray, kept: np.ndarray, noise: Noise, status: str,
) -> FitResult:  # fmt: skip
    residual, jacobian = _stacked(system, kept)
    information = jacobian.T @ jacobian + unseen @ unseen.T
    covariance = np.linalg.pinv(information, hermitian=True) if len(unknowns) else np.zeros((0, 0))
    chi2 = float(residual @ residual)
    rank = len(unknowns) - unseen.shape[1]
    terms = [(term.effect, theta) for term, theta in zip(layout.terms, layout.thetas(unknowns), strict=True)]
    prediction = evaluate.prediction or predict(terms, problem.view)
    result = FitResult(
        model, layout, unknowns, covariance * np.outer(layout.scale, layout.scale), prediction,
        system.residual @ np.linalg.inv(noise.whitener).T, problem.used & ~kept, noise, chi2,
        max(len(residual) - rank, 1), rank, unseen, evaluate.calls, status,
    )  # fmt: skip
    return replace(result, model=replace(model, terms=_fitted_terms(result)))


def _fitted_terms(result: FitResult) -> tuple[Term, ...]:
    import torch

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
