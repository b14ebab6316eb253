"""Linear model of ordinary faults of a 3-PTT, bounded so that no set-up mistake fits into it."""

import numpy as np
import torch

from ptt.run.frames import rigid_columns
from ptt.setup.rigid import TRIM, align_many, column_medians
from ptt.setup.score import build
from ptt.setup.setup import Setup, drawn

USUAL = {"homing": 0.5, "lead": 0.1, "joint": 0.5, "link": 0.5, "lean": 0.3, "play": 0.1}
"""Usual sizes, mm; of lead and lean for each 100 mm of travel."""
MOST_TIMES = 3.0  # usual sizes: a larger fault is no ordinary one
ROUGH_TIMES = 10.0  # usual sizes that a machine may well have that was built by hand
LOOSE = 0.02  # mm: residual that counts as much as a fault of usual size, in the ridge regression
TIGHTEN, TRIES = 30.0, 4  # factor by which the ridge grows until all faults are ordinary
WITHIN = 1.2  # ratio to which the weakest such ridge is found


def fault_columns(setup: Setup, place: np.ndarray) -> np.ndarray | None:
    """Displacement of the tool by each fault of usual size.

    Source: s_i . dp = (s_i . rail_i) dq_i + s_i . dc_i + L_i dL_i for each link vector s_i.

    Args:
        setup: the drawing.
        place: tool positions, (m, 3) mm.

    Returns:
        (m, 3, c) mm, zero where the drawing cannot reach; None where it cannot be built.
    """
    mechanism = build(drawn(setup))
    if mechanism is None:
        return None
    slider = mechanism.inverse(torch.as_tensor(place, dtype=torch.float64)).numpy()
    rail, link, foot = (part.numpy() for part in (mechanism.rail, mechanism.link, mechanism.foot))
    vector = place[:, None] - foot - slider[..., None] * rail
    known = np.isfinite(slider).all(axis=1) & (np.abs(np.linalg.det(np.nan_to_num(vector))) > 1.0)
    inverse = np.zeros_like(vector)
    inverse[known] = np.linalg.inv(vector[known])
    along = (vector * rail).sum(axis=2)
    travel = (slider - column_medians(slider)) / 100.0 if known.any() else slider
    sense = np.sign(np.diff(slider, axis=0, prepend=slider[:1]))
    pushes = [along * USUAL["homing"], along * travel * USUAL["lead"], along * sense * USUAL["play"]]
    pushes += [vector[..., axis] * USUAL["joint"] for axis in (0, 1)]
    pushes += [vector[..., axis] * travel * USUAL["lean"] for axis in (0, 1)]
    pushes += [np.broadcast_to(link * USUAL["link"], along.shape)]
    columns = [inverse * np.nan_to_num(push)[:, None] for push in pushes]
    return np.where(known[:, None, None], np.concatenate(columns, axis=2), 0.0)


def left_after_faults(
    place: np.ndarray, reading: np.ndarray, columns: np.ndarray, free: bool, most: float = MOST_TIMES
) -> np.ndarray:
    """Residual distances after a fit of tracker frame and ordinary faults, by ridge regression.

    Args:
        place: (m, 3) mm.
        reading: (m, 3) mm.
        columns: (m, 3, c) mm.
        free: whether the tracker may stand anywhere.
        most: usual sizes that no fault exceeds.

    Returns:
        (m,) mm, NaN where unknown.
    """
    turn, shift, distance = align_many(place[None], reading[None], free)
    left = (reading - shift[0]) @ turn[0] - place
    known = np.isfinite(left).all(axis=1)
    if known.sum() < 4:
        return np.asarray(distance[0])
    kept = known & (np.nan_to_num(distance[0]) <= TRIM * float(column_medians(distance.T)[0]) + 1e-9)
    moves = rigid_columns(torch.as_tensor(np.nan_to_num(place)), length=1e3).numpy()  # by 1 mm, by 1 mrad
    matrix, count = np.concatenate([columns, moves] if free else [columns], axis=2), columns.shape[2]
    rows = matrix[kept].reshape(-1, matrix.shape[2])
    normal, right = rows.T @ rows, rows.T @ left[kept].ravel()
    size = _bounded(normal, right, count, most)
    return np.asarray(np.linalg.norm(left - matrix @ size, axis=1))


def _bounded(normal: np.ndarray, right: np.ndarray, count: int, most: float) -> np.ndarray:
    """Solution of normal equations (u, u) by the weakest ridge that keeps the first `count` unknowns within a bound.

    The weakest, since residuals would else jump where the largest of the faults passes the bound.
    """

    def solved(loose: float) -> np.ndarray:
        penalty = np.r_[np.full(count, loose**2), np.full(len(right) - count, 1e-9)]
        return np.asarray(np.linalg.solve(normal + np.diag(penalty), right))

    loose, size = LOOSE, solved(LOOSE)
    for _ in range(TRIES):
        if np.abs(size[:count]).max(initial=0.0) <= most:
            break
        loose, size = TIGHTEN * loose, solved(TIGHTEN * loose)
    low, high = loose / TIGHTEN, loose
    while loose > LOOSE and high > WITHIN * low:
        middle = np.sqrt(low * high)
        trial = solved(middle)
        fits = np.abs(trial[:count]).max(initial=0.0) <= most
        low, high, size = (low, middle, trial) if fits else (middle, high, size)
    return size
