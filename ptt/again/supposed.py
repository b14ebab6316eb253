"""The linear problem of a run against a solved model: what was uncertain, what may have changed, what may be new."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ptt.again.before import Before
from ptt.again.beyond import columns_beyond
from ptt.again.changes import Change, atoms_of_changes
from ptt.again.then import atoms_then
from ptt.diagnosis.evidence.row_system import RowSystem, build_row_system
from ptt.effects import Effect
from ptt.fitting.linear import Linear, Shape, linear_columns
from ptt.fitting.solve import FitResult, fit, hold
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem


@dataclass(frozen=True)
class At:
    """A solved model at some of its values, seen by a run.

    Attributes:
        fitted: all values free, frames and mounts where they fit the run.
        moved: (w,) how far its values are from those of the model, in usual sizes.
    """

    fitted: FitResult
    moved: np.ndarray


@dataclass(frozen=True)
class Supposed:
    """A run against a solved model as a linear problem, m rows that count.

    Attributes:
        system: of what was uncertain, may have changed and may be new; its values are what the model as it was leaves.
        own: columns of the model's values, (m, 3, w) whitened, in usual sizes.
        beyond: columns of how its curves go on beyond the heights that they were seen at, (m, 3, c).
        unnamed: how far sizes of the drawing that it does not have may move the readings, (m, 3, r).
        on_base: columns of the model's values at b readings of base reflectors that hold the frame, (b, 3, w).
    """

    system: RowSystem
    own: np.ndarray
    beyond: np.ndarray
    unnamed: np.ndarray
    on_base: np.ndarray


def stand_at(before: Before, moved: np.ndarray, problem: Problem, noise: Noise) -> At:
    """Put a solved model at other values, and the new run's set-up where it belongs.

    Args:
        before: the solved model.
        moved: (w,) in usual sizes.
        problem: the run.
        noise: the noise floor.

    Returns:
        Where to linearise.
    """
    layout, model = before.layout, model_at(before, moved)
    values = np.concatenate([term.theta.numpy()[free] for term, free in zip(model.terms, layout.free, strict=True)])
    values = values / layout.scale[: before.width]
    still = replace(model, terms=tuple(hold(term) for term in model.terms))
    framed = fit(still, problem, noise=noise, robust=False, coarse=True)
    unknowns = np.concatenate([values, framed.unknowns])
    own = replace(layout, terms=model.terms)
    return At(replace(framed, model=model, layout=own, unknowns=unknowns), values - before.start)


def model_at(before: Before, moved: np.ndarray) -> Model:
    """The solved model with its values moved, within what physics allows.

    Args:
        before: the solved model.
        moved: (w,) in usual sizes.

    Returns:
        The model.
    """
    layout, width = before.layout, before.width
    values = np.clip(before.start + moved, layout.lower[:width], layout.upper[:width])
    rest = np.zeros(len(layout.scale) - width)
    thetas = layout.thetas(np.concatenate([values, rest]))
    terms = tuple(replace(term, theta=theta) for term, theta in zip(layout.terms, thetas, strict=True))
    return replace(before.model, terms=terms)


def suppose(
    before: Before,
    at: At,
    problem: Problem,
    changes: Sequence[Change],
    candidates: Sequence[Effect],
    noise: Noise,
    freedom: float,
    rows: np.ndarray,
    shapes: Mapping[str, Sequence[Shape]],
) -> Supposed:
    """Linearise: y = frame + X (uncertain then + changed since) + what may be new + noise.

    What was uncertain then is part of every hypothesis, as the frame is; its prior enters as readings of zero with
    the standard errors of the fit, so that directions that the old run did not see stay free.

    Args:
        before: the solved model.
        at: where to linearise.
        problem: the run.
        changes: what may have changed.
        candidates: effects that may be new.
        noise: the noise floor.
        freedom: degrees of freedom behind it.
        rows: rows that count, (n,) bool.
        shapes: of candidates, by key.
    """
    system = build_row_system(at.fitted, problem, candidates, noise, freedom, rows, shapes=shapes)
    linear = linear_columns(at.fitted, problem, [], noise)
    own = linear.columns[rows][:, :, : before.width]
    assert linear.at is not None
    beyond = columns_beyond(before, linear.at, problem)[rows]
    doubt = np.concatenate([own @ before.loose, beyond], axis=2)
    then = before.rooms.columns(linear.at, linear.columns[:, :, : before.width], before.gone)[rows]
    ways = ways_of(changes, before.width)
    first, more = system.columns.shape[2], ways.shape[1]
    unsure, width = doubt.shape[2], doubt.shape[2] + more + then.shape[2]
    atoms = {key: atom for key, atom in system.atoms.items() if atom.effect is None or atom.shape is not None}
    told, zero = _readings_of_zero(unsure)
    past, said = before.rooms.readings()
    base, read = np.pad(system.base_columns, [(0, 0), (0, 0), (0, width)]), system.base_values
    prior = np.pad(told, [(0, 0), (0, 0), (first, more + then.shape[2])])
    prior = np.concatenate([prior, np.pad(past, [(0, 0), (0, 0), (first + unsure + more, 0)])])
    on_base = linear.base_columns[:, :, : before.width]
    if len(on_base):
        still = np.zeros((before.width, beyond.shape[2]))
        base[:, :, first : first + unsure + more] = on_base @ np.hstack([before.loose, still, ways])
        read = read + on_base @ (at.moved - at.fitted.unknowns[: before.width])
    system = replace(
        system,
        frame=np.concatenate([system.frame, np.arange(first, first + unsure)]).astype(int),
        atoms=atoms | atoms_of_changes(changes, first + unsure) | atoms_then(before.rooms, first + unsure + more),
        columns=np.concatenate([system.columns, doubt, own @ ways, then], axis=2),
        values=linear.residual[rows] + own @ at.moved,
        scale=np.concatenate([system.scale, np.ones(width)]),
        base_columns=np.concatenate([base, prior]),
        base_values=np.concatenate([read, zero, said]),
        _sums={},
    )
    return Supposed(system, own, beyond, _unnamed(before, linear)[rows], on_base)


def ways_of(changes: Sequence[Change], width: int) -> np.ndarray:
    """How the values of a model move with its changes, (w, columns) in usual sizes."""
    ways = [np.zeros((width, 0))]
    for change in changes:
        own = np.zeros((width, change.ways.shape[1]))
        own[change.places] = change.ways
        ways.append(own)
    return np.concatenate(ways, axis=1)


def _readings_of_zero(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Each of some unknowns read once as zero with unit error, three to a row, (m, 3, count) and (m, 3)."""
    rows = -(-count // 3)
    columns = np.zeros((3 * rows, count))
    columns[:count] = np.eye(count)
    return columns.reshape(rows, 3, count), np.zeros((rows, 3))


def _unnamed(before: Before, linear: Linear) -> np.ndarray:
    """How far sizes of the drawing that a model does not have may move the readings, (n, 3, r) whitened."""
    own = linear.columns[:, :, : before.width]
    if before.unnamed is None or linear.at is None:
        return np.zeros((*own.shape[:2], 0))
    more = [linear.at.columns(effect, {}) for effect in before.unnamed.effects]
    return np.asarray(np.concatenate([own, *more], axis=2) @ before.unnamed.root)
