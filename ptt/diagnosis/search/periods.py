"""Unstated periods: lines in the residual's spectrum over each joint's own travel."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.atoms import is_field, odds_of_block
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.search.spectrum import (
    FREQUENCY_STEP,
    LINE_HALF_WIDTH,
    JointWave,
    hides_waves,
    left_along,
    place_line,
)
from ptt.diagnosis.unknown.block import Period
from ptt.effects.screw import OncePerRev
from ptt.run.problem import Problem

# Periods in the range of a joint: slower waves are curves; the finest are those of an encoder's scale, below 0.5 mm
FEWEST_PERIODS, MOST_PERIODS = 8.0, 1000.0
# Highest frequency in turns per reading: random poses tell them apart; of aliases the slowest counts
TURNS_PER_ROW = 2.0
ALIAS_NATS = 0.5  # nats by which a slower line may be behind its alias and still be taken
SPECTRUM_ROWS = 40  # rows from which a spectrum says anything


@dataclass(frozen=True)
class Line:
    """A line in a spectrum.

    Attributes:
        period: joint (None: time) and length.
        nats: what a wave of that period explains beyond its prior odds.
    """

    period: Period
    nats: float


def find_period(
    scorer: Scorer,
    state: State,
    problem: Problem,
    offered: Sequence[Period] = (),
    waves: Sequence[OncePerRev] = (),
) -> Line | None:
    """The strongest line that is worth its prior odds and was not among the atoms yet.

    Args:
        scorer: of the system.
        state: the best set so far.
        problem: n rows.
        offered: joint (None: time) and length of each period that was among the atoms already.
        waves: harmonics that are offered as named effects on all joints, which a search judges first.

    Returns:
        The line; None where none is significant.
    """
    system = rows_of(scorer.system)
    if len(system.rows) < SPECTRUM_ROWS:
        return None
    best, found = 0.0, list[tuple[JointWave, float]]()
    joints = left_along(scorer, state, problem, detail=not offered and hides_waves(scorer, state))
    named = [wave.period(problem.view) for wave in waves]
    for along in joints:
        turns, gain = _spectrum(along)
        if not len(turns):
            continue
        nats = 0.5 * gain / state.posterior.phi - odds_of_block(len(joints) * len(turns))
        for length in (*named, *(length for joint, length in offered if joint == along.joint)):
            nats[np.abs(turns - along.span / length) < LINE_HALF_WIDTH] = -np.inf
        if nats.max() > best:
            best, found = float(nats.max()), [(along, float(turns[np.argmax(nats > nats.max() - ALIAS_NATS)]))]
    for along, first in found:
        lever = system.levers[along.joint][:, :, None]
        return Line((along.joint, along.span / place_line(system, state, along.q, lever, first)), best)
    return None


def free_in_place(state: State, system: System) -> tuple[str, ...]:
    """Keys of a set's unknowns of joints that are free functions of position: curves over travel, fields.

    Args:
        state: a set.
        system: of the scorer.
    """
    blocks = {key: block for key in state.keys if (block := system.atoms[key].block) is not None}
    own = {key: block for key, block in blocks.items() if block.place.joint is not None}
    return tuple(key for key, block in own.items() if block.is_curve or is_field(system.atoms[key]))


def _spectrum(along: JointWave) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in turns over the range, (f,), and the sum of squares that a wave of each explains, (f,)."""
    turns = np.arange(FEWEST_PERIODS, min(MOST_PERIODS, TURNS_PER_ROW * len(along.q)), FREQUENCY_STEP)
    return turns, along.over(FEWEST_PERIODS, FREQUENCY_STEP, len(turns)) if len(turns) else turns
