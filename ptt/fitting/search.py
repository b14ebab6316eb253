"""Starting values of a new effect: the trial shape that explains most of the residual, and linear amplitudes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.linalg import solve_triangular
from torch import Tensor

from ptt.effects import Effect
from ptt.effects.layout import flatten
from ptt.fitting.factor import RANK_TOLERANCE, factor_of
from ptt.fitting.layout import lay_out
from ptt.fitting.linear import Linear, Shape, assemble, tried_sizes
from ptt.fitting.outliers import CAUCHY_KNEE, linear_residual
from ptt.fitting.reach import require_reach
from ptt.fitting.stated import SEEN_INFORMATION
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem

Choice = dict[str, tuple[Shape, np.ndarray]]  # of each new effect its shape, and its amplitudes in usual sizes

OPENING_VARIANCE = 1e5  # prior variance in usual sizes of a new effect: what rows hardly see may still be large
LEAST_GAIN = 10.0  # chi-squared that another shape must gain beyond the first trial, which is the simplest
HALF_ROOT = 0.7  # root of a robust weight of one half
LEAST_OPENING = 0.05  # usual sizes at which amplitudes that cannot be negative start at the least


@dataclass(frozen=True)
class _Stage:
    """The known model linearised, rows weighted robustly, beside which new effects are opened."""

    linear: Linear
    root: np.ndarray  # (n, 1, 1) square roots of the weights; zero for rows that do not count

    @property
    def values(self) -> np.ndarray:
        """Weighted readings less the known model, (n, 3)."""
        return self.linear.residual * self.root[..., 0]

    def columns(self, effect: Effect, shape: Shape) -> np.ndarray:
        """Weighted columns of an effect, (n, 3, P)."""
        assert self.linear.at is not None
        return self.linear.at.columns(effect, shape) * self.root


def open_terms(terms: Sequence[Term], problem: Problem, noise: Noise) -> list[Term]:
    """Give values to the terms that have none.

    Args:
        terms: of a model.
        problem: the readings.
        noise: the noise floor.

    Returns:
        All terms, in the order given.

    Raises:
        PosesError: with the values of the others the machine could not have stood at some row.
    """
    new = [term for term in terms if not len(term.theta)]
    if not new:
        return list(terms)
    trials = {term.effect.key: _trials(term.effect, problem) for term in new}
    stage = _linearise([term for term in terms if len(term.theta)], new, trials, problem, noise)
    chosen = _choose(stage, new, trials, problem)
    if any(len(each) > 1 for each in trials.values()) and (stage.root[stage.linear.rows] < HALF_ROOT).any():
        # Rows that the first trial shape does not fit may look like gross errors, so equal weights are tried too.
        even = _choose(replace(stage, root=np.sign(stage.root)), new, trials, problem)
        chosen = min((chosen, even), key=lambda choice: _left_robustly(stage, new, choice))
    opened = {term.effect.key: _opened(term, *chosen[term.effect.key], problem) for term in new}
    return [opened.get(term.effect.key, term) for term in terms]


def _left_robustly(stage: _Stage, new: Sequence[Term], chosen: Choice) -> float:
    """Cauchy loss of the residual with new effects of some shapes, over all rows."""
    linear, shapes = stage.linear, [(term.effect, chosen[term.effect.key][0]) for term in new]
    assert linear.at is not None
    columns = [linear.columns[..., linear.simple], *(linear.at.columns(effect, shape) for effect, shape in shapes)]
    every = np.concatenate([each[linear.rows] for each in columns], axis=-1)
    left, _ = linear_residual(linear.residual[linear.rows], every, np.zeros(0), np.zeros((0, every.shape[-1])))
    return float(np.log1p(np.square(left).sum(axis=1) / CAUCHY_KNEE).sum())


def _opened(term: Term, shape: Shape, amplitude: np.ndarray, problem: Problem) -> Term:
    amounts = torch.as_tensor(amplitude * tried_sizes(term.effect, problem))
    return replace(term, theta=opened_at(term.effect, shape, amounts, problem))


def opened_at(effect: Effect, shape: Shape, amounts: Tensor, problem: Problem) -> Tensor:
    """Parameters of a new effect from which a fit goes on, inside its bounds.

    Args:
        effect: the effect.
        shape: stem -> values of its searched and given parameters.
        amounts: its linear values, or the first of them, (w,) in their units.
        problem: the readings.

    Returns:
        Flat theta; an amplitude that cannot be negative starts off zero, where the shape has no slope to follow.
    """
    kind, joints = problem.file.machine.kind, problem.view.joints
    theta = flatten(effect, shape, joints)
    theta[: len(amounts)] = amounts
    place = 0
    for item in (parameter.on(kind) for parameter in effect.parameters):
        part = slice(place, place + item.size(joints))
        place = part.stop
        least = LEAST_OPENING * item.usual if item.role == "linear" and item.lower == 0.0 else item.lower
        theta[part] = theta[part].clamp(least, min(item.upper, item.most))
    return theta


def _choose(stage: _Stage, new: Sequence[Term], trials: Mapping[str, Sequence[Shape]], problem: Problem) -> Choice:
    """The best shape of each new effect beside the first ones of the others, and its amplitudes."""
    linear, shapes = stage.linear, {key: each[0] for key, each in trials.items()}
    known = {"": linear.simple} | {trial.effect.key: trial.columns for trial in linear.trials}
    blocks = {key: linear.columns[..., own] * stage.root for key, own in known.items()}

    def profile(effect: Effect, among: Sequence[Shape]) -> None:
        others = [block for name, block in blocks.items() if name != effect.key]
        shapes[effect.key] = _profile(stage, effect, among, others)
        blocks[effect.key] = stage.columns(effect, shapes[effect.key])

    for term in new:
        if len(trials[term.effect.key]) > 1:
            profile(term.effect, trials[term.effect.key])
    amplitudes, before = _amplitudes(stage, blocks), dict(shapes)
    for term in new:
        key = term.effect.key
        amounts = torch.as_tensor(amplitudes[key] * tried_sizes(term.effect, problem))
        meant = term.effect.meant_by(problem.view, shapes[key], amounts)
        if meant:  # shapes that are one while amounts are small
            profile(term.effect, meant)
    if any(shapes[key] is not before[key] for key in shapes):
        amplitudes = _amplitudes(stage, blocks)
    return {key: (shape, amplitudes[key]) for key, shape in shapes.items()}


def _trials(effect: Effect, problem: Problem) -> list[Shape]:
    """Shapes to try."""
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
    known: Sequence[Term], new: Sequence[Term], trials: Mapping[str, Sequence[Shape]], problem: Problem, noise: Noise
) -> _Stage:
    """The known model, rows weighted as the first trial of each new effect has them."""
    layout = lay_out(Model(problem.file), problem, known)
    first = {key: each[:1] for key, each in trials.items()}
    linear = assemble(layout, layout.start(), problem, noise, [term.effect for term in new], first)
    rows, held = linear.rows, linear.held
    require_reach(rows, known, problem)  # what would be opened beside them had no columns there
    root = np.zeros((len(rows), 1, 1))
    _, weight = linear_residual(
        linear.residual[rows], linear.columns[rows], np.zeros(int(held.sum())), np.diag(held.astype(float))[held]
    )
    root[rows, 0, 0] = np.sqrt(weight)
    return _Stage(linear, root)


def _profile(stage: _Stage, effect: Effect, trials: Sequence[Shape], others: Sequence[np.ndarray]) -> Shape:
    """The best of some shapes, refined."""
    base = _orthonormal(np.concatenate(others, axis=-1))
    left = stage.values.ravel() - base @ (base.T @ stage.values.ravel())

    def gains(shapes: Sequence[Shape]) -> np.ndarray:
        return np.array([_gain(stage.columns(effect, shape), base, left) for shape in shapes])

    found = gains(trials)
    best = int(np.argmax(found))
    if found[best] < found[0] + LEAST_GAIN:
        best = 0
    assert stage.linear.at is not None
    finer = effect.refine(stage.linear.at.chain.at_tool, trials[best])
    if len(finer) < 2:
        return trials[best]
    refined = gains(finer)
    return finer[int(np.argmax(refined))] if refined.max() > found[best] else trials[best]


def _gain(columns: np.ndarray, base: np.ndarray, left: np.ndarray) -> float:
    """Chi-squared that columns explain beside a base."""
    flat = columns.reshape(-1, columns.shape[-1])
    flat = flat - base @ (base.T @ flat)
    along = solve_triangular(factor_of(flat.T @ flat, 1.0 / OPENING_VARIANCE), flat.T @ left, lower=True)
    return float(along @ along)


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    """Basis of what columns (n, 3, P) span, (3 n, r); P is zero where the frame is trusted and nothing else known."""
    flat = columns.reshape(3 * len(columns), columns.shape[-1])
    eigenvalues, directions = np.linalg.eigh(flat.T @ flat)
    seen = eigenvalues > max(SEEN_INFORMATION, RANK_TOLERANCE * eigenvalues.max(initial=0.0))
    return flat @ (directions[:, seen] / np.sqrt(eigenvalues[seen]))


def _amplitudes(stage: _Stage, blocks: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Key -> joint least-squares solution in usual sizes; directions that the rows do not see stay zero."""
    flat = np.concatenate(list(blocks.values()), axis=-1)
    flat = flat.reshape(-1, flat.shape[-1])
    eigenvalues, directions = np.linalg.eigh(flat.T @ flat + np.diag(stage.linear.held.astype(float)))
    seen = eigenvalues > max(SEEN_INFORMATION, RANK_TOLERANCE * eigenvalues.max(initial=0.0))
    solution = directions[:, seen] @ ((directions[:, seen].T @ (flat.T @ stage.values.ravel())) / eigenvalues[seen])
    ends = np.cumsum([block.shape[-1] for block in blocks.values()])
    return dict(zip(blocks, np.split(solution, ends[:-1]), strict=True))
