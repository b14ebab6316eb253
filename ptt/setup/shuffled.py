"""Readings in another order than the poses they belong to: matched by position, not by row."""

from itertools import permutations, product

import numpy as np

from ptt.setup.proof import BEYOND_FAULTS, FALL, STEEP
from ptt.setup.result import Finding
from ptt.setup.rigid import align_many
from ptt.setup.rows import places
from ptt.setup.setup import Setup, used_rows

LEAST_ROWS, LEAST_POSES = 12, 6  # fewer points can be matched by chance
MOST_ROWS = 600  # the assignment costs the cube
ROUNDS = 25  # the iteration converges within a dozen
APART = 5.0  # times the residual: least distance between poses for a match to mean anything
MOVED = 0.2  # least share of rows that change place: a few are gross errors, or a reading that was missed
FAR = 2.0  # times the median distance beyond which a reading is not paired yet
SAME = 1e-3  # mm: matches that differ by less are equally good
UPRIGHT = 0.2  # rad: trackers stand upright, so a match with a larger tilt is taken only where no other fits


def find_shuffled(setup: Setup) -> tuple[list[Finding], Setup]:
    """Readings that were sorted, or joined to the poses in another order.

    Args:
        setup: both files.

    Returns:
        At most one finding, and the files with every reading in the row of its pose.
    """
    used = used_rows(setup.table)
    read = np.flatnonzero(used & np.isfinite(setup.table.measured).all(axis=1))
    if not LEAST_ROWS <= len(read) <= MOST_ROWS:
        return [], setup
    place = places(setup)
    poses = np.flatnonzero(used & np.isfinite(place).all(axis=1))
    both = np.intersect1d(poses, read)
    if not len(read) <= len(poses) <= MOST_ROWS or not len(both):
        return [], setup
    before = _root_mean_square(align_many(place[None, both], setup.table.measured[None, both], setup.free)[2][0])
    if before < BEYOND_FAULTS:
        return [], setup
    if (back := _reversed(setup, before)) is not None:
        return back
    a, b = place[poses], setup.table.measured[read]
    matches = [_match_from(a, b, turn, setup.free) for turn in _starts(a, b, setup.free)]
    after, order, turn = min(matches, key=lambda match: (match[0] > BEYOND_FAULTS, _tilt(match[2]) > UPRIGHT, match[0]))
    if after > min(BEYOND_FAULTS, before / FALL) or _crowded(a, after):
        return [], setup
    moved = np.linalg.norm(a[order] - place[read], axis=1) > APART * max(after, 1e-6)
    if moved.mean() < MOVED:
        return [], setup
    if setup.free:  # a lattice of poses has no principal axes, and lies on itself after quarter turns
        matches += [_match_from(a, b, turn @ quarter, True) for quarter in _axis_rotations(1.0)]
    alone = not any(other[0] < 2.0 * after + SAME and _apart(other[2], turn) for other in matches)
    finding = _tell(setup, before, after, int(moved.sum()), len(read), alone)
    return [finding], _sorted(setup, read, poses[order]) if alone else setup


def _reversed(setup: Setup, before: float) -> tuple[list[Finding], Setup] | None:
    """Readings in reverse order: checked first, for it needs no matching."""
    place, used = places(setup), np.flatnonzero(used_rows(setup.table))
    reading, std = setup.table.measured.copy(), setup.table.std
    reading[used] = reading[used[::-1]]
    distance = align_many(place[None], reading[None], setup.free)[2][0]
    after = _root_mean_square(distance[np.isfinite(distance)])
    if after > min(BEYOND_FAULTS, before / STEEP):
        return None
    words = (
        "the readings are in reverse order; with their order reversed, the error falls "
        f"from {1e3 * before:,.0f} to {1e3 * after:,.0f} um"
    )
    finding = Finding(
        "row-order", words, "reverse the order of the readings", 1e3 * before, 1e3 * after, True, setup.table.source
    )
    if std is not None:
        std = std.copy()
        std[used] = std[used[::-1]]
    return [finding], setup.with_rows(measured=reading, std=std)


def _starts(a: np.ndarray, b: np.ndarray, free: bool) -> list[np.ndarray]:
    """Initial rotations for a matching: identity, and all that align the principal axes of both point sets."""
    if not free:
        return [np.eye(3)]
    own, other = (np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2] for points in (a, b))
    handed = float(np.linalg.det(other.T @ own))
    return [np.eye(3), *(other.T @ lay @ own for lay in _axis_rotations(handed))]


def _axis_rotations(handed: float) -> list[np.ndarray]:
    """The 24 signed permutation matrices (3, 3) whose determinant has the sign of `handed`."""
    lays = [np.diag(signs)[:, order] for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)]
    return [lay for lay in lays if np.linalg.det(lay) * handed > 0.0]


def _match_from(a: np.ndarray, b: np.ndarray, turn: np.ndarray, free: bool) -> tuple[float, np.ndarray, np.ndarray]:
    """Iterated closest points, then an optimal one-to-one assignment: rms (mm), pose index of each reading, rotation.

    Source: Besl and McKay, IEEE PAMI 14(2), 1992.
    """
    from scipy.spatial import cKDTree

    shift, tree = b.mean(axis=0) - turn @ a.mean(axis=0) if free else np.zeros(3), cKDTree(a)
    nearest = np.zeros(len(b), dtype=int)
    for _ in range(ROUNDS):
        last, (apart, nearest) = nearest, tree.query((b - shift) @ turn)
        if (last == nearest).all():
            break
        near = apart <= FAR * np.median(apart) + SAME  # a reading whose pose was missed has none near it
        found, at, _ = align_many(a[nearest[near]][None], b[near][None], free)
        turn, shift = found[0], at[0]
    left = np.linalg.norm((b - shift) @ turn - a[nearest], axis=1)
    if np.median(left) > BEYOND_FAULTS:
        return np.inf, nearest, turn
    cost = np.linalg.norm(((b - shift) @ turn)[:, None] - a[None], axis=2)
    from scipy.optimize import linear_sum_assignment

    order = linear_sum_assignment(cost)[1]
    return _root_mean_square(align_many(a[order][None], b[None], free)[2][0]), order, turn


def _root_mean_square(distance: np.ndarray) -> float:
    """Of distances (m,), mm, without gross errors."""
    near = distance[distance <= 6.0 * np.median(distance) + 1e-9]
    return float(np.sqrt(np.mean(near**2)))


def _tilt(turn: np.ndarray) -> float:
    """Angle of the rotated z axis with z, rad."""
    return float(np.arccos(np.clip(turn[2, 2], -1.0, 1.0)))


def _apart(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two rotations are rival solutions; an upright and a tilted one are not: the upright one is preferred."""
    same = np.trace(one @ other.T) > 1.0 + 2.0 * np.cos(0.1)
    return not same and (_tilt(one) < UPRIGHT) == (_tilt(other) < UPRIGHT)


def _crowded(a: np.ndarray, left: float) -> bool:
    """Whether distinct poses are so close together that any order would match."""
    unique = np.unique(np.round(a, 3), axis=0)
    if len(unique) < LEAST_POSES:
        return True
    from scipy.spatial import cKDTree

    nearest = cKDTree(unique).query(unique, k=2)[0][:, 1]
    return bool(np.median(nearest) < APART * left)


def _tell(setup: Setup, before: float, after: float, moved: int, rows: int, alone: bool) -> Finding:
    words = (
        f"{moved} of {rows} readings are paired with the wrong pose; with each paired with the nearest one, the error "
        f"falls from {1e3 * before:,.0f} to {1e3 * after:,.0f} um: poses and readings are in different orders"
    )
    if not alone:
        words += "; several pairings match equally well, so these readings do not determine the order"
    fix = "join targets and readings by their names or times, or export both in the order of measuring"
    return Finding("row-order", words, fix, 1e3 * before, 1e3 * after, True, setup.table.source)


def _sorted(setup: Setup, read: np.ndarray, row: np.ndarray) -> Setup:
    """Every reading moved to the row of its pose; poses keep their order, which is the travel order."""

    def moved(values: np.ndarray) -> np.ndarray:
        other = values.copy()
        other[read] = np.nan
        other[row] = values[read]
        return other

    std = setup.table.std
    return setup.with_rows(measured=moved(setup.table.measured), std=None if std is None else moved(std))
