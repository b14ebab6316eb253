"""Visits to base reflectors: which are sound, and how far the tracker moved between them."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from ptt.run.frames import kabsch, rigid_columns

FAR = 8.0  # standard deviations of one coordinate by which a visit's distances may be off
WORSE = 5.0  # and times the misfit of the worst of the best three: a wrong drawing puts all visits off alike
ENOUGH = 3  # reflectors that hold a frame
LONG = 5e-5  # share by which a tracker may read all lengths too long or too short: fifty degrees of air
AS_LINE = 0.02  # share of their length by which reflectors that hold one lie off a line at the least
MOTION = 7  # ways in which a round of visits may be moved and stretched as a whole


def sound_visits(
    visits: Mapping[str, np.ndarray], rows: Mapping[str, np.ndarray], place: Mapping[str, np.ndarray], sigma: float
) -> dict[str, np.ndarray]:
    """Leave out the visits to base reflectors that do not fit where the others were read beside them.

    Distances between reflectors know nothing of where the tracker stands, so a knock between two rounds of visits is
    none of it. A reflector of which no visit fits was misread each time, or is not where it is drawn: the others hold
    the frame, where they can.

    Args:
        visits: name -> (v, 3) mm as read.
        rows: name -> (v,) when each visit was, as rows of the run.
        place: name -> (3,) mm as drawn.
        sigma: of one coordinate of a visit, mm.

    Returns:
        name -> (v,) bool; of three reflectors at the least some visit.
    """
    kept = {name: np.ones(len(read), dtype=bool) for name, read in visits.items()}
    for _ in range(2):  # a visit between gross ones is judged by those that are not
        beside = {name: own for name, own in kept.items() if own.any()}
        misfit = {name: _misfit(name, visits, rows, place, beside) for name in visits}
        best = sorted(float(off.min()) for off in misfit.values())[ENOUGH - 1]
        kept = {name: off <= max(FAR * sigma, WORSE * best) for name, off in misfit.items()}
        if not _hold(np.array([place[name] for name, own in kept.items() if own.any()])):
            kept = {name: off <= max(FAR * sigma, WORSE * float(off.min())) for name, off in misfit.items()}
    alone = _alone(visits, rows, place, kept, sigma)
    return {name: own & ~alone[name] for name, own in kept.items()}


def _misfit(
    name: str,
    visits: Mapping[str, np.ndarray],
    rows: Mapping[str, np.ndarray],
    place: Mapping[str, np.ndarray],
    beside: Mapping[str, np.ndarray],
) -> np.ndarray:
    """How far distances of each visit to one reflector are off, (v,) mm, from those drawn to the others beside it."""
    others = [other for other in beside if other != name]
    off = np.empty((len(others), len(visits[name])))
    for index, other in enumerate(others):
        own = beside[other]
        near = np.abs(rows[name][:, None] - rows[other][own]).argmin(axis=1)
        drawn = np.linalg.norm(place[name] - place[other])
        off[index] = np.abs(np.linalg.norm(visits[name] - visits[other][own][near], axis=1) - drawn) - LONG * drawn
    of_most = (len(off) - 1) // 2  # of two, where one may be the other's fault, the lesser
    return np.asarray(np.sort(off, axis=0)[of_most])


def _alone(
    visits: Mapping[str, np.ndarray],
    rows: Mapping[str, np.ndarray],
    place: Mapping[str, np.ndarray],
    kept: Mapping[str, np.ndarray],
    sigma: float,
) -> dict[str, np.ndarray]:
    """Visits that alone keep those beside them from being the drawing, moved and stretched as a whole, (v,) bool each.

    A beam that is broken halfway across some distances changes few of them by much, but no motion brings it home. What
    leaving a visit out takes off the sum of squares is held against the rest's, as its leverage has it.
    """
    names = [name for name, own in kept.items() if own.any()]
    alone = {name: np.zeros(len(read), dtype=bool) for name, read in visits.items()}
    spots = np.array([place[name] for name in names])
    if len(names) <= ENOUGH or not all(_hold(np.delete(spots, index, axis=0)) for index in range(len(names))):
        return alone
    ways = np.linalg.qr(_ways(spots))[0]
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
    """The visits of each reflector that lie nearest to those of one, (v, k) int."""
    seen = [np.flatnonzero(kept[one]) for one in names]
    own = rows[name][kept[name]][:, None]
    return np.column_stack(
        [some[np.abs(own - rows[one][some]).argmin(axis=1)] for one, some in zip(names, seen, strict=True)]
    )


def _ways(place: np.ndarray) -> np.ndarray:
    """How reflectors at some places, (r, 3) mm, move as one: shifted, turned and stretched, (3 r, 7)."""
    arm = place - place.mean(axis=0)
    return np.column_stack([rigid_columns(torch.as_tensor(arm)).reshape(-1, 6).numpy(), arm.ravel()])


def _hold(place: np.ndarray) -> bool:
    """Whether reflectors at some places, (r, 3) mm, tell how a frame is turned: not from one line of them."""
    spread = np.linalg.svd(place - place.mean(axis=0), compute_uv=False)
    return len(place) >= ENOUGH and bool(spread[1] > AS_LINE * spread[0])


def visits_apart(visits: Sequence[np.ndarray]) -> float:
    """How far one visit lies from another, all reflectors alike: a tracker that drifts between them, or is knocked.

    Averaging over reflectors takes nothing of it away, and the poses lie in between, nobody knows where.

    Args:
        visits: (v, 3) mm of each reflector.

    Returns:
        Standard deviation of one coordinate, mm, that all reflectors have in common beyond their own scatter; zero
        where each was visited once.
    """
    moved = [read - read.mean(axis=0) for read in visits if len(read) == max(map(len, visits))]
    count, rounds = len(moved), len(moved[0])
    if rounds < 2 or count < 2:
        return 0.0
    together, freedom = np.mean(moved, axis=0), 3.0 * (rounds - 1)  # shape: (rounds, 3)
    own = float(np.square(np.array(moved) - together).sum()) / (freedom * (count - 1))
    return float(np.sqrt(max(np.square(together).sum() / freedom - own / count, 0.0)))
