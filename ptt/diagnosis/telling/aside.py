"""Whether readings set aside as gross errors have a common cause: one joint's direction, its arrival, or one place."""

from collections.abc import Iterator

import numpy as np

from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.noise.gross import common_place
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.unknown.places import places_of_chain
from ptt.run.problem import Problem
from ptt.run.tails import chi2_sf, f_sf

LEAST_GROSS = 5  # readings set aside from which a common direction can be told
LEAST_SPARE = 6  # degrees of freedom beyond what is fitted to them, with which a test means anything
COSINE_MEAN, COSINE_VARIANCE = 1.0 / 3.0, 4.0 / 45.0  # of the squared cosine between a fixed direction and random ones
JOINT_CHANCE = 1e-4  # p-value below which gross errors lie along a joint's direction, or change sign with its arrival
DIRECTION_CHANCE = 0.01  # chance that one direction common to all errors lies so near to that of any joint
MOSTLY_ALONG = 0.8  # mean squared cosine from which the errors are along a joint's direction
CLOSER_SHARE = 0.5  # share of what one fixed direction misses that a joint's may miss: trackers err along their beam


def against_gross(found: Found, problem: Problem) -> str | None:
    """What the readings set aside have in common, in words; real gross errors have nothing in common.

    Args:
        found: the best explanation.
        problem: the readings.

    Returns:
        None where they have nothing in common, where they are few, or for a long run.
    """
    if (place := common_direction(found, problem)) is not None:
        return f"are all displaced in the direction in which {place} moves the tool"
    if follow_direction(found, problem):
        return "change sign with the direction of arrival"
    if isinstance(found.system, RowSystem):
        return common_place(found.gross, found.fitted.residual, problem)
    return None


def follow_direction(found: Found, problem: Problem) -> bool:
    """Whether the errors of readings set aside depend on the directions in which the joints arrived.

    A joint that sticks just after a reversal sticks the other way on the way back, while a beam breaks whichever way
    the joints came. F test of nested linear models: constant shifts of the reading and of each joint, with and without
    terms in the directions of arrival. Errors are scaled to length one, since broken beams err by any length.

    Args:
        found: the best explanation.
        problem: the readings.

    Returns:
        False also where they are few.
    """
    system, left = found.system, found.fitted.residual
    if not isinstance(system, RowSystem):
        return False
    rows = np.flatnonzero(found.gross & np.isfinite(left).all(axis=1))
    places = [place for place in places_of_chain(problem, system.at.chain) if place.kind in ("slider", "joint")]
    ways = {place.joint: place.slopes[rows, :, 0] for place in places}
    direction, spare = problem.view.direction.numpy()[rows], 3 * len(rows) - 3 - 2 * len(ways)
    if spare < LEAST_SPARE:
        return False
    error = (left[rows] / np.maximum(np.linalg.norm(left[rows], axis=1), 1e-12)[:, None]).ravel()
    shifts = [np.tile(np.eye(3), (len(rows), 1)), *(way.reshape(-1, 1) for way in ways.values())]
    turns = [(way * direction[:, joint, None]).reshape(-1, 1) for joint, way in ways.items()]
    less, rest = (_residual_square(error, np.hstack(columns)) for columns in (shifts, shifts + turns))
    gained = (less - rest) / len(ways) / max(rest / spare, 1e-12)
    return bool(f_sf(gained, len(ways), spare) < JOINT_CHANCE)


def _residual_square(values: np.ndarray, columns: np.ndarray) -> float:
    """Residual sum of squares of values (m,) regressed on columns (m, p)."""
    return float(np.square(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]).sum())


def common_direction(found: Found, problem: Problem) -> str | None:
    """The joint along whose direction the readings set aside are off.

    Broken beams err in all directions, or always in the same one. A joint that sticks or jumps errs in the direction in
    which it moves the tool, which turns from pose to pose. Where it hardly turns, the fixed direction common to all
    errors has to lie closer to it than by accident.

    Args:
        found: the best explanation.
        problem: the readings.

    Returns:
        The joint, as 'slider 2'; None where there is none, where errors are few, or for a long run.
    """
    system, left = found.system, found.fitted.residual
    if not isinstance(system, RowSystem):
        return None
    rows = np.flatnonzero(found.gross & np.isfinite(left).all(axis=1))
    if len(rows) < LEAST_GROSS:
        return None
    error = left[rows] / np.maximum(np.linalg.norm(left[rows], axis=1), 1e-12)[:, None]
    shares = dict(_shares(system, problem, rows, error))
    if not shares:
        return None
    place = max(shares, key=lambda name: shares[name])
    fixed = float(np.linalg.eigvalsh(error.T @ error)[-1]) / len(
        rows
    )  # mean squared cosine to the best fixed direction
    beyond = max(shares[place] - COSINE_MEAN, 0.0) ** 2 * len(rows) / COSINE_VARIANCE
    turns = shares[place] > MOSTLY_ALONG and 1.0 - shares[place] < CLOSER_SHARE * (1.0 - fixed)
    theirs = turns or len(shares) * (1.0 - np.sqrt(shares[place])) < DIRECTION_CHANCE
    return place if theirs and chi2_sf(beyond, 1) * len(shares) < JOINT_CHANCE else None


def _shares(system: RowSystem, problem: Problem, rows: np.ndarray, error: np.ndarray) -> Iterator[tuple[str, float]]:
    """Name of each joint, and mean squared cosine between errors (m, 3) of length one and its motion of the tool."""
    for place in places_of_chain(problem, system.at.chain):
        if place.kind not in ("slider", "joint"):
            continue  # links move the tool in the same directions, and rails across them
        way = place.slopes[rows, :, 0]
        cosine = (error * way).sum(axis=1) / np.maximum(np.linalg.norm(way, axis=1), 1e-12)
        yield place.residual, float(np.square(cosine).mean())
