"""Visits to base reflectors: detection of faulty ones, and scatter of the tracker's position between rounds."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from ptt.run.frames import kabsch, rigid_columns
from ptt.run.means import about_means

FAR = 8.0  # standard deviations of one coordinate: smaller misfits of a visit are no fault
WORSE = 5.0  # times the misfit of the third best reflector, likewise: a wrong drawing puts all visits off alike
ENOUGH = 3  # fewest reflectors that determine a frame
LONG = 5e-5  # relative scale error that a tracker may have: fifty degrees of air temperature
AS_LINE = 0.02  # least width by length of reflectors that determine a frame
MOTION = 7  # degrees of freedom of a rigid motion with scale
RANK = 1e-9  # share of the visits, below which what rounds move is rounding: one round, or nothing in common
NOTICED = 1e-6  # of a column's size: what moves rounds by less is rounding


def sound_visits(
    visits: Mapping[str, np.ndarray], rows: Mapping[str, np.ndarray], place: Mapping[str, np.ndarray], sigma: float
) -> dict[str, np.ndarray]:
    """Find the visits to base reflectors that agree with those to the others around the same time.

    Distances between reflectors do not depend on where the tracker stands, so a knock between two rounds is no fault of
    a visit. A reflector without any sound visit was misread each time, or is not where it is drawn; the others
    determine the frame where they suffice.

    Args:
        visits: name -> (v, 3) mm as read.
        rows: name -> (v,) rows of the run, the order in time.
        place: name -> (3,) mm as drawn.
        sigma: standard deviation of one coordinate of a visit, mm.

    Returns:
        name -> (v,) bool, sound visits; at least three reflectors have one.
    """
    kept = {name: np.ones(len(read), dtype=bool) for name, read in visits.items()}
    for _ in range(2):  # the second time without the faulty ones of the first
        beside = {name: own for name, own in kept.items() if own.any()}
        misfit = {name: _misfit(name, visits, rows, place, beside) for name in visits}
        best = sorted(float(off.min()) for off in misfit.values())[ENOUGH - 1]
        kept = {name: off <= max(FAR * sigma, WORSE * best) for name, off in misfit.items()}
        if not _span_plane(np.array([place[name] for name, own in kept.items() if own.any()])):
            kept = {name: off <= max(FAR * sigma, WORSE * float(off.min())) for name, off in misfit.items()}
    alone = _single_outliers(visits, rows, place, kept, sigma)
    return {name: own & ~alone[name] for name, own in kept.items()}


def _misfit(
    name: str,
    visits: Mapping[str, np.ndarray],
    rows: Mapping[str, np.ndarray],
    place: Mapping[str, np.ndarray],
    beside: Mapping[str, np.ndarray],
) -> np.ndarray:
    """Misfit of the distances from each visit of one reflector to the others, against the drawn ones, (v,) mm."""
    others = [other for other in beside if other != name]
    off = np.empty((len(others), len(visits[name])))
    for index, other in enumerate(others):
        own = beside[other]
        near = np.abs(rows[name][:, None] - rows[other][own]).argmin(axis=1)
        drawn = np.linalg.norm(place[name] - place[other])
        off[index] = np.abs(np.linalg.norm(visits[name] - visits[other][own][near], axis=1) - drawn) - LONG * drawn
    of_most = (len(off) - 1) // 2  # lower median: of two, one may be the other reflector's fault
    return np.asarray(np.sort(off, axis=0)[of_most])


def _single_outliers(
    visits: Mapping[str, np.ndarray],
    rows: Mapping[str, np.ndarray],
    place: Mapping[str, np.ndarray],
    kept: Mapping[str, np.ndarray],
    sigma: float,
) -> dict[str, np.ndarray]:
    """Single outliers of a rigid motion with scale from the drawing to each round of visits, (v,) bool each.

    A misreading at right angles to some distances hardly changes these, but no motion fits it. The test is that of a
    deleted residual: the reduction of the sum of squares when a visit is left out, by its leverage, against the rest.
    """
    names = [name for name, own in kept.items() if own.any()]
    alone = {name: np.zeros(len(read), dtype=bool) for name, read in visits.items()}
    spots = np.array([place[name] for name in names])
    if len(names) <= ENOUGH or not all(_span_plane(np.delete(spots, index, axis=0)) for index in range(len(names))):
        return alone
    ways = np.linalg.qr(_motion_columns(spots))[0]
    free = np.linalg.inv(np.eye(3) - np.einsum("kcw,kdw->kcd", *(2 * [ways.reshape(len(names), 3, MOTION)])))
    beside = {name: _beside(name, names, rows, kept) for name in names}
    rounds, which = np.unique(np.concatenate(list(beside.values())), axis=0, return_inverse=True)
    error = np.empty((len(rounds), len(names), 3))
    for number, visit in enumerate(rounds):
        read = np.array([visits[name][one] for name, one in zip(names, visit, strict=True)])
        turn, shift = kabsch(spots, read)
        error[number] = (read - shift) @ turn - spots
    flat = error.reshape(len(rounds), -1)
    left = flat - (flat @ ways) @ ways.T
    each = left.reshape(error.shape)
    takes = np.einsum("vkc,kcd,vkd->vk", each, free, each)
    rest = (np.square(left).sum(axis=1)[:, None] - takes) / (3 * (len(names) - 1) - MOTION)
    off = (takes == takes.max(axis=1)[:, None]) & (takes > np.maximum((FAR * sigma) ** 2, WORSE**2 * rest))
    ends = np.cumsum([len(own) for own in beside.values()])
    for index, (name, own) in enumerate(zip(names, np.split(which.ravel(), ends[:-1]), strict=True)):
        alone[name][kept[name]] = off[own, index]
    return alone


def _beside(
    name: str, names: Sequence[str], rows: Mapping[str, np.ndarray], kept: Mapping[str, np.ndarray]
) -> np.ndarray:
    """For each kept visit of one reflector the visits of all reflectors nearest in time, (v, k) int."""
    seen = [np.flatnonzero(kept[one]) for one in names]
    own = rows[name][kept[name]][:, None]
    return np.column_stack(
        [some[np.abs(own - rows[one][some]).argmin(axis=1)] for one, some in zip(names, seen, strict=True)]
    )


def _motion_columns(place: np.ndarray) -> np.ndarray:
    """Jacobian of positions (r, 3) mm by a rigid motion and scale about their mean, (3 r, 7)."""
    arm = place - place.mean(axis=0)
    return np.column_stack([rigid_columns(torch.as_tensor(arm)).reshape(-1, 6).numpy(), arm.ravel()])


def _span_plane(place: np.ndarray) -> bool:
    """Whether positions (r, 3) mm of reflectors determine a frame: three or more of them, not on one line."""
    spread = np.linalg.svd(place - place.mean(axis=0), compute_uv=False)
    return len(place) >= ENOUGH and bool(spread[1] > AS_LINE * spread[0])


def visits_scatter(read: np.ndarray, point: np.ndarray, rounds: np.ndarray, place: np.ndarray) -> float:
    """Scatter of single visits about a rigid motion with scale of each round, and a shift of each reflector.

    A tracker that is farther from the reflectors than from the poses, or sees them through worse air, reads them worse.
    However it drifts, warms or is knocked, it moves the reflectors of a round as one body that may grow.

    Args:
        read: visits, (m, 3) mm.
        point: (m,) int, index of the reflector.
        rounds: (m,) int, equal for visits to different reflectors one after the other.
        place: where the reflectors are drawn, (m, 3) mm.

    Returns:
        Its standard deviation in one coordinate, mm; zero where the visits are too few to tell.
    """
    moves = _motion_columns(place).reshape(len(read), 3, MOTION)
    size = np.sqrt(np.square(moves).mean(axis=(0, 1)))  # rotations move the reflectors far more than shifts
    moves /= np.where(size > 0.0, size, 1.0)
    in_round, of_point = ((one[:, None] == np.unique(one)).astype(float) for one in (rounds, point))
    free = np.concatenate(
        [
            np.einsum("mcw,mr->mcrw", moves, in_round).reshape(len(read), 3, -1),
            np.einsum("cd,mp->mcpd", np.eye(3), of_point).reshape(len(read), 3, -1),
        ],
        axis=2,
    )
    ways, share, _ = np.linalg.svd(free.reshape(read.size, -1), full_matrices=False)
    ways = ways[:, share > NOTICED * share[0]]
    left = read.ravel() - ways @ (ways.T @ read.ravel())
    freedom = read.size - ways.shape[1]
    return float(np.sqrt(np.square(left).sum() / freedom)) if freedom else 0.0


def rounds_apart(read: np.ndarray, point: np.ndarray, rounds: np.ndarray, columns: np.ndarray) -> float | None:
    """Scatter between rounds of visits that all reflectors have in common: the tracker drifts or is knocked.

    Averaging over reflectors does not reduce it, and the poses in between share it in an unknown way. Rounds need not
    be complete: it is the variance component of rounds beside means of the reflectors and what else is fitted, by the
    reduction of the sum of squares that rounds bring (C. R. Henderson's method 3, Biometrics 9, 1953).

    Args:
        read: visits, less what is fitted to them, (m, 3) mm.
        point: (m,) int, index of the reflector.
        rounds: (m,) int, equal for visits to different reflectors one after the other.
        columns: derivative of the visits by each number that is fitted, (m, 3, c); what these do to all rounds alike,
            as a scale of the tracker, says nothing of the scatter between them.

    Returns:
        Its standard deviation in one coordinate, mm, with the reflectors' own scatter subtracted, where any two share
        rounds to tell it by; zero where each was visited once; None where what is fitted may move rounds at will.
    """
    at = (rounds[:, None] == np.unique(rounds)).astype(float)  # shape: (m, rounds)
    power, ways = np.linalg.eigh(at.T @ about_means(at, point))
    seen = power > RANK * len(read)
    if not seen.any():
        return 0.0
    about, power = about_means(read, point), power[seen]
    to_rounds = (ways[:, seen] / np.sqrt(power)).T @ at.T  # orthonormal: each way keeps the scatter of one visit
    common = to_rounds @ about  # shape: (ways, 3)
    others = 3 * (len(read) - len(np.unique(point)) - len(power))
    own = float(np.square(about).sum() - np.square(common).sum()) / others if others else 0.0
    fitted = _span(to_rounds @ about_means(columns.reshape(len(read), -1), point), columns)
    freedom = common.size - fitted.shape[1]
    if not freedom:
        return None
    left = float(np.square(common).sum() - np.square(common.ravel() @ fitted).sum()) - own * freedom
    weight = 3.0 * power.sum() - np.repeat(power, 3) @ np.square(fitted).sum(axis=1)
    return float(np.sqrt(max(left / weight, 0.0)))


def _span(moved: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis, (3 k, r), of what columns (m, 3, c) do to k ways of the rounds, (k, 3 c)."""
    size = np.sqrt(np.square(columns).sum(axis=(0, 1)))
    basis, share, _ = np.linalg.svd(moved.reshape(3 * len(moved), -1) / np.where(size > 0.0, size, 1.0), False)
    return np.asarray(basis[:, share > NOTICED])
