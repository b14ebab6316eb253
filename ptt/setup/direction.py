"""Stated directions of arrival (dir1..) with the opposite sign, by the moves between commands and by backlash."""

import numpy as np
import torch

from ptt.run.direction import STANDSTILL
from ptt.setup.columns import said
from ptt.setup.result import Finding
from ptt.setup.rigid import TRIM, align_many
from ptt.setup.rows import places
from ptt.setup.score import build
from ptt.setup.setup import Setup, drawn, used_rows

LEAST_MOVES = 20  # of a joint with a stated direction
BOTH = 0.2  # least share of moves in each direction: a joint that always arrives from one side overtravels
NEARLY_ALL = 0.9  # least share of stated directions against the moves: overtravel at some rows explains fewer
SEEN_SIGMAS = 5.0  # standard errors of the lag behind the stated direction


def find_directions(setup: Setup) -> tuple[list[Finding], Setup]:
    """Directions that are stated opposite to the moves between the commands, row by row.

    Args:
        setup: both files, the geometry in order.

    Returns:
        At most one finding, and the files with the directions turned round.
    """
    stated, joint = setup.table.direction, _joint_values(setup)
    if stated is None or joint is None:
        return [], setup
    moved = _moves(setup, joint)
    known = np.isfinite(stated) & np.isfinite(moved) & (np.abs(moved) > STANDSTILL)
    against = known & (np.sign(moved) != stated)
    lag = [
        _lag(setup, joint, number) if _is_opposite(stated[known[:, number], number], against[known[:, number], number])
        else np.inf
        for number in range(stated.shape[1])
    ]  # fmt: skip
    wrong = [number for number, each in enumerate(lag) if each < SEEN_SIGMAS]
    if not wrong:
        return [], setup
    titles = ", ".join(f"dir{number + 1}" for number in wrong)
    first = setup.table.line[np.flatnonzero(against[:, wrong].any(axis=1))[0]]
    words = (
        f"{against[:, wrong].sum()} of {known[:, wrong].sum()} directions in {titles} are opposite to the move from "
        f"the row before, the first in row {first}"
    )
    fix = f"write {titles} with the other sign (+1: the command increased), or leave them out: the rows show it anyway"
    # Without backlash in the readings, a machine that overtravels in every move would look the same.
    sure = all(lag[number] < -SEEN_SIGMAS for number in wrong)
    turned = stated.copy()
    turned[:, wrong] *= -1.0
    return [said(setup, "direction-sign", words, fix, sure)], setup.with_rows(direction=turned)


def _is_opposite(stated: np.ndarray, against: np.ndarray) -> bool:
    """Whether stated directions of one joint, (m,), are opposite to nearly all of its moves, in both directions."""
    if len(stated) < LEAST_MOVES or against.mean() < NEARLY_ALL:
        return False
    return bool(BOTH <= (stated > 0.0).mean() <= 1.0 - BOTH)


def _joint_values(setup: Setup) -> np.ndarray | None:
    """Commands, (n, k), or what the drawing makes of the targets; None where neither is known."""
    if setup.table.command is not None:
        return setup.table.command
    mechanism = build(drawn(setup)) if setup.table.joint_prefix == "b" else None
    return None if mechanism is None else mechanism.inverse(torch.as_tensor(setup.table.target)).numpy()


def _moves(setup: Setup, joint: np.ndarray) -> np.ndarray:
    """Move of each joint from the row before in its run, (n, k); NaN at first rows and where either is unknown."""
    moved, run = np.full(joint.shape, np.nan), setup.table.run
    rows = np.flatnonzero(used_rows(setup.table))
    moved[rows[1:]] = np.where((run[rows[1:]] == run[rows[:-1]])[:, None], np.diff(joint[rows], axis=0), np.nan)
    return moved


def _lag(setup: Setup, joint: np.ndarray, number: int) -> float:
    """Lag of a slider behind the stated direction in standard errors, as backlash and wind-up cause it.

    Positive: the stated direction is that of arrival; negative: it is the opposite one. Zero: undetermined.
    """
    mechanism = build(drawn(setup)) if setup.table.joint_prefix == "b" else None
    if mechanism is None or setup.table.direction is None:
        return 0.0
    place, reading = places(setup), setup.table.measured
    turn, shift, distance = align_many(place[None], reading[None], setup.free)
    near = torch.as_tensor((reading - shift[0]) @ turn[0])
    error = mechanism.inverse(near).numpy()[:, number] - mechanism.inverse(torch.as_tensor(place)).numpy()[:, number]
    columns = np.column_stack([_smooth(joint), np.nan_to_num(setup.table.direction)])
    known = np.isfinite(columns).all(axis=1) & np.isfinite(error)
    known &= np.nan_to_num(distance[0], nan=np.inf) <= TRIM * np.nanmedian(distance[0])
    freedom = known.sum() - columns.shape[1]
    if freedom < LEAST_MOVES:
        return 0.0
    at = columns.shape[1] - setup.table.direction.shape[1] + number
    inverse = np.linalg.pinv(columns[known].T @ columns[known])
    size = inverse @ columns[known].T @ error[known]
    scatter = np.sqrt(np.square(error[known] - columns[known] @ size).sum() / freedom * inverse[at, at])
    return float(-size[at] / max(scatter, np.finfo(float).tiny))


def _smooth(joint: np.ndarray) -> np.ndarray:
    """Polynomial of second order in the joint values, (n, c), for errors that do not depend on direction."""
    spread = np.nanstd(joint, axis=0) + STANDSTILL
    part = (joint - np.nanmean(joint, axis=0)) / spread
    one, other = np.triu_indices(joint.shape[1])
    return np.column_stack([np.ones(len(joint)), part, part[:, one] * part[:, other]])
