"""Spectrum of what an explanation leaves, over each joint's own travel."""

from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.row_sums import flattened
from ptt.diagnosis.evidence.row_system import RowSystem, rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.wander import filtered, innovations
from ptt.diagnosis.unknown.smooth import harmonics
from ptt.run.problem import Problem

# Relative determinant below which only one phase of a wave is seen by the readings, up to rounding
WAVE_ROUNDING = 1e-6
LINE_HALF_WIDTH = 1.0  # half width of a spectral line, in turns over the range
FREQUENCY_STEP = 0.25  # of the spectrum, in turns over the range: finer than a line is wide
LINE_PLACES = 17  # frequencies tried across a line, then finer about the best: a misplaced line leaves another one


@dataclass(frozen=True)
class JointWave:
    """What m rows say of a wave along one joint.

    Attributes:
        joint: whose travel it runs over, from 0.
        q: where it stood, (m,) mm or rad.
        slope: of what is left by the joint, (m,).
        weight: how much a row tells of it, (m,).
    """

    joint: int
    q: np.ndarray
    slope: np.ndarray
    weight: np.ndarray

    @property
    def span(self) -> float:
        """Range of the travel, mm or rad."""
        return float(np.ptp(self.q))

    def over(self, first: float, step: float, count: int) -> np.ndarray:
        """Sums of squares that waves of evenly spaced frequencies take, (count,); arguments as of `squares_over`."""
        return squares_over(self.q, self.slope, self.weight, first, step, count)


def squares_over(
    along: np.ndarray, slope: np.ndarray, weight: np.ndarray, first: float, step: float, count: int
) -> np.ndarray:
    """Sums of squares that a cosine and a sine of each of evenly spaced frequencies take, (count,).

    A frequency is a coarse step and fine ones, so all their waves are products of two, and the sums one of matrices.

    Args:
        along: what the waves run over, (m,).
        slope: of what is left by them, (m,).
        weight: how much a row tells of them, (m,).
        first: frequency, in turns over the range.
        step: between two, likewise.
        count: of them.
    """
    phase, fine = 2.0 * np.pi * (along - along.min()) / float(np.ptp(along)), int(np.ceil(np.sqrt(count)))
    near = np.exp(1j * step * phase[:, None] * np.arange(fine))
    far = np.exp(1j * phase[:, None] * (first + step * fine * np.arange(-(-count // fine))))
    one = ((far * slope[:, None]).T @ near).ravel()[:count]
    two = ((far**2 * weight[:, None]).T @ near**2).ravel()[:count]
    # Of cosine^2, sine^2 and their product, the waves of twice the frequency tell all.
    cc, ss, cs = 0.5 * (weight.sum() + two.real), 0.5 * (weight.sum() - two.real), 0.5 * two.imag
    a, b = one.real, one.imag
    whole = cc * ss - cs**2
    seen = whole > WAVE_ROUNDING * (cc + ss) ** 2  # at even steps a wave of two steps has a cosine and no sine
    gain = (a * a * ss - 2.0 * a * b * cs + b * b * cc) / np.where(seen, whole, 1.0)
    return np.where(seen, gain, 0.0)


def hides_waves(scorer: Scorer, state: State) -> bool:
    """Whether names alone would be said: the fine detail of a curve among them may do a wave's work."""
    return all(scorer.system.atoms[key].block is None for key in state.keys) and bool(_detail(scorer, state).any())


def left_along(scorer: Scorer, state: State, problem: Problem, *, detail: bool) -> list[JointWave]:
    """What an explanation leaves along each joint that moves.

    Args:
        scorer: of the system.
        state: the explanation.
        problem: n rows.
        detail: leave the fine detail of its curves as well.
    """
    system = rows_of(scorer.system)
    shown = np.where(detail & _detail(scorer, state), 0.0, state.posterior.values)
    white = system.innovation(state.columns, shown, state.memory)
    telling = _telling(system, state.memory.pose)
    found = []
    for joint, column in system.levers.items():
        slope = innovations(column, state.memory.wander, system.clock)[0]
        q = problem.view.q.numpy()[system.rows, joint]
        if np.ptp(q) > 0.0:
            found.append(
                JointWave(joint, q, telling * (slope * white).sum(axis=1), telling * np.square(slope).sum(axis=1))
            )
    return found


def place_line(system: RowSystem, state: State, along: np.ndarray, levers: np.ndarray, turns: float) -> float:
    """Frequency near that of a line at which a wave takes most beside an explanation, whose values follow it.

    A spectrum has what the explanation leaves, a part of which frames and effects took of the wave already; on few
    poses that moves its peak.

    Args:
        system: the linearised problem.
        state: the explanation.
        along: what the wave runs over, (m,).
        levers: how what it acts on moves each reading, (m, 3, w) whitened.
        turns: frequency of the line, in turns over the range.

    Returns:
        The frequency, likewise.
    """
    phase, clock = (2.0 * np.pi / np.ptp(along) * (along - along.min()))[:, None], system.clock
    known = flattened(filtered(system.flat[state.columns], state.memory.wander, clock)[0])
    white = system.innovation(state.columns, state.posterior.values, state.memory).T.ravel()
    for width in (LINE_HALF_WIDTH, 2.0 * LINE_HALF_WIDTH / LINE_PLACES):
        near = turns + np.linspace(-width, width, LINE_PLACES)
        waves = np.stack([harmonics(each) for each in (phase * near).T])  # shape: (place, row, wave)
        columns = np.einsum("rad,prw->pdwar", levers, waves)
        wave = flattened(filtered(columns.reshape(-1, *columns.shape[3:]), state.memory.wander, clock)[0])
        wave = wave.reshape(LINE_PLACES, -1, len(white))
        beside = wave @ known.T
        gram = wave @ wave.transpose(0, 2, 1) - beside @ state.inverse @ beside.transpose(0, 2, 1)
        gain = [
            one @ np.linalg.lstsq(own, one, rcond=WAVE_ROUNDING)[0] for own, one in zip(gram, wave @ white, strict=True)
        ]
        turns = float(near[np.argmax(gain)])
    return turns


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
