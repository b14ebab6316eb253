"""Whether base reflectors were read along a run: without them a drift of the whole machine looks like the tracker's.

The stand of a tracker grows with room temperature as a machine's frame does, by 15 to 35 um/K.
"""

from collections.abc import Sequence

import numpy as np
from torch import Tensor

from ptt.diagnosis.evidence.at_tool import at_tool_um, moved_by, without_rigid_motion
from ptt.effects import Effect
from ptt.effects.late import Growth, warmth_of
from ptt.effects.metrology import SetupJump
from ptt.effects.sudden import Sudden
from ptt.fitting.chunks import sampled_if_long
from ptt.model.model import Term
from ptt.run.axes import rms_length
from ptt.run.means import about_means
from ptt.run.noise import Noise
from ptt.run.problem import Problem

WATCHED_SHARE = 0.5  # share of a frame's time that visits to base reflectors have to span
MACHINE_CHANCE = 0.5  # probability that it was the machine rather than the tracker: both are usual
UNREAD = "Base reflectors were not read over at least half of the run, so"
DRIFT_OPEN = f"{UNREAD} a machine that drifts as a whole would look the same."
JUMP_OPEN = "Base reflectors were not read before and after it, so {} that moved would look the same."
WARMTH_OPEN = "Temperature went along with it: a stand that follows temperature would look the same."
GROWTH_OPEN = f"{UNREAD} a tracker that moves with temperature would look the same."
PART_OPEN = (
    f"{UNREAD} the {{part:g}} um rms of it that are one shift of all readings may as well be a drift of the tracker: "
    "temperature went with the clock."
)
BY_THE_CLOCK = 0.9  # squared correlation with temperature from which a drift looks like a shift with temperature
NOTED_PART = 1.5  # times the noise of one reading from which that part is worth a word and a doubt
CLEAR_GROWTH = 30.0  # chi-squared from which the readings show that a growth is no shift common to all of them


def unwitnessed(term: Term, problem: Problem, noise: Noise) -> list[str]:
    """Sentences that a jump or drift may be the machine's, or follow temperature, or a growth be the tracker's.

    Args:
        term: an effect at its values.
        problem: n rows.
        noise: the noise floor.

    Returns:
        None for other effects. Where base reflectors were read along the run, none but that on a drift with
        temperature; on both sides of a knock, none on it.
    """
    if isinstance(term.effect, SetupJump):
        moved = "a base" if problem.file.machine.kind == "serial" else "a base, a platform or a reflector"
        return [] if _was_watched_at(float(term.theta[-1]), problem) else [JUMP_OPEN.format(moved)]
    if drifts(term.effect):
        warm = [WARMTH_OPEN] if _follows_warmth(term, problem, noise) else []
        return [*([DRIFT_OPEN] if _is_unwitnessed(term, problem) else []), *warm]
    if _moves_as_one(term, problem, noise):
        return [GROWTH_OPEN]
    part = _shared_with_drift(term, problem, noise)
    return [PART_OPEN.format(part=float(f"{1e3 * part:.2g}"))] if part else []


def own_drift(terms: Sequence[Term], problem: Problem, noise: Noise) -> float:
    """Root mean square doubt in the tool's position, mm, as no reading tells whether machine or tracker moved.

    Args:
        terms: the named effects, at their values.
        problem: n rows.
        noise: the noise floor.

    Returns:
        Zero where base reflectors tell, or nothing moves the machine as a whole.
    """
    square = 0.0
    for term in terms:
        if _moves_as_one(term, problem, noise):
            square += MACHINE_CHANCE * (1e-3 * at_tool_um(term, problem)) ** 2
        else:
            square += MACHINE_CHANCE * _shared_with_drift(term, problem, noise) ** 2
        if _is_unwitnessed(term, problem):
            moved = term.effect.shift(term.theta, problem.view).numpy()[problem.used]
            for frame in np.unique(problem.frame[problem.used]):
                here = moved[problem.frame[problem.used] == frame]
                square += MACHINE_CHANCE * float(np.square(here - here.mean(axis=0)).sum()) / len(moved)
    return float(np.sqrt(square))


def drifts(effect: Effect) -> bool:
    """Whether an effect is a gradual drift of the tracker, which a drift of the machine looks like."""
    return effect.stage == "metrology" and effect.follows_clock and not isinstance(effect, Sudden)


def _is_unwitnessed(term: Term, problem: Problem) -> bool:
    return drifts(term.effect) and not _was_watched(problem)


def _grows_unwatched(term: Term, problem: Problem) -> bool:
    """Whether an effect is a growth of the machine with temperature in a run without visits to base reflectors."""
    grows = term.effect.stage != "metrology" and "temperature" in term.effect.requires
    return grows and not _was_watched(problem)


def _shared_with_drift(term: Term, problem: Problem, noise: Noise) -> float:
    """Root mean square, mm, of what a growth shifts all readings by alike where temperature went with the clock.

    Zero where it did not, where base reflectors tell, and where that part is not much more than the noise.
    """
    if not _grows_unwatched(term, problem):
        return 0.0
    frame = problem.frame[problem.used]
    time, warmth = (
        about_means(values.numpy()[problem.used], frame) for values in (problem.view.time, _warmth(term, problem))
    )
    if float(time @ warmth) ** 2 <= BY_THE_CLOCK * float(time @ time) * float(warmth @ warmth):
        return 0.0
    moved = moved_by(term, problem)
    shared = moved - _beside_shift(moved, term, problem)
    part = rms_length(shared)
    return part if part > NOTED_PART * noise.total else 0.0


def _follows_warmth(term: Term, problem: Problem, noise: Noise) -> bool:
    """Whether a drift looks, in these readings, like a shift in proportion to temperature."""
    if "temperature" not in problem.view.varies:
        return False
    moved = moved_by(term, problem)
    left = _beside_shift(moved, term, problem)
    mostly = float(np.square(left).sum()) < (1.0 - BY_THE_CLOCK) * float(np.square(moved).sum())
    return mostly and _is_shift_with_warmth(term, problem, noise)


def _moves_as_one(term: Term, problem: Problem, noise: Noise) -> bool:
    """Whether a growth with temperature looks, in these readings, like a common shift with temperature."""
    return _grows_unwatched(term, problem) and _is_shift_with_warmth(term, problem, noise)


def _is_shift_with_warmth(term: Term, problem: Problem, noise: Noise) -> bool:
    """Whether no reading shows that an effect is anything but a common shift in proportion to temperature."""
    few = sampled_if_long(problem)  # what a sample shows, all rows show
    if few is not problem and _beside_warmth(term, few, noise) >= CLEAR_GROWTH:
        return False
    return _beside_warmth(term, problem, noise) < CLEAR_GROWTH


def _beside_warmth(term: Term, problem: Problem, noise: Noise) -> float:
    """Chi-squared of an effect's shifts that no common shift in proportion to temperature explains."""
    return float(np.square(_beside_shift(moved_by(term, problem), term, problem) @ noise.whitener.T).sum())


def _beside_shift(moved: np.ndarray, term: Term, problem: Problem) -> np.ndarray:
    """Motions of the readings that count, (m, 3) mm, less the common shift in proportion to temperature in them."""
    left, warmth = moved.ravel(), _warmth(term, problem).numpy()[:, None]
    warm = np.stack([without_rigid_motion(warmth * axis, problem).ravel() for axis in np.eye(3)], axis=1)
    return np.asarray((left - warm @ np.linalg.lstsq(warm, left, rcond=None)[0]).reshape(-1, 3))


def _warmth(term: Term, problem: Problem) -> Tensor:
    """Temperature that an effect follows above the reference, (n,) K: that of a growth may be late."""
    effect, view = term.effect, problem.view
    return warmth_of(effect, term.theta, view) if isinstance(effect, Growth) else view.warmth


def _was_watched_at(moment: float, problem: Problem) -> bool:
    """Whether base reflectors were read on both sides of a moment of the view's clock, in the frame it lies in."""
    if problem.base is None:
        return False
    clock, seen = problem.view.clock.numpy(), problem.base.view.clock.numpy()
    frame = problem.frame[np.flatnonzero(clock <= moment)[-1:]]
    read = seen[np.isin(problem.base.frame, frame)]
    return bool((read <= moment).any() and (read > moment).any())


def _was_watched(problem: Problem) -> bool:
    """Whether base reflectors were read over `WATCHED_SHARE` of the time of each frame."""
    if problem.base is None:
        return False
    time, frame = problem.view.time.numpy()[problem.used], problem.frame[problem.used]
    seen, of = problem.base.view.time.numpy(), problem.base.frame
    return all(
        (of == one).any() and np.ptp(seen[of == one]) >= WATCHED_SHARE * np.ptp(time[frame == one])
        for one in np.unique(frame)
    )
