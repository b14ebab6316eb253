"""Steps of a diagnosis in words for a machinist: what is off, in which direction, and what is tied with it."""

from collections.abc import Sequence, Set
from dataclasses import replace

import torch

from ptt.diagnosis.evidence.at_tool import at_tool_um
from ptt.effects.layout import family
from ptt.effects.phrases import ValuePhrase, capital, compose, listed, remedies
from ptt.effects.phrases import doubt as far_off
from ptt.fitting.gauge import ExtraCovariance, GaugedTerm, sparsest
from ptt.model.model import Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem
from ptt.run.view import View

DOUBT_SHARE = 0.5  # share of the held-out error from which the doubt that no reading shows is worth a clause
# Times what an effect can reduce the error by, from which others cancel it partly, mostly
PARTLY_BACK, MOSTLY_BACK = 1.5, 3.0
SET_RIGHT = "To set right"


def sentence(told: GaugedTerm, view: View) -> str:
    """What an effect's values mean, with the direction of each.

    Args:
        told: the effect in the gauge in which it is reported.
        view: of the machine.

    Returns:
        For example 'slider 2 stands 250 um lower than b says: homing (sliders against each other; what they have in
        common cannot be told from the tracker's z)'.
    """
    parts, noun = _said(told, view)
    body = compose(parts, noun)
    if not body:
        return f"{told.term.effect.key} explains a part"
    effect, theta, measured = told.term.effect, told.term.theta, told.term.measured
    cause = effect.cause(theta, view) if measured is None else effect.cause_measured(theta, view, measured)
    return f"{body}: {cause}{_gauge(told, noun)}{far_off(parts)}"


def _gauge(told: GaugedTerm, noun: str) -> str:
    if not told.alike:
        return ""
    names = [name.removeprefix("tracker ") for name in told.alike]
    about = [name.removeprefix("rotation about ") for name in names if name.startswith("rotation")]
    straight = [name for name in names if not name.startswith("rotation")]
    parts = [listed(straight)] if straight else []
    parts += [f"rotation about {listed(about)}"] if about else []
    whose = f"the tracker's {' and its '.join(parts)}"
    return f" ({noun}s against each other; what they have in common cannot be told from {whose})"


def sentences(
    terms: Sequence[Term], problem: Problem, noise: Noise, widen: float = 1.0, extra: ExtraCovariance | None = None,
    *, cured: bool = True, brief: Set[str] = frozenset(),
) -> list[str]:  # fmt: skip
    """One sentence for every fitted effect of a model, all in the gauge with the fewest values off.

    Args:
        terms: fitted together.
        problem: the readings.
        noise: the noise floor.
        widen: ratio of what the fit leaves to the noise, where that exceeds one.
        extra: further covariance of values by name, as of `ptt.fitting.gauge.sparsest`.
        cured: whether to say what to set right on the machine.
        brief: keys of effects that are only named where none of their values is beyond its error.

    Returns:
        One for each term, and one for those that are only named.
    """
    known = [term for term in terms if len(term.theta)]
    words, within = [], []
    for term, free in zip(known, sparsest(known, problem, noise, widen, extra=extra), strict=True):
        told = _held(free, term)
        parts, _ = _said(told, problem.view)
        if term.effect.key in brief and parts and not any(part.sure for part in parts):
            within.append(term.effect.key)
            continue
        if not parts:
            words.append(f"{capital(_by_size(told.term, problem))}.")
            continue
        set_right = remedy(told, problem.view) if cured else ""
        words.append(f"{capital(sentence(told, problem.view))}.{f' {SET_RIGHT}: {set_right}.' if set_right else ''}")
    if within:
        words.append(f"Fitted as well, with no single value beyond its error: {listed(within)}.")
    return words


def _by_size(term: Term, problem: Problem) -> str:
    """A sentence on an effect whose values have no words, as one of a user's own."""
    what = "the readings" if term.effect.stage == "metrology" else "the tool"
    makes = at_tool_um(term, problem)
    return f"{term.effect.key} moves {what} by {makes:.{0 if makes >= 10.0 else 1}f} um rms in this run"


def _held(told: GaugedTerm, term: Term) -> GaugedTerm:
    """The effect with standard errors in the gauge limited to the norm of those of its fitted values."""
    if told.term.std is None or term.std is None:
        return told
    most = float(term.std[torch.isfinite(term.std)].norm())
    return replace(told, term=replace(told.term, std=told.term.std.clamp(max=most))) if most > 0.0 else told


def remedy(told: GaugedTerm, view: View) -> str:
    """What to turn, move or enter to correct an effect, and by how much; '' where nothing can be done.

    Args:
        told: the effect in the gauge in which it is reported.
        view: of the machine.
    """
    parts, noun = _said(told, view)
    return remedies(parts, noun)


def _said(told: GaugedTerm, view: View) -> tuple[tuple[ValuePhrase, ...], str]:
    effect, theta = told.term.effect, told.term.theta
    std = torch.full_like(theta, torch.nan) if told.term.std is None else told.term.std
    return effect.say(theta, std, view), effect.arm_noun if family(view) == "serial" else effect.noun


def explain_step(
    term: Term,
    others: Sequence[str],
    together: Sequence[str],
    heldout_um: tuple[float, float],
    noise: Noise,
    problem: Problem,
    after: Sequence[str] = (),
    doubt_um: float | None = None,
    beside: Sequence[Term] = (),
    extra: ExtraCovariance | None = None,
    exceptions: str = "",
) -> str:
    """One step in two or three sentences, ties first.

    Args:
        term: the effect, fitted.
        others: effects that would do as well.
        together: effects that would do as well only together.
        heldout_um: held-out error before and after.
        noise: the noise floor.
        problem: the readings; their frames tell in which gauge values are said.
        after: steps that were taken before this one, to which the held-out error belongs.
        doubt_um: doubt in the tool's position that no reading shows; None to leave it out.
        beside: the other terms of the fit, which are free beside it.
        extra: further covariance of values by name, as of `ptt.fitting.gauge.sparsest`.
        exceptions: a clause on what else would look the same; '' for nothing.

    Returns:
        For example 'Sliders 2 and 3 lose 41 and 38 um on reversal: backlash. Nothing else explains it as well; the
        held-out error falls from 62 to 9 um (noise 7 um).'
    """
    told = sparsest([term], problem, noise, beside=beside, extra=extra)[0]
    tie, head = headline(term.effect.key, others, together), sentence(told, problem.view)
    before, now = heldout_um
    on_top = f"after {listed(list(after))} " if after else ""
    fall = f"the held-out error {on_top}{_moved(before, now)} (noise {noise.total * 1e3:.1f} um)"
    if size := _size_in_all(told, before + now, before, problem):
        fall += f"; {size}"
    if doubt := doubt_in_words(now, doubt_um):
        fall += f"; {doubt}"
    if tie:
        return f"{tie} Taken as {term.effect.key}: {head}; {fall}."
    alone = f"Nothing else explains it as well{exceptions}; " if not told.alike and now < before else ""
    return f"{capital(head)}. {capital(alone + fall)}."


def _moved(before: float, now: float) -> str:
    if f"{before:.1f}" == f"{now:.1f}":
        return f"stays at {now:.1f} um"
    return f"{'falls' if now < before else 'rises'} from {before:.1f} to {now:.1f} um"


def _size_in_all(told: GaugedTerm, apart: float, before: float, problem: Problem) -> str:
    """A clause on an effect's size at the tool (or in the readings), where it exceeds the error; '' otherwise.

    It does where other effects cancel it in part.

    Args:
        told: the effect as it is reported.
        apart: sum of the errors before and after it, um: as much as it can have changed the error.
        before: error before it, um.
        problem: the readings.
    """
    parts, _ = _said(told, problem.view)
    largest = max((part.size for part in parts if part.unit == "um"), default=0.0)
    makes = at_tool_um(told.term, problem)
    if largest <= before and makes <= PARTLY_BACK * apart:
        return ""
    share = "mostly" if makes > MOSTLY_BACK * apart else "partly"
    cancelled = f", {share} cancelled by the other effects" if makes > PARTLY_BACK * apart else ""
    where = "in the readings" if told.term.effect.stage == "metrology" else "at the tool"
    return f"the effect amounts to {makes:.{0 if makes >= 10.0 else 1}f} um rms {where}{cancelled}"


def doubt_in_words(error_um: float, doubt_um: float | None, least: float = DOUBT_SHARE) -> str:
    """A clause on the doubt in the tool's position that no reading shows.

    Args:
        error_um: on held-out blocks.
        doubt_um: the doubt; None where it is not known.
        least: share of the error from which it is mentioned.

    Returns:
        The clause; '' where the doubt is small.
    """
    if doubt_um is None or not doubt_um > least * error_um:
        return ""
    return f"the readings leave the tool position uncertain by up to {doubt_um:.1f} um"


def headline(key: str, others: Sequence[str], together: Sequence[str]) -> str:
    """The sentence on a tie.

    Args:
        key: the effect that was picked.
        others: effects that would do as well.
        together: effects that would do as well only together.

    Returns:
        For example 'Either homing-offset or tower-tilt: this data cannot tell them apart.'; '' where there is no tie.
    """
    sums = f"{listed(list(together))} together would do the same" if together else ""
    if others:
        either = f"Either {', '.join((key, *others[:-1]))} or {others[-1]}: this data cannot tell them apart"
        return f"{either}; {sums}." if sums else f"{either}."
    return f"Either {key}, or {sums}: this data cannot tell them apart." if sums else ""
