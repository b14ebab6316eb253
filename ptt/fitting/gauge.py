"""Gauge of reported values: of all values that the readings cannot tell apart, the sparsest are reported."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from ptt.fitting.chunks import sampled_if_long
from ptt.fitting.factor import RANK_TOLERANCE
from ptt.fitting.layout import FRAME_NAMES, MOUNT_NAMES, Layout, lay_out
from ptt.fitting.linear import Linear, assemble
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.workspace import OK, reach
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import joint_limits

UNTOLD_CHI2 = 9.0  # chi-squared (three standard errors) below which a change as large as the values goes unnoticed
LEAST_PART = 0.2  # singular value from which a term takes part in a free direction
WORKSPACE_PLACES = 128  # places all over the travel at which one machine is compared with another
# share of a pattern from which a frame motion takes part: a turn about a far pivot moves little else
LEAST_MOTION = 0.05
ExtraCovariance = Callable[[Sequence[str]], np.ndarray]  # names of v unknowns -> their further covariance, (v, v)
FRAME_RESIDUE = 0.1  # share of a pattern that the frame's motions may leave of it for it to be one of them


@dataclass(frozen=True)
class GaugedTerm:
    """A term in the gauge in which it is reported.

    Attributes:
        term: with the values and standard errors of that gauge.
        alike: motions of the tracker that its free directions cannot be told from, as in ('tracker z',).
    """

    term: Term
    alike: tuple[str, ...] = ()


def sparsest(
    terms: Sequence[Term], problem: Problem, noise: Noise, widen: float = 1.0, beside: Sequence[Term] = (),
    extra: ExtraCovariance | None = None,
) -> tuple[GaugedTerm, ...]:  # fmt: skip
    """Terms in the gauge in which the fewest of their values differ from zero.

    A homing offset of one slider is fitted as a third of it on each, because the tracker's z takes the rest. Of all
    values that the readings cannot tell apart, the least sum of absolute values (an L1 norm, hence a median instead of
    a mean) picks those in which most joints are right: what has to be adjusted.

    Args:
        terms: fitted together, with values.
        problem: the readings.
        noise: the noise floor.
        widen: ratio of what the fit leaves to the noise, where that exceeds one.
        beside: other terms of the same fit, which are free beside these when errors are stated but are not regauged.
        extra: names of unknowns -> further covariance of them in usual sizes, by what no term stands for.

    Returns:
        The terms in their order.
    """
    few = sampled_if_long(problem)
    layout, own, held = _laid_out(terms, beside, few)
    values, mine = layout.start(), layout.owner < len(terms)
    linear = assemble(layout, values, few, noise)
    gram = linear.total(problem.table.rows / few.table.rows)[0]
    information, motions = _without(gram, own, np.setdiff1d(np.flatnonzero(mine), own), held)
    information = information / widen**2
    free = _untold(information, values[own])
    if free.shape[1]:  # directions that other poses in the workspace would determine are no gauge
        free = _untold(information + _all_over(terms, beside, problem.file, noise), values[own])
    if not free.shape[1]:
        return tuple(GaugedTerm(term) for term in terms)
    unknowns = values.copy()
    unknowns[own], moved = _fewest(values[own], free)
    error = np.full(len(values), np.nan)
    if beside:
        # Their prior standard deviation: as large as they were found to be, but at least usual.
        prior = np.where(mine, held, 1.0 / np.maximum(_mean_squares(values, layout.group), 1.0))
        rest = np.setdiff1d(np.arange(len(values)), own)
        information = _without(gram / widen**2, own, rest, prior)[0]
    error[own] = _errors(information, moved)
    if extra is not None:
        error[own] = np.hypot(error[own], _moved_along(extra([layout.names[place] for place in own]), free, moved))
    said = []
    for index, (term, theta) in enumerate(zip(terms, layout.thetas(unknowns), strict=False)):
        taking = _taking_part(free, layout.owner[own] == index)
        std = torch.full_like(theta, torch.nan) if term.std is None else term.std.clone()
        if taking.shape[1]:
            std[torch.as_tensor(layout.free[index])] = torch.as_tensor((error * layout.scale)[layout.owner == index])
        # Effects of the metrology have no joints that could have something in common.
        names = () if term.effect.stage == "metrology" else _alike(linear, own, taking, motions, few.frames)
        said.append(GaugedTerm(replace(term, theta=theta, std=std), names))
    return tuple(said)


def reachable(file: MachineFile) -> tuple[np.ndarray, np.ndarray]:
    """Places all over a machine's travel, (n, 3) mm, and its joints there, (n, k)."""
    mechanism, limits = build_mechanism(file.machine), joint_limits(file)
    draw = torch.quasirandom.SobolEngine(len(limits), scramble=True, seed=0).draw(WORKSPACE_PLACES, dtype=torch.float64)
    q = limits[:, 0] + (limits[:, 1] - limits[:, 0]) * draw
    place = mechanism.forward(q)
    good = torch.isfinite(place).all(dim=1).numpy()
    good[good] = reach(mechanism, place[good]) == OK
    return place[good].numpy(), q[good].numpy()


def _all_over(terms: Sequence[Term], beside: Sequence[Term], file: MachineFile, noise: Noise) -> np.ndarray:
    """Mean information of one reading anywhere in the workspace on the own values of some terms, (u, u)."""
    frame = "trusted" if file.tracker.frame == "trusted" else "fitted"  # there are no base reflectors at these places
    file = replace(file, tracker=file.tracker.model_copy(update={"frame": frame}))
    place, q = reachable(file)
    command = q if file.machine.kind == "serial" else None
    problem = build_problem(file, replace(make_table(place, command), measured=place))
    layout, own, held = _laid_out(terms, beside, problem)
    gram = assemble(layout, layout.start(), problem, noise).total()[0]
    rest = np.setdiff1d(np.flatnonzero(layout.owner < len(terms)), own)
    return _without(gram, own, rest, held)[0] / len(place)


def _laid_out(
    terms: Sequence[Term], beside: Sequence[Term], problem: Problem
) -> tuple[Layout, np.ndarray, np.ndarray]:  # fmt: skip
    """Layout of some terms with others beside, the own free unknowns of the former, (u,), and the prior of all held."""
    layout = lay_out(Model(problem.file), problem, (*terms, *beside))
    mine = layout.owner < len(terms)
    own = np.flatnonzero(mine & (layout.owner >= 0) & ~layout.held & ~layout.searched)
    return layout, own, layout.held.astype(float)


def _taking_part(free: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Combinations of free directions, (u, m), in which the own values take part."""
    _, singular, right = np.linalg.svd(free[own], full_matrices=False)
    return np.asarray(free @ right[singular > LEAST_PART].T)


def _without(gram: np.ndarray, own: np.ndarray, rest: np.ndarray, prior: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Information on own values with others eliminated (Schur complement), and how these follow the own values.

    Args:
        gram: X^T X of u unknowns, (u, u).
        own: indices of the own values, (v,).
        rest: indices of what is free beside them, (w,); all else is held.
        prior: prior information on each unknown, (u,).

    Returns:
        Information (v, v), and all unknowns per unit of each own value, (u, v).
    """
    gram = gram.copy()
    gram[np.arange(len(prior)), np.arange(len(prior))] += prior
    follow = np.linalg.pinv(gram[np.ix_(rest, rest)], hermitian=True) @ gram[np.ix_(rest, own)]
    whole = np.zeros((len(gram), len(own)))
    whole[rest] = -follow
    whole[own, np.arange(len(own))] = 1.0
    return gram[np.ix_(own, own)] - gram[np.ix_(own, rest)] @ follow, whole


def _mean_squares(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Mean square of the values in each value's variance group, (u,)."""
    return np.array([np.square(values[group == own]).mean() for own in group.tolist()])


def _untold(information: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Directions, (u, m), along which a change as large as the values is not visible in the readings."""
    eigenvalues, directions = np.linalg.eigh(information)
    return directions[:, eigenvalues * float(values @ values) < UNTOLD_CHI2]


def _fewest(values: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The values of least L1 norm along free directions, (u,), and which of them differ from zero, (u,) bool."""
    count, directions = free.shape
    # Linear program: steps along the directions, then bounds; |values + free steps| <= bounds.
    limits = np.block([[free, -np.eye(count)], [-free, -np.eye(count)]])
    cost = np.concatenate([np.zeros(directions), np.ones(count)])
    bounds = [(None, None)] * directions + [(0.0, None)] * count
    from scipy.optimize import linprog

    found = linprog(cost, A_ub=limits, b_ub=np.concatenate([-values, values]), bounds=bounds)
    if not found.success:
        return values, np.ones(count, dtype=bool)
    chosen = values + free @ found.x[:directions]
    off = np.abs(chosen) > 1e-9 * np.abs(values).max()
    return np.where(off, chosen, 0.0), off


def _errors(information: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Standard errors in usual sizes of values that differ from zero, the others being zero by choice of gauge."""
    error = np.zeros(len(off))
    spread = np.diag(np.linalg.pinv(information[np.ix_(off, off)], hermitian=True))
    error[off] = np.sqrt(np.maximum(spread, 0.0))  # rounding may make it negative
    return error


def _moved_along(extra: np.ndarray, free: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Standard errors in usual sizes, (u,), from a further covariance, projected so that zero values stay zero.

    Args:
        extra: (u, u) further covariance.
        free: (u, m) directions along which the gauge is chosen.
        off: (u,) bool, values that differ from zero.
    """
    back = np.zeros((len(off), len(off)))
    back[:, ~off] = free @ np.linalg.pinv(free[~off])
    along = np.eye(len(off)) - back
    return np.where(off, np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", along, extra, along), 0.0)), 0.0)


def _alike(linear: Linear, own: np.ndarray, free: np.ndarray, motions: np.ndarray, frames: int) -> tuple[str, ...]:
    """Names of motions of the tracker or the reflector that compensate some of the free directions.

    All combinations of the directions are considered, since the basis of equally free ones is arbitrary.
    """
    columns = linear.columns[linear.rows].reshape(3 * int(linear.rows.sum()), -1)
    moved = motions @ free
    size, vectors = np.linalg.eigh(_square(columns[:, own] @ free))
    seen = size > RANK_TOLERANCE * size.max(initial=0.0)
    unit = vectors[:, seen] / np.sqrt(size[seen])  # of unit effect on the readings before compensation
    left, vectors = np.linalg.eigh(_square(columns @ (moved @ unit)))
    rigid = moved @ unit @ vectors[:, left < FRAME_RESIDUE**2]
    parts = np.linalg.norm(columns[:, linear.frame], axis=0) * np.linalg.norm(rigid[linear.frame], axis=1)
    strong = np.flatnonzero(parts > LEAST_MOTION)
    names = {FRAME_NAMES[place % 6] for place in strong if place < 6 * frames}
    names |= {MOUNT_NAMES[(place - 6 * frames) % 3] for place in strong if place >= 6 * frames}
    return tuple(name for name in (*FRAME_NAMES, *MOUNT_NAMES) if name in names)


def _square(columns: np.ndarray) -> np.ndarray:
    return columns.T @ columns
