"""Periods that nobody foretold: lines in the spectrum of what an explanation leaves, over each joint's own travel."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.atoms import odds_of_block
from ptt.diagnosis.row_system import RowSystem
from ptt.diagnosis.score import Scorer
from ptt.diagnosis.state import State
from ptt.diagnosis.wander import innovations
from ptt.run.problem import Problem

COARSEST, FINEST = 8.0, 300.0  # periods in the range of a joint: slower ones are curves, finer ones need too many rows
FEWEST = 40  # rows from which a spectrum says anything
WIDE = 1.0  # half of a line, in turns over the range
STEP = 0.25  # of a frequency, in turns over the range: finer than a line is wide


@dataclass(frozen=True)
class Period:
    """A line in the spectrum.

    Attributes:
        joint: whose travel it runs over, from 0.
        length: of one period, mm or rad.
    """

    joint: int
    length: float


def find_period(
    scorer: Scorer, state: State, problem: Problem, offered: Sequence[tuple[int, float]] = ()
) -> Period | None:
    """The strongest line that is worth its price and has not been offered to a search yet.

    The fine detail of a curve can do a wave's work, so where names alone would be said it is first looked for with that
    put back.

    Args:
        scorer: of the system.
        state: the best set so far.
        problem: n rows.
        offered: joint and length of each period that the state could have taken.

    Returns:
        The period; None where none is significant.
    """
    system = scorer.system
    assert isinstance(system, RowSystem)
    if len(system.rows) < FEWEST:
        return None
    hides = not offered and all(system.atoms[key].block is None for key in state.keys)
    shown = np.where(hides & _detail(scorer, state), 0.0, state.posterior.values)
    white = system.innovation(state.columns, shown, state.memory)
    telling = _telling(system, state.memory.pose)
    best, found = 0.0, None
    for joint, column in system.levers.items():
        slope = innovations(column, state.memory.wander, system.clock)[0]
        q = problem.view.q.numpy()[system.rows, joint]
        frequency, gain = _spectrum(slope, white, q, telling)
        if not len(gain):
            continue
        nats = 0.5 * gain / state.posterior.phi - odds_of_block(len(system.levers) * len(frequency))
        for length in (length for other, length in offered if other == joint):
            nats[np.abs(frequency - 1.0 / length) * np.ptp(q) < WIDE] = -np.inf
        if nats.max() > best:
            best, found = float(nats.max()), Period(joint, float(1.0 / frequency[int(np.argmax(nats))]))
    return found


def _detail(scorer: Scorer, state: State) -> np.ndarray:
    """Which columns of a set are fine detail of a curve, (c,) bool."""
    detail = np.zeros(len(state.columns), dtype=bool)
    for key in state.keys:
        atom = scorer.system.atoms[key]
        if atom.fine is not None:
            detail[state.of(key)] = atom.fine[atom.group]
    return detail


def _telling(system: RowSystem, pose: float) -> np.ndarray:
    """What a row tells where poses have errors of some variance to themselves, which no further visit averages, (m,).

    A wave is the same at all k visits of a pose: the inverse of I + v 1 1^T takes 1 to 1 / (1 + k v).
    """
    told = np.empty(len(system.rows))
    told[system.poses.order] = np.repeat(1.0 / (1.0 + pose * system.poses.visits), system.poses.visits)
    return told


def _spectrum(slope: np.ndarray, left: np.ndarray, q: np.ndarray, telling: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies, and the sum of squares that a cosine and a sine of each take."""
    span = float(np.ptp(q))
    most = min(FINEST, len(q) / 2.0)  # as many phases as readings would fit anything
    if span <= 0.0 or most <= COARSEST:
        return np.zeros(0), np.zeros(0)
    frequency = np.arange(COARSEST, most, STEP) / span
    along, weight = telling * (slope * left).sum(axis=1), telling * np.square(slope).sum(axis=1)
    one, two = _waves(2.0 * np.pi * (q - q.min()) / span, (along, weight), len(frequency))
    # Of cosine^2, sine^2 and their product, the waves of twice the frequency tell all.
    cc, ss, cs = 0.5 * (weight.sum() + two.real), 0.5 * (weight.sum() - two.real), 0.5 * two.imag
    a, b = one.real, one.imag
    whole = np.maximum(cc * ss - cs**2, 1e-12 * cc * ss + 1e-300)
    return frequency, (a * a * ss - 2.0 * a * b * cs + b * b * cc) / whole


def _waves(phase: np.ndarray, values: tuple[np.ndarray, np.ndarray], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums over rows of v exp(i f phase) and of w exp(2 i f phase) at the frequencies f of a spectrum, (count,) each.

    A frequency is a coarse step and fine ones, so all their waves are products of two, and the sums one of matrices.
    """
    fine = int(np.ceil(np.sqrt(count)))
    near = np.exp(1j * STEP * phase[:, None] * np.arange(fine))
    far = np.exp(1j * phase[:, None] * (COARSEST + STEP * fine * np.arange(-(-count // fine))))
    one, two = values
    return ((far * one[:, None]).T @ near).ravel()[:count], ((far**2 * two[:, None]).T @ near**2).ravel()[:count]
