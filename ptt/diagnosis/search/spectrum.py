"""Least-squares spectrum (Lomb-Scargle) of residuals over a joint's travel or over time."""

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
    """Sums of m rows for waves along one joint.

    Attributes:
        joint: the joint, from 0.
        q: its position, (m,) mm or rad.
        slope: scalar product of each row's residual with the joint's shift of the reading, (m,).
        weight: squared length of the joint's shift of the reading, (m,).
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
        """Sums of squares explained by waves of evenly spaced frequencies, (count,); arguments as of `squares_over`."""
        return squares_over(self.q, self.slope, self.weight, first, step, count)


def squares_over(
    along: np.ndarray, slope: np.ndarray, weight: np.ndarray, first: float, step: float, count: int
) -> np.ndarray:
    """Sums of squares explained by a cosine and a sine of each of evenly spaced frequencies, (count,).

    Each frequency is a coarse step plus a fine one, so all waves are products of two, and the sums one matrix product.

    Args:
        along: the variable of the waves, (m,).
        slope: scalar product of each row's residual with what the wave multiplies, (m,).
        weight: squared length of what the wave multiplies, (m,).
        first: frequency, in turns over the range.
        step: between two, likewise.
        count: of them.
    """
    phase, fine = 2.0 * np.pi * (along - along.min()) / float(np.ptp(along)), int(np.ceil(np.sqrt(count)))
    near = np.exp(1j * step * phase[:, None] * np.arange(fine))
    far = np.exp(1j * phase[:, None] * (first + step * fine * np.arange(-(-count // fine))))
    one = ((far * slope[:, None]).T @ near).ravel()[:count]
    two = ((far**2 * weight[:, None]).T @ near**2).ravel()[:count]
    # Sums of cos^2, sin^2 and cos sin follow from waves of twice the frequency.
    cc, ss, cs = 0.5 * (weight.sum() + two.real), 0.5 * (weight.sum() - two.real), 0.5 * two.imag
    a, b = one.real, one.imag
    whole = cc * ss - cs**2
    seen = whole > WAVE_ROUNDING * (cc + ss) ** 2  # at even steps, a wave of two steps' length has no sine
    gain = (a * a * ss - 2.0 * a * b * cs + b * b * cc) / np.where(seen, whole, 1.0)
    return np.where(seen, gain, 0.0)


def hides_waves(scorer: Scorer, state: State) -> bool:
    """Whether a set has no blocks but a curve with fine detail, which may have absorbed a wave."""
    return all(scorer.system.atoms[key].block is None for key in state.keys) and bool(_detail(scorer, state).any())


def left_along(scorer: Scorer, state: State, problem: Problem, *, detail: bool) -> list[JointWave]:
    """Residuals of a set as seen by each joint that moves.

    Args:
        scorer: of the system.
        state: the set.
        problem: n rows.
        detail: whether to leave the fine detail of the set's curves in the residuals.
    """
    system = rows_of(scorer.system)
    shown = np.where(detail & _detail(scorer, state), 0.0, state.posterior.values)
    white = system.innovation(state.columns, shown, state.memory)
    weight = _pose_weight(system, state.memory.pose)
    found = []
    for joint, column in system.levers.items():
        slope = innovations(column, state.memory.wander, system.clock)[0]
        q = problem.view.q.numpy()[system.rows, joint]
        if np.ptp(q) > 0.0:
            found.append(
                JointWave(joint, q, weight * (slope * white).sum(axis=1), weight * np.square(slope).sum(axis=1))
            )
    return found


def place_line(system: RowSystem, state: State, along: np.ndarray, levers: np.ndarray, turns: float) -> float:
    """Frequency near a spectral line at which a wave explains most, the set's values being refitted beside it.

    The spectrum is of residuals, from which frames and effects have taken part of the wave; with few poses that shifts
    its peak.

    Args:
        system: the linearised problem.
        state: the set.
        along: the variable of the wave, (m,).
        levers: shifts of each reading that the wave multiplies, (m, 3, w) whitened.
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


def _pose_weight(system: RowSystem, pose: float) -> np.ndarray:
    """Weight of each row, (m,), where poses have random errors of variance v: 1 / (1 + k v) with k visits.

    A wave is the same at all visits of a pose, and the inverse of I + v 1 1^T maps the vector 1 to 1 / (1 + k v).
    """
    weight = np.empty(len(system.rows))
    weight[system.poses.order] = np.repeat(1.0 / (1.0 + pose * system.poses.visits), system.poses.visits)
    return weight
