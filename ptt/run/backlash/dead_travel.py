"""Dead travel of one slider after one reversal, from a scale read beside its motor.

Equation 19: Chen et al., Trans. CSAM 54(2), 2023.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ptt.errors import TableError

Array = NDArray[np.float64]

EVEN_STEPS = 0.05  # steps of the motor that differ by less pass for constant speed


@dataclass(frozen=True)
class ReversalPass:
    """One pass forward and back.

    Attributes:
        samples: (3,) data lengths S1 (forward), S2 (dead travel), S3 (turning back, dead travel included).
        travel: u p, the motor's travel forward, mm.
        counts: (2,) scale counts S1, S3 moved forward and back over the same stretch of command.
        by_forward: e_j1 = u p S2 / S1, mm.
        by_back: e_j2 = u p S2 / S3, mm.
        by_counts: |S1 - S3| x resolution, mm.
        step: motor travel per sample, mm.
        noise: jitter of the scale beyond its counts, standard deviation, mm.
        constant_speed: whether the steps are even to 5 %, which the data lengths rely on.
    """

    samples: tuple[float, float, float]
    travel: float
    counts: tuple[float, float]
    by_forward: float
    by_back: float
    by_counts: float
    step: float
    noise: float
    constant_speed: bool


def measure_reversal(
    command: Array, scale: Array, resolution: float, phase: NDArray[np.str_] | None = None, where: str = ""
) -> ReversalPass:
    """Dead travel of one pass forward and back, by data length and by counts (eq. 19).

    Args:
        command: (m,) motor travel, mm, sampled at a constant rate.
        scale: (m,) readings, mm.
        resolution: one count of the scale, mm.
        phase: (m,) marks 'S1', 'S2', 'S3' where the dead travel has been marked already.
        where: what to name in an error.

    Returns:
        Both figures and what they came from.

    Raises:
        TableError: no reversal, more than one, or none that the scale follows.
    """
    moving = _advancing(command)
    command, scale, phase = command[moving], scale[moving], None if phase is None else phase[moving]
    turn = turning_row(command) if phase is None else int(np.count_nonzero(phase == "S1")) - 1
    after = len(command) - 1 - turn
    if min(turn, after) < 2:
        raise TableError("no reversal in one of its cycles", where=where, fix="log travel in both directions")
    # Forward is positive from here on, for the motor and for the scale, whichever way round it is mounted.
    command = np.sign(command[turn] - command[0]) * (command - command[0])
    scale = np.sign(scale[turn] - scale[0]) * (scale - scale[0])
    _check_single_turn(command, turn, where)
    step = float(command[turn] / turn)
    noise = _jitter(command[: turn + 1], scale[: turn + 1], resolution)
    tolerance = (np.ceil(4.0 * noise / resolution) + 0.5) * resolution
    if phase is None:
        dead = _dead_length(scale[turn:], tolerance, step, where)
    else:
        dead = float(np.count_nonzero(phase == "S2")) + 0.5
    counts = _common_travel(command, scale, turn, tolerance)
    steps = np.delete(np.abs(np.diff(command)), [turn - 1, turn])  # the turn itself may fall between two samples
    return ReversalPass(
        samples=(float(turn), dead, float(after)),
        travel=float(command[turn]),
        counts=(round(counts[0] / resolution, 3), round(counts[1] / resolution, 3)),
        by_forward=float(command[turn]) * dead / turn,
        by_back=float(command[turn] - command[-1]) * dead / after,
        by_counts=abs(counts[0] - counts[1]),
        step=step,
        noise=noise,
        constant_speed=bool(np.max(np.abs(steps / np.median(steps) - 1.0)) <= EVEN_STEPS),
    )


def turning_row(command: Array) -> int:
    """Index of the stroke's end: the first row farthest from where the pass began.

    Args:
        command: (m,) motor travel, mm.

    Returns:
        Row index.
    """
    return int(np.argmax(np.abs(command - command[0])))


def _advancing(command: Array) -> NDArray[np.bool_]:
    """Rows (m,) that the motor moved to; a dwell holds no data length."""
    steps = np.abs(np.diff(command))
    usual = np.median(steps[steps > 0.0]) if np.any(steps > 0.0) else 0.0
    return np.concatenate([[True], steps > 0.01 * usual])


def _check_single_turn(command: Array, turn: int, where: str) -> None:
    """Refuse a pass whose motor turns back more than once."""
    astray = np.sum(np.maximum(-np.diff(command[: turn + 1]), 0.0)) + np.sum(np.maximum(np.diff(command[turn:]), 0.0))
    if astray > 0.01 * command[turn]:
        fix = "number the forward-and-back passes in a column cycle"
        raise TableError("the motor reverses more than once in a cycle", where=where, fix=fix)


def _jitter(command: Array, scale: Array, resolution: float) -> float:
    """Standard deviation of the scale beyond its counts, mm, on the way forward once the gap is taken up."""
    half = len(command) // 2
    steps = np.diff((scale - command)[half:])  # differences, so that screw errors of long period do not enter
    return float(np.sqrt(max(0.0, 0.5 * float(np.var(steps)) - resolution**2 / 12.0)))


def _dead_length(scale: Array, tolerance: float, step: float, where: str) -> float:
    """Data length S2 for which the scale stands still after the turn, in samples.

    The scale stands until it has left its level by `tolerance`, which the motor needs tolerance / step samples for;
    the edge lies between the last sample that stands and the first that does not, hence the half.
    """
    level = scale[0]
    for _ in range(2):  # the second time about the mean of the samples that stand, not about one of them
        away = level - scale > tolerance
        if not away[-1]:
            fix = "turn back by more than the dead travel"
            raise TableError("the scale does not move after the reversal", where=where, fix=fix)
        standing = int(np.flatnonzero(~away)[-1]) if not away.all() else 0
        level = float(np.mean(scale[: standing + 1]))
    return max(0.0, standing + 0.5 - tolerance / step)


def _common_travel(command: Array, scale: Array, turn: int, tolerance: float) -> tuple[float, float]:
    """Scale travel (S1, S3), mm, forward and back over the stretch of command that both branches share.

    A pass that begins inside the gap, the scale standing at first, shares the stretch after that only.
    """
    first = int(np.argmax(scale > tolerance))
    start = max(command[first], command[-1])
    forward = np.interp(start, command[: turn + 1], scale[: turn + 1])
    back = np.interp(start, command[turn:][::-1], scale[turn:][::-1])
    return float(scale[turn] - forward), float(scale[turn] - back)
