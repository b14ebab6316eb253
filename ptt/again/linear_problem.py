"""The linear problem of a recheck: uncertainty of the model, changes, masked effects and new effects."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ptt.again.changes import Change, atoms_of_changes
from ptt.again.extrapolation import extrapolation_columns
from ptt.again.masked_effects import masked_atoms
from ptt.again.prior import Prior
from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.effects import Effect
from ptt.fitting.linear import Linear, Shape, linear_columns
from ptt.fitting.solve import FitResult, fit, hold
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem


@dataclass(frozen=True)
class ExpansionPoint:
    """Where the model is linearised: its values, and the run's frames and mounts fitted beside them.

    Attributes:
        fitted: the model there as a fit, all values free.
        moved: displacement of its values from `Prior.start`, (w,) in usual sizes.
    """

    fitted: FitResult
    moved: np.ndarray


@dataclass(frozen=True)
class LinearProblem:
    """A recheck as a linear problem over the m rows that count; all columns whitened, in usual sizes.

    Attributes:
        system: rows, columns and atoms of the search; its values are the residuals at `Prior.start`.
        own: columns of the model's values, (m, 3, w).
        extrapolation: columns of the model's curves beyond their ends, (m, 3, c).
        unnamed: root of the readings' covariance by sizes of the drawing that the model does not have, (m, 3, r).
        on_base: columns of the model's values at the b readings of base reflectors that hold the frame, (b, 3, w).
    """

    system: RowSystem
    own: np.ndarray
    extrapolation: np.ndarray
    unnamed: np.ndarray
    on_base: np.ndarray


def expansion_point(prior: Prior, moved: np.ndarray, problem: Problem, noise: Noise) -> ExpansionPoint:
    """Move the values of a solved model, and fit the new run's frames and mounts beside them.

    Args:
        prior: the solved model.
        moved: displacement from `Prior.start`, (w,) in usual sizes.
        problem: the run.
        noise: the noise floor.

    Returns:
        Where to linearise; `moved` less what the bounds of the values cut off.
    """
    layout, model = prior.layout, model_at(prior, moved)
    values = np.concatenate([term.theta.numpy()[free] for term, free in zip(model.terms, layout.free, strict=True)])
    values = values / layout.scale[: prior.width]
    still = replace(model, terms=tuple(hold(term) for term in model.terms))
    framed = fit(still, problem, noise=noise, robust=False, coarse=True)
    unknowns = np.concatenate([values, framed.unknowns])
    own = replace(layout, terms=model.terms)
    return ExpansionPoint(replace(framed, model=model, layout=own, unknowns=unknowns), values - prior.start)


def model_at(prior: Prior, moved: np.ndarray) -> Model:
    """The solved model with its values moved, within their physical bounds.

    Args:
        prior: the solved model.
        moved: displacement from `Prior.start`, (w,) in usual sizes.

    Returns:
        The model.
    """
    layout, width = prior.layout, prior.width
    values = np.clip(prior.start + moved, layout.lower[:width], layout.upper[:width])
    rest = np.zeros(len(layout.scale) - width)
    thetas = layout.thetas(np.concatenate([values, rest]))
    terms = tuple(replace(term, theta=theta) for term, theta in zip(layout.terms, thetas, strict=True))
    return replace(prior.model, terms=terms)


def build_linear_problem(
    prior: Prior,
    at: ExpansionPoint,
    problem: Problem,
    changes: Sequence[Change],
    candidates: Sequence[Effect],
    noise: Noise,
    freedom: float,
    rows: np.ndarray,
    shapes: Mapping[str, Sequence[Shape]],
) -> LinearProblem:
    """Linearise: y = frame + X (root u + changes) + extrapolation + masked effects + new effects + noise.

    X are the columns of the model's values and root u their uncertainty. u and the extrapolation are part of every
    hypothesis, as the frame is; their prior N(0, 1) enters as pseudo-readings of zero with unit error.

    Args:
        prior: the solved model.
        at: where to linearise.
        problem: the run.
        changes: hypothetical changes.
        candidates: effects that may be new.
        noise: the noise floor.
        freedom: degrees of freedom of the noise floor.
        rows: rows that count, (n,) bool.
        shapes: of candidates, by key.

    Returns:
        The problem.
    """
    system = build_row_system(at.fitted, problem, candidates, noise, freedom, rows, shapes=shapes)
    linear = linear_columns(at.fitted, problem, [], noise)
    own = linear.columns[rows][:, :, : prior.width]
    assert linear.at is not None
    beyond = extrapolation_columns(prior, linear.at, problem)[rows]
    doubt = np.concatenate([own @ prior.root_now, beyond], axis=2)
    masked = prior.masked_effects.columns(linear.at, linear.columns[:, :, : prior.width], prior.gone)[rows]
    ways = value_directions(changes, prior.width)
    first, more = system.columns.shape[2], ways.shape[1]
    unsure, width = doubt.shape[2], doubt.shape[2] + more + masked.shape[2]
    atoms = {key: atom for key, atom in system.atoms.items() if atom.effect is None or atom.shape is not None}
    identity, zero = _readings_of_zero(unsure)
    past, said = prior.masked_effects.readings()
    base, read = np.pad(system.base_columns, [(0, 0), (0, 0), (0, width)]), system.base_values
    pseudo = np.pad(identity, [(0, 0), (0, 0), (first, more + masked.shape[2])])
    pseudo = np.concatenate([pseudo, np.pad(past, [(0, 0), (0, 0), (first + unsure + more, 0)])])
    on_base = linear.base_columns[:, :, : prior.width]
    if len(on_base):
        still = np.zeros((prior.width, beyond.shape[2]))
        base[:, :, first : first + unsure + more] = on_base @ np.hstack([prior.root_now, still, ways])
        read = read + on_base @ (at.moved - at.fitted.unknowns[: prior.width])
    system = replace(
        system,
        frame=np.concatenate([system.frame, np.arange(first, first + unsure)]).astype(int),
        atoms=atoms
        | atoms_of_changes(changes, first + unsure)
        | masked_atoms(prior.masked_effects, first + unsure + more),
        columns=np.concatenate([system.columns, doubt, own @ ways, masked], axis=2),
        values=linear.residual[rows] + own @ at.moved,
        scale=np.concatenate([system.scale, np.ones(width)]),
        base_columns=np.concatenate([base, pseudo]),
        base_values=np.concatenate([read, zero, said]),
        _sums={},
    )
    return LinearProblem(system, own, beyond, _unnamed(prior, linear)[rows], on_base)


def value_directions(changes: Sequence[Change], width: int) -> np.ndarray:
    """Derivative of a model's values by the unknowns of changes, (w, columns) in usual sizes."""
    ways = [np.zeros((width, 0))]
    for change in changes:
        own = np.zeros((width, change.ways.shape[1]))
        own[change.places] = change.ways
        ways.append(own)
    return np.concatenate(ways, axis=1)


def _readings_of_zero(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Pseudo-readings of zero with unit error of each unknown, three to a row, (m, 3, count) and (m, 3)."""
    rows = -(-count // 3)
    columns = np.zeros((3 * rows, count))
    columns[:count] = np.eye(count)
    return columns.reshape(rows, 3, count), np.zeros((rows, 3))


def _unnamed(prior: Prior, linear: Linear) -> np.ndarray:
    """Root of the readings' covariance by sizes of the drawing that the model does not have, (n, 3, r) whitened."""
    own = linear.columns[:, :, : prior.width]
    if prior.unnamed is None or linear.at is None:
        return np.zeros((*own.shape[:2], 0))
    more = [linear.at.columns(effect, {}) for effect in prior.unnamed.effects]
    return np.asarray(np.concatenate([own, *more], axis=2) @ prior.unnamed.root)
