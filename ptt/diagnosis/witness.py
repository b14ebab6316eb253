"""Whether anything at rest was read along a run: else a machine that drifts looks like a tracker that does."""

from collections.abc import Sequence

import numpy as np

from ptt.effects import Effect
from ptt.effects.sudden import Sudden
from ptt.model.model import Term
from ptt.run.problem import Problem

HALF = 0.5  # of a frame's time that visits to base reflectors have to span; and the odds of either, for both are usual
ALIKE = "No base reflector was read over half of the run: a machine that drifts as a whole would look the same."


def unwitnessed(term: Term, problem: Problem) -> list[str]:
    """Say that a tracker's drift may as well be the machine's, where nothing shows which.

    Args:
        term: an effect at its values.
        problem: n rows.

    Returns:
        One sentence; none for what is no drift, or was seen at rest.
    """
    return [ALIKE] if _is_unwitnessed(term, problem) else []


def own_drift(terms: Sequence[Term], problem: Problem) -> float:
    """How far the tool itself may have drifted, root mean square about the middle of each frame, mm.

    Args:
        terms: what is named, at its values.
        problem: n rows.

    Returns:
        Zero where base reflectors saw that it is the tracker, or nothing drifts.
    """
    square = 0.0
    for term in terms:
        if _is_unwitnessed(term, problem):
            moved = term.effect.shift(term.theta, problem.view).numpy()[problem.used]
            for frame in np.unique(problem.frame[problem.used]):
                here = moved[problem.frame[problem.used] == frame]
                square += HALF * float(np.square(here - here.mean(axis=0)).sum()) / len(moved)
    return float(np.sqrt(square))


def drifts(effect: Effect) -> bool:
    """Whether an effect is a drift of the tracker, which a machine that drifts looks like.

    Args:
        effect: any.
    """
    return effect.stage == "metrology" and effect.follows_clock and not isinstance(effect, Sudden)


def _is_unwitnessed(term: Term, problem: Problem) -> bool:
    return drifts(term.effect) and not _was_watched(problem)


def _was_watched(problem: Problem) -> bool:
    """Whether base reflectors were read over half of the time of each frame."""
    if problem.base is None:
        return False
    time, frame = problem.view.time.numpy()[problem.used], problem.frame[problem.used]
    seen, of = problem.base.view.time.numpy(), problem.base.frame
    return all(
        (of == one).any() and np.ptp(seen[of == one]) >= HALF * np.ptp(time[frame == one]) for one in np.unique(frame)
    )
