"""Where a new effect starts: the trial shape that takes most off the residual, and linear amplitudes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.chain import Chain, linearise, signature, trace
from ptt.effects import Effect
from ptt.effects.base import flatten, linear_size
from ptt.effects.metrology import SetupJump, rigid_basis
from ptt.fit.outliers import linear_residual
from ptt.fit.whitened import by_own, whiten
from ptt.model import Model, Term
from ptt.noise import DEFAULT_SIGMA, Noise
from ptt.problem import MOUNT_USUAL, SHIFT_USUAL, TURN_USUAL, Problem

SEEN = 1.0  # information, in usual sizes, below which a direction is left out
WORTH = 10.0  # chi-squared that another shape must take beyond the first trial, which is the simplest
FINER = 8  # shapes tried between neighbours of the best
OPENING = 0.05  # where amplitudes that cannot be negative start at the least, in usual sizes

Shape = Mapping[str, Tensor]


@dataclass(frozen=True)
class _Stage:
    """What a new effect is held against: whitened readings and the columns of everything else."""

    chain: Chain
    problem: Problem
    whitener: np.ndarray
    rows: np.ndarray  # (n,) bool
    weight: np.ndarray  # (m, 1, 1) square roots of the robust weights
    values: np.ndarray  # (m, 3)

    def columns(self, effect: Effect, shape: Shape) -> np.ndarray:
        """Whitened columns of an effect on the rows that count, (m, 3, P)."""
        basis = signature(self.chain, effect, shape).numpy()[self.rows]
        return whiten([basis], self.whitener, usual_sizes(effect, self.problem))


def best_shape(model: Model, problem: Problem, effect: Effect, noise: Noise | None = None) -> Term:
    """Choose searched and given parameters of an effect that is to be added, and amplitudes to start from.

    Every trial's columns are projected off what the model and the tracker frame explain already; the trial that takes
    most of the residual wins, and is then refined: a knock to the row, a time constant between its neighbours.

    Args:
        model: the model without the effect; terms without values are left aside.
        problem: the readings.
        effect: the effect.
        noise: the noise floor; None takes the problem's.

    Returns:
        The effect with values.
    """
    noise = noise or problem.noise or Noise(np.eye(3) * DEFAULT_SIGMA**2, "first guess")
    known = [term for term in model.terms if len(term.theta)]
    return open_terms([*known, Term(effect, torch.zeros(0, dtype=torch.float64))], problem, noise)[-1]


def open_terms(terms: Sequence[Term], problem: Problem, noise: Noise) -> list[Term]:
    """Give values to the terms that have none.

    Args:
        terms: of a model.
        problem: the readings.
        noise: the noise floor.

    Returns:
        All terms, in the order given.
    """
    new = [term for term in terms if not len(term.theta)]
    if not new:
        return list(terms)
    shapes = {term.effect.key: _trials(term.effect, problem) for term in new}
    known = [term for term in terms if len(term.theta)]
    stage, blocks = _linearise(known, [(term.effect, shapes[term.effect.key][0]) for term in new], problem, noise)
    for term in new:
        key = term.effect.key
        if len(shapes[key]) > 1:
            others = [block for name, block in blocks.items() if name != key]
            shapes[key] = [_profile(stage, term.effect, shapes[key], others)]
            blocks[key] = stage.columns(term.effect, shapes[key][0]) * stage.weight
    held = np.concatenate([_held(known, problem), *(held_values(term.effect, problem) for term in new)])
    amplitudes = _amplitudes(stage, blocks, held)
    opened = {
        term.effect.key: _opened(term, shapes[term.effect.key][0], amplitudes[term.effect.key], problem) for term in new
    }
    return [opened.get(term.effect.key, term) for term in terms]


def usual_sizes(effect: Effect, problem: Problem) -> np.ndarray:
    """Usual size of each linear value of an effect, (P,)."""
    kind, joints = problem.file.machine.kind, problem.view.joints
    parameters = [parameter for parameter in effect.parameters if parameter.role == "linear"]
    return np.concatenate([np.full(item.size(joints), item.on(kind).usual) for item in parameters])


def held_values(effect: Effect, problem: Problem) -> np.ndarray:
    """Which linear values are kept near zero by the definition of the effect, (P,) bool."""
    parameters = [parameter for parameter in effect.parameters if parameter.role == "linear"]
    return np.concatenate([np.full(item.size(problem.view.joints), item.held) for item in parameters])


def _held(known: Sequence[Term], problem: Problem) -> np.ndarray:
    """The same for the base columns: free values of known terms, then mounts and frames."""
    joints, frames = problem.view.joints, np.zeros(3 * problem.mounts + 6 * problem.frames, dtype=bool)
    flags = [np.concatenate([np.full(p.size(joints), p.held) for p in term.effect.parameters]) for term in known]
    return np.concatenate([*(flag[_free(term, problem) > 0] for flag, term in zip(flags, known, strict=True)), frames])


def _trials(effect: Effect, problem: Problem) -> list[Shape]:
    trials = list(effect.search(problem.view))
    if trials:
        return trials
    # The data see no trial: the usual sizes hold the shape, and the fit will call the effect unseen.
    kind, joints = problem.file.machine.kind, problem.view.joints
    return [
        {
            item.stem: torch.full((item.size(joints),), item.on(kind).usual, dtype=torch.float64)
            for item in effect.parameters
            if item.role != "linear"
        }
    ]


def _linearise(
    known: Sequence[Term], new: Sequence[tuple[Effect, Shape]], problem: Problem, noise: Noise
) -> tuple[_Stage, dict[str, np.ndarray]]:
    """The stage, and whitened, robustly weighted columns by key: known terms and frame together under ''."""
    shifts = [(term.effect, term.theta) for term in known]
    chain = trace(shifts, problem.view)
    rows = problem.used & np.isfinite(chain.reading.numpy()).all(axis=1)
    values = (problem.measured - chain.reading.numpy())[rows] @ noise.whitener.T
    stage = _Stage(chain, problem, noise.whitener, rows, np.ones((int(rows.sum()), 1, 1)), values)
    blocks = {"": _base_columns(stage, shifts, known)}
    blocks |= {effect.key: stage.columns(effect, shape) for effect, shape in new}
    joined = np.concatenate(list(blocks.values()), axis=-1)
    held = np.concatenate([_held(known, problem), *(held_values(effect, problem) for effect, _ in new)])
    _, weight = linear_residual(values, joined, np.zeros(int(held.sum())), np.diag(held.astype(float))[held])
    root = np.sqrt(weight)[:, None, None]
    stage = replace(stage, weight=root, values=values * root[..., 0])
    return stage, {key: block * root for key, block in blocks.items()}


def _base_columns(stage: _Stage, shifts: list[tuple[Effect, Tensor]], known: Sequence[Term]) -> np.ndarray:
    problem = stage.problem
    parts, scales = [], []
    if shifts:
        free = np.concatenate([_free(term, problem) for term in known])
        parts.append(linearise(shifts, problem.view).jacobian.numpy()[..., free > 0][stage.rows])
        scales.append(free[free > 0])
    for block in by_own(stage.chain.by_slot[..., -3:].numpy(), problem.mount, problem.mounts) if problem.mounts else ():
        parts.append(block[stage.rows])
        scales.append(np.full(3, MOUNT_USUAL))
    rigid = rigid_basis(stage.chain.reading).numpy()
    for block in by_own(rigid, problem.frame, problem.frames) if problem.frames else ():
        parts.append(block[stage.rows])
        scales.append(np.array([SHIFT_USUAL] * 3 + [TURN_USUAL] * 3))
    if not parts:
        return np.zeros((int(stage.rows.sum()), 3, 0))
    return whiten(parts, stage.whitener, np.concatenate(scales))


def _free(term: Term, problem: Problem) -> np.ndarray:
    """Usual size of each value that the fit may change, zero for the others, (P,)."""
    kind, joints = problem.file.machine.kind, problem.view.joints
    sizes = [
        np.full(item.size(joints), item.on(kind).usual if item.role != "given" and item.stem not in term.fixed else 0.0)
        for item in term.effect.parameters
    ]
    return np.concatenate(sizes)


def _profile(stage: _Stage, effect: Effect, trials: Sequence[Shape], others: Sequence[np.ndarray]) -> Shape:
    """The best of some shapes, refined."""
    base = _orthonormal(np.concatenate(others, axis=-1))
    left = stage.values.ravel() - base @ (base.T @ stage.values.ravel())

    def gains(shapes: Sequence[Shape]) -> np.ndarray:
        return np.array([_gain(stage.columns(effect, shape) * stage.weight, base, left) for shape in shapes])

    found = gains(trials)
    best = int(np.argmax(found))
    if found[best] < found[0] + WORTH:
        best = 0
    finer = _between(effect, trials, best, stage)
    if not finer:
        return trials[best]
    refined = gains(finer)
    return finer[int(np.argmax(refined))] if refined.max() > found[best] else trials[best]


def _between(effect: Effect, trials: Sequence[Shape], best: int, stage: _Stage) -> list[Shape]:
    """Shapes between the neighbours of the best trial: rows for a knock, times in proportion for a time constant."""
    around = [trials[index] for index in (best - 1, best + 1) if 0 <= index < len(trials)]
    own = trials[best]
    varied = [stem for stem in own if any(not torch.equal(own[stem], other[stem]) for other in around)]
    if len(varied) != 1 or own[varied[0]].numel() != 1:
        return []
    stem = varied[0]
    ends = sorted(float(item[stem]) for item in (own, *around))
    if isinstance(effect, SetupJump):
        moments = effect.clock(stage.chain.at_tool).unique()
        inner = moments[(moments >= ends[0]) & (moments <= ends[-1])]
    elif best == 0 and len(around) == 1:
        return []  # the first trial is the simplest law, not one end of a scale
    else:
        inner = torch.as_tensor(np.geomspace(ends[0], ends[-1], FINER + 2)[1:-1])
    return [{**own, stem: value.reshape(1)} for value in inner]


def _gain(columns: np.ndarray, base: np.ndarray, left: np.ndarray) -> float:
    """Chi-squared that columns take off what the base leaves."""
    flat = columns.reshape(-1, columns.shape[-1])
    flat = flat - base @ (base.T @ flat)
    strength, directions = np.linalg.eigh(flat.T @ flat)
    along = directions.T @ (flat.T @ left)
    seen = strength > SEEN
    return float((along[seen] ** 2 / strength[seen]).sum())


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    flat = columns.reshape(-1, columns.shape[-1])
    strength, directions = np.linalg.eigh(flat.T @ flat)
    seen = strength > max(SEEN, 1e-12 * strength.max(initial=0.0))
    return flat @ (directions[:, seen] / np.sqrt(strength[seen]))


def _amplitudes(stage: _Stage, blocks: dict[str, np.ndarray], held: np.ndarray) -> dict[str, np.ndarray]:
    """Joint linear solution in usual sizes by key; what the rows do not see stays zero."""
    flat = np.concatenate(list(blocks.values()), axis=-1)
    flat = flat.reshape(-1, flat.shape[-1])
    strength, directions = np.linalg.eigh(flat.T @ flat + np.diag(held.astype(float)))
    seen = strength > max(SEEN, 1e-12 * strength.max(initial=0.0))
    solution = directions[:, seen] @ ((directions[:, seen].T @ (flat.T @ stage.values.ravel())) / strength[seen])
    ends = np.cumsum([block.shape[-1] for block in blocks.values()])
    return dict(zip(blocks, np.split(solution, ends[:-1]), strict=True))


def _opened(term: Term, shape: Shape, amplitude: np.ndarray, problem: Problem) -> Term:
    """The term at its linear amplitudes, inside its bounds."""
    kind, joints = problem.file.machine.kind, problem.view.joints
    theta = flatten(term.effect, shape, joints)
    linear = linear_size(term.effect, joints)
    theta[:linear] = torch.as_tensor(amplitude * usual_sizes(term.effect, problem))
    place = 0
    for item in (parameter.on(kind) for parameter in term.effect.parameters):
        part = slice(place, place + item.size(joints))
        place = part.stop
        least = OPENING * item.usual if item.role == "linear" and item.lower == 0.0 else item.lower
        theta[part] = theta[part].clamp(least, item.upper)
    return replace(term, theta=theta)
