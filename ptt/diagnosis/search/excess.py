"""Objections to an explanation, and errors that a stated noise does not account for."""

from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.noise.wander import FAULT_SHARE
from ptt.effects.phrases import listed
from ptt.run.axes import AXES
from ptt.run.noise import Noise, source_in_words

QUIET_EXCESS = 1.5  # times a stated noise up to which the empty set may be reported though another is a little likelier
# Times a stated noise from which an error is unexplained: a single stated figure is often half too small
NOISE_EXCESS = 2.0
# The same of one axis beside a noise that is stated as one figure: all of it on one axis is sqrt(3) times that, and the
# figure may be half too small
AXIS_EXCESS = 2.5
UNREPEATED = "either poses repeat no better than that, or something that no column records changes between visits"


@dataclass(frozen=True)
class Objections:
    """Objections to an explanation beside the tests of its residuals.

    Attributes:
        faithful: whether held-out readings are predicted as well as the explanation claims.
        unproven: names of effects that fit the readings and do not improve predictions of held-out ones.
        impossible: names of effects at whose values commanded poses cannot be reached.
        idle: names of effects that do nothing visible at their fitted values.
        backward: names of effects with values of a physically impossible sign.
        set_aside: what the readings set aside as gross errors have in common, in words; None for nothing.
        unexplained_error: that the error which no named effect explains is too large, in words; None where it is not.
    """

    faithful: bool = True
    unproven: tuple[str, ...] = ()
    impossible: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()
    backward: tuple[str, ...] = ()
    set_aside: str | None = None
    unexplained_error: str | None = None

    @property
    def reasons(self) -> tuple[str, ...]:
        """All but `unexplained_error`, in words."""
        fits, does = ("fits", "does") if len(self.unproven) == 1 else ("fit", "do")
        vain = f"{listed(self.unproven)} {fits} these readings but {does} not improve predictions of held-out ones"
        astray = "held-out readings are predicted far worse than the fit itself claims"
        values = "the fitted values of"
        unreached = "are impossible: with them the machine could not reach the measured poses"
        signs = "have the wrong sign, which no physical cause gives them"
        return tuple(
            words
            for holds, words in (
                (self.unproven, vain),
                (not (self.faithful or self.unproven), astray),
                (self.impossible, f"{values} {listed(self.impossible)} {unreached}"),
                (self.idle, f"{values} {listed(self.idle)} have no visible effect"),
                (self.backward, f"{values} {listed(self.backward)} {signs}"),
                (self.set_aside, f"the readings set aside as gross errors {self.set_aside}, unlike real gross errors"),
            )
            if holds
        )


def too_much_left(
    error: float, noise: Noise | None, *, wanders: bool = False, by_visit: bool = False, rounding_mm: float = 0.0
) -> str | None:
    """That an error that no named effect explains is far beyond the stated noise, in words.

    Repeats contain whatever differs from visit to visit, and a wander absorbs whatever is slow, so much can hide in
    either, and the run alone determines both. A noise stated for the tracker contains neither. So beside a stated noise
    either of them may be as large as a tracker's wander may be beside white noise, and no larger.

    Args:
        error: root mean square of the residuals, wander included, mm.
        noise: the noise floor as it was before any search; None where nothing gave it.
        wanders: whether the explanation has a wander.
        by_visit: whether it has random errors of visits.
        rounding_mm: root mean square position error by rounding of the commands.

    Returns:
        The reason in words; None where there is none.
    """
    if noise is None:
        return None
    source, total = stated_of(noise, rounding_mm)
    visits = by_visit or noise.stated is not None
    if error <= (np.sqrt(1.0 + FAULT_SHARE) if wanders or visits else NOISE_EXCESS) * total:
        return None
    times = f"the error is {error / total:.1f} times the noise (from {source_in_words(source)})"
    if visits:
        return f"{times}: {UNREPEATED}"
    return f"{times}, more than a tracker wanders" if wanders else f"{times} and depends on nothing recorded here"


def is_open(error: float, noise: Noise | None, rounding_mm: float) -> bool:
    """Whether a machine that repeats no better is as likely as something that no column records.

    Args:
        error: root mean square of the residuals, mm.
        noise: as of `too_much_left`.
        rounding_mm: as of `too_much_left`.
    """
    return noise is not None and error > NOISE_EXCESS * stated_of(noise, rounding_mm)[1]


def beyond_noise(what: str, times: float, source: str) -> str:
    """Say that more is left than the stated noise, though it depends on nothing that was recorded.

    Args:
        what: subject of the sentence.
        times: its size over the noise.
        source: where the noise comes from.

    Returns:
        The sentence, without its stop.
    """
    return (
        f"{what} is {times:.1f} times the noise (from {source_in_words(source)}): either that figure is too small, or "
        "something is missing that depends on nothing recorded here"
    )


def remaining_error(residual: str) -> str:
    """A residual as the subject of a sentence: 'the remaining error of slider 2', but 'in x' for the tool."""
    return f"the remaining error {'in' if residual in AXES else 'of'} {residual}"


def stated_of(noise: Noise, rounding_mm: float) -> tuple[str, float]:
    """Source and size, mm, of the stated noise: what a file states for the tracker comes before repeats.

    Args:
        noise: the floor as it was before any search.
        rounding_mm: root mean square position error by rounding of the commands, added in quadrature.
    """
    source, total = noise.stated or (noise.source, noise.total)
    return source, float(np.hypot(total, rounding_mm))
