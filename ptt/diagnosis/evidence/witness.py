"""Whether anything at rest was read along a run: else a machine that moves as a whole looks like a tracker that does.

The stand of a tracker grows with the room as a frame does, by 15 to 35 um/K.
"""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.at_tool import at_tool_um, moved_by, off_set_up
from ptt.effects import Effect
from ptt.effects.sudden import Sudden
from ptt.fitting.chunks import few_enough
from ptt.model.model import Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem

WATCHED_SHARE = 0.5  # share of a frame's time that visits to base reflectors have to span
MACHINE_CHANCE = 0.5  # probability that it was the machine rather than the tracker: both are usual
UNREAD = "Base reflectors were not read over at least half of the run, so"
DRIFT_OPEN = f"{UNREAD} a machine that drifts as a whole would look the same."
GROWTH_OPEN = f"{UNREAD} a tracker that moves with temperature would look the same."
CLEAR_GROWTH = 30.0  # chi-squared from which the readings show that a growth is no shift common to all of them


def unwitnessed(term: Term, problem: Problem, noise: Noise) -> list[str]:
    """Say that a tracker's drift may as well be the machine's, or a growth the tracker's, where nothing shows which.

    Args:
        term: an effect at its values.
        problem: n rows.
        noise: the noise floor.

    Returns:
        One sentence; none for what is neither, or was seen at rest.
    """
    if _is_unwitnessed(term, problem):
        return [DRIFT_OPEN]
    return [GROWTH_OPEN] if _moves_as_one(term, problem, noise) else []


def own_drift(terms: Sequence[Term], problem: Problem, noise: Noise) -> float:
    """How far the tool may be elsewhere, as nothing shows whether it or the tracker moved, root mean square, mm.

    Args:
        terms: what is named, at its values.
        problem: n rows.
        noise: the noise floor.

    Returns:
        Zero where base reflectors saw which it is, or nothing moves as a whole.
    """
    square = 0.0
    for term in terms:
        if _moves_as_one(term, problem, noise):
            square += MACHINE_CHANCE * (1e-3 * at_tool_um(term, problem)) ** 2
        if _is_unwitnessed(term, problem):
            moved = term.effect.shift(term.theta, problem.view).numpy()[problem.used]
            for frame in np.unique(problem.frame[problem.used]):
                here = moved[problem.frame[problem.used] == frame]
                square += MACHINE_CHANCE * float(np.square(here - here.mean(axis=0)).sum()) / len(moved)
    return float(np.sqrt(square))


def drifts(effect: Effect) -> bool:
    """Whether an effect is a drift of the tracker, which a machine that drifts looks like.

    Args:
        effect: any.
    """
    return effect.stage == "metrology" and effect.follows_clock and not isinstance(effect, Sudden)


def _is_unwitnessed(term: Term, problem: Problem) -> bool:
    return drifts(term.effect) and not _was_watched(problem)


def _moves_as_one(term: Term, problem: Problem, noise: Noise) -> bool:
    """Whether a growth is, to the readings, a shift of all of them with the warmth."""
    if term.effect.stage == "metrology" or "temperature" not in term.effect.requires or _was_watched(problem):
        return False
    few = few_enough(problem)  # what they show, all rows show
    if few is not problem and _beside_warmth(term, few, noise) >= CLEAR_GROWTH:
        return False
    return _beside_warmth(term, problem, noise) < CLEAR_GROWTH


def _beside_warmth(term: Term, problem: Problem, noise: Noise) -> float:
    """Chi-squared of what an effect does beside any shift of all readings with the warmth."""
    left, warmth = moved_by(term, problem).ravel(), problem.view.warmth.numpy()[:, None]
    warm = np.stack([off_set_up(warmth * axis, problem).ravel() for axis in np.eye(3)], axis=1)
    rest = (left - warm @ np.linalg.lstsq(warm, left, rcond=None)[0]).reshape(-1, 3)
    return float(np.square(rest @ noise.whitener.T).sum())


def _was_watched(problem: Problem) -> bool:
    """Whether base reflectors were read over half of the time of each frame."""
    if problem.base is None:
        return False
    time, frame = problem.view.time.numpy()[problem.used], problem.frame[problem.used]
    seen, of = problem.base.view.time.numpy(), problem.base.frame
    return all(
        (of == one).any() and np.ptp(seen[of == one]) >= WATCHED_SHARE * np.ptp(time[frame == one])
        for one in np.unique(frame)
    )
