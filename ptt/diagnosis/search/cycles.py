"""Cycles over time: a line in the spectrum of the residual, as a compressor or an air conditioner makes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.atoms import odds_of_block
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.search.periods import SPECTRUM_ROWS, Line, find_period, free_in_place
from ptt.diagnosis.search.spectrum import FREQUENCY_STEP, left_along, place_line, squares_over
from ptt.diagnosis.unknown.block import Period
from ptt.diagnosis.unknown.smooth import harmonics
from ptt.effects.screw import OncePerRev
from ptt.run.problem import Problem

FEWEST_CYCLES, MOST_CYCLES = 3.0, 300.0  # cycles in a run: fewer are a drift, and more come from no air conditioner
FEWEST_OF_JOINT = 6.0  # the same of one joint: curves over time follow slower ones, and joints drift in many ways
SAWTOOTH_HARMONICS = 6  # harmonics of a sawtooth that are taken off with its line
ROWS_PER_CYCLE = 3.0  # readings for each cycle at the least: the residual of faster ones looks like noise


def line_left(
    scorer: Scorer, state: State, problem: Problem, offered: Sequence[Period], waves: Sequence[OncePerRev]
) -> Period | None:
    """The strongest line in the spectra of what a set leaves, over travel and over time.

    Where none is found it is sought again without free functions of position: with few rows or poses these fit any
    wave.

    Args:
        scorer: of the system.
        state: the best set so far.
        problem: n rows.
        offered: joint (None: time) and length of each period that was among the atoms already.
        waves: harmonics that are offered as named effects.
    """
    for gone in dict.fromkeys([(), free_in_place(state, scorer.system)]):
        straight = scorer.less(state, *gone) if gone else state
        lines = find_period(scorer, straight, problem, offered, waves), find_cycle(scorer, straight, problem, offered)
        found = [line for line in lines if line is not None]
        if found:
            return max(found, key=lambda line: line.nats).period
    return None


def find_cycle(scorer: Scorer, state: State, problem: Problem, offered: Sequence[Period] = ()) -> Line | None:
    """The strongest line of the innovations over time, at the tool or along one joint, if worth its prior odds.

    A wander follows any cycle, but the innovations still show its period. Curves over time can bend to slow cycles, so
    the line is sought without them. Arguments as of `line_left`.
    """
    system = rows_of(scorer.system)
    time, seen = problem.view.clock.numpy()[system.rows], any(joint is None for joint, _ in offered)
    turns = np.arange(FEWEST_CYCLES, min(MOST_CYCLES, len(time) / ROWS_PER_CYCLE), FREQUENCY_STEP)
    if "time" not in problem.view.varies or seen or len(time) < SPECTRUM_ROWS or np.ptp(time) == 0.0:
        return None
    bends = [key for key in state.keys if (block := system.atoms[key].block) is not None and block.on[0] == "time"]
    straight = scorer.less(state, *bends)
    white, ones = system.innovation(straight.columns, straight.posterior.values, straight.memory), np.ones(len(time))
    tool = [squares_over(time, axis, ones, FEWEST_CYCLES, FREQUENCY_STEP, len(turns)) for axis in white.T]
    joints = left_along(scorer, straight, problem, detail=False)
    along = [replace(joint, q=time).over(FEWEST_CYCLES, FREQUENCY_STEP, len(turns)) for joint in joints]
    gains = np.array([np.sum(tool, axis=0), *(np.where(turns < FEWEST_OF_JOINT, 0.0, gain) for gain in along)])
    place, first = np.unravel_index(np.argmax(gains), gains.shape)
    nats = 0.5 * float(gains[place, first]) / straight.posterior.phi - odds_of_block(gains.size)
    if nats <= 0.0:
        return None
    levers = np.broadcast_to(np.eye(3), (len(time), 3, 3))
    if place:
        levers = system.levers[joints[place - 1].joint][:, :, None]
    return Line((None, float(np.ptp(time)) / place_line(system, straight, time, levers, float(turns[first]))), nats)


def cycle_of(line: Period, problem: Problem, system: System) -> np.ndarray | None:
    """Regressors of a cycle over time, to be taken off before the noise is estimated, which it would inflate.

    Args:
        line: joint (None: time) and length of a period that is offered next.
        problem: n rows.
        system: of the search whose residual showed it.

    Returns:
        Cosines and sines on the rows that count, (m, 2 `SAWTOOTH_HARMONICS`); None for a line along a joint.
    """
    joint, length = line
    if joint is not None:
        return None
    return harmonics(2.0 * np.pi * problem.view.clock.numpy()[system.rows] / length, SAWTOOTH_HARMONICS)
