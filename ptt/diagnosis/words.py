"""The diagnosis in words that a machinist understands: what is off, on which side, and what cannot be told apart."""

from collections.abc import Sequence
from typing import Any, Protocol

import torch

from ptt.dependence.said import middle
from ptt.diagnosis.slow import Slow
from ptt.effects.base import family
from ptt.effects.phrases import Said, compose, listed, remedies
from ptt.effects.phrases import doubt as far_off
from ptt.fitting.gauge import Told, sparsest
from ptt.model.model import Term
from ptt.run.noise import SATURATED, Noise
from ptt.run.problem import Problem
from ptt.run.view import View

MISSING = "Something is missing that no known effect describes"
DOUBTED = 0.5  # of an error from which it is worth a word what no reading shows
NOTED = 1.5  # times the noise that are worth a word
LINES = 5  # that anybody reads


class Strongest(Protocol):
    """What the leading unknown depends on, as `ptt.dependence.Dependence` says it."""

    residual: str
    on: str
    share: float
    period_mm: float | None
    shape: str
    place: tuple[float, float] | None
    with_: str | None
    acts_on: str | None
    unit: str
    words: str


def sentence(told: Told, view: View) -> str:
    """What an effect of a machine means, with the side of each value.

    Args:
        told: the effect in the gauge in which it is to be said.
        view: of the machine.

    Returns:
        For example 'slider 2 stands 250 um lower than b says: homing (sliders against each other; what they have in
        common cannot be told from the tracker's z)'.
    """
    parts, noun = _said(told, view)
    body = compose(parts, noun)
    if not body:
        return f"{told.term.effect.key} explains a part"
    return f"{body}: {told.term.effect.cause(told.term.theta, view)}{_gauge(told, noun)}{far_off(parts)}"


def _gauge(told: Told, noun: str) -> str:
    if not told.alike:
        return ""
    names = [name.removeprefix("tracker ") for name in told.alike]
    about = [name.removeprefix("rotation about ") for name in names if name.startswith("rotation")]
    straight = [name for name in names if not name.startswith("rotation")]
    parts = [listed(straight)] if straight else []
    parts += [f"rotation about {listed(about)}"] if about else []
    whose = f"the tracker's {' and its '.join(parts)}"
    return f" ({noun}s against each other; what they have in common cannot be told from {whose})"


def sentences(terms: Sequence[Term], problem: Problem, noise: Noise, widen: float = 1.0) -> list[str]:
    """Every fitted effect of a model in one sentence each, all in the gauge with the fewest parts off.

    Args:
        terms: fitted together.
        problem: the readings.
        noise: the noise floor.
        widen: times the noise that the fit leaves, where it is more than that.

    Returns:
        One for each term.
    """
    known = [term for term in terms if len(term.theta)]
    words = []
    for told in sparsest(known, problem, noise, widen):
        set_right = remedy(told, problem.view)
        words.append(f"{_upper(sentence(told, problem.view))}.{f' To set right: {set_right}.' if set_right else ''}")
    return words


def remedy(told: Told, view: View) -> str:
    """What has to be turned, moved or entered, and by how much; '' where nothing can be.

    Args:
        told: the effect in the gauge in which it is to be said.
        view: of the machine.
    """
    parts, noun = _said(told, view)
    return remedies(parts, noun)


def _said(told: Told, view: View) -> tuple[tuple[Said, ...], str]:
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
) -> str:
    """One step in two or three sentences; what cannot be told apart comes first.

    Args:
        term: the effect, fitted.
        others: effects that would do as well.
        together: effects that would do as well only together.
        heldout_um: held-out error before and after.
        noise: the noise floor.
        problem: the readings; their frames tell in which gauge values are said.
        after: steps that were taken before this one, to which the held-out error belongs.
        doubt_um: how far the machine may have the tool elsewhere beside the error after it; None where nobody asks.

    Returns:
        For example 'Sliders 2 and 3 lose 41 and 38 um on reversal: backlash. Nothing else explains it as well; the
        held-out error falls from 62 to 9 um, noise is 7 um.'
    """
    told = sparsest([term], problem, noise)[0]
    tie, head = headline(term.effect.key, others, together), sentence(told, problem.view)
    before, now = heldout_um
    moved = "falls" if now < before else "goes"
    on_top = f"after {listed(list(after))} " if after else ""
    fall = f"the held-out error {on_top}{moved} from {before:.1f} to {now:.1f} um, noise is {noise.total * 1e3:.1f} um"
    if doubt := doubt_in_words(now, doubt_um):
        fall += f"; {doubt}"
    if tie:
        return f"{tie} As {term.effect.key}: {head}; {fall}."
    alone = "" if told.alike else "Nothing else explains it as well; "
    return f"{_upper(head)}. {_upper(alone + fall)}."


def doubt_in_words(error_um: float, doubt_um: float | None, least: float = DOUBTED) -> str:
    """What readings cannot show of the tool, beside the error that they show.

    Args:
        error_um: on hidden blocks.
        doubt_um: how far the machine may have the tool elsewhere while the readings stay; None where nobody asks.
        least: share of the error from which it is worth a word.

    Returns:
        A clause; '' where it is not worth one.
    """
    if doubt_um is None or not doubt_um > least * error_um:
        return ""
    return f"what the readings cannot show of the tool may add up to {doubt_um:.1f} um"


def headline(key: str, others: Sequence[str], together: Sequence[str]) -> str:
    """What cannot be told apart, or nothing.

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


def explain_verdict(result: Any, steps: int | None = None) -> str:
    """The verdict of a diagnosis.

    Args:
        result: the diagnosis: verdict, suggested, candidates, depends_on, rest, noise, rms_um, rows.
        steps: how many effects could be added; None for as many as it takes.

    Returns:
        Text; of an unknown at most five lines.
    """
    count = len(result.suggested)
    return "\n".join(
        tell_verdict(
            result.verdict,
            [candidate.words for candidate in result.candidates[:count]],
            (result.rms_um["before"]["total"], result.rms_um["after"]["total"]),
            result.noise,
            result.rows,
            ties=[headline(step[0], step[1:], one.sum_of) for step, one in zip(
                result.suggested, result.candidates, strict=False)],
            names=[step[0] for step in result.suggested],
            strongest=result.depends_on[0] if result.depends_on else None,
            reasons=result.rest.reasons,
            cut_short=steps is not None and steps == count,
            wander=result.wander,
        )
    )  # fmt: skip


def held_to_base(error_um: float | None) -> str:
    """A word on the tracker's frame where base reflectors hold it in other commands.

    Args:
        error_um: of the model as given, as `ptt compare` and `ptt add` print it; None where there are no reflectors.
    """
    if error_um is None:
        return ""
    return (
        " (Here the tracker's frame is free to move. Held to the base reflectors, as compare and add hold it, the "
        f"error of the model as given is {error_um:.1f} um.)"
    )


def tell_verdict(
    verdict: str,
    steps: Sequence[str],
    error_um: tuple[float, float],
    noise: Noise,
    rows: int,
    *,
    ties: Sequence[str] = (),
    names: Sequence[str] = (),
    strongest: Strongest | None = None,
    reasons: Sequence[str] = (),
    cut_short: bool = False,
    wander: Slow | None = None,
) -> list[str]:
    """The verdict line by line, each line one thing, what cannot be told apart first.

    Args:
        verdict: 'missing', 'nothing-missing' or 'unknown'.
        steps: words of each step.
        error_um: error before and after the steps.
        noise: the noise floor.
        rows: readings that counted.
        ties: for each step what cannot be told apart from it, '' for nothing.
        names: of the steps.
        strongest: what the leading unknown depends on.
        reasons: what says that something is left.
        cut_short: no more steps were allowed.
        wander: of the tracker's readings, where there is any.

    Returns:
        At most five lines where something unknown is missing; else one for each step and one for the errors.
    """
    before, after = error_um
    floor = f"the noise {noise.total * 1e3:.1f} um ({noise.source})"
    excess = _excess(after, noise, wander)
    if verdict == "nothing-missing":
        sound = f"Nothing is missing that these {rows} readings could show"
        return [f"{sound}: the error is {after:.1f} um, {floor}.{excess}{_unstated(noise)}"]
    fall = f"the error is {after:.1f} um, down from {before:.1f} um; {floor}."
    if verdict == "missing":
        # A tie stands at the head of its step's words; a later one has to be heard of first, too.
        open_ones = [name for name, tie in zip(names, ties, strict=False) if tie]
        first = [f"Not all has one name: see {listed(open_ones)}."] if open_ones and not ties[0] else []
        return [*first, *steps, f"With that {fall}{excess}"]
    what = "More is missing, but no more steps were allowed" if cut_short else MISSING
    lines = [f"{what}." if strongest or not reasons else f"{what}: {reasons[0]}."]
    lines += [depends(strongest)] if strongest else []
    if 0 < len(steps) <= LINES - 1 - len(lines):
        lines += [f"Named beside it: {step}" for step in steps]
    elif steps:
        lines.append(f"Named beside it: {listed(list(names))}; what each means stands with the candidates.")
    return [*lines, f"With what is named {fall}" if steps else f"The error is {after:.1f} um, {floor}"]


def depends(strongest: Strongest) -> str:
    """What the leading unknown follows, how large it is and which way it goes, in one line."""
    period = f" with a period of {strongest.period_mm:.3g} {strongest.unit}".rstrip() if strongest.period_mm else ""
    share = f"({strongest.share:.0%} of its variance){acting(strongest.acts_on, strongest.residual)}"
    size = f" {strongest.words}" if strongest.words else ""
    if strongest.place and strongest.shape == "step" and not strongest.with_:
        where = middle(*strongest.place, strongest.unit)
        return f"What is left of {strongest.residual} jumps where {strongest.on} passes {where} {share}.{size}"
    place = f" near {middle(*strongest.place, strongest.unit)}" if strongest.place else ""
    place = f", in a measure that varies with {strongest.with_}" if strongest.with_ else place
    return f"What is left of {strongest.residual} follows {_spoken(strongest.on)}{period}{place} {share}.{size}"


def acting(place: str | None, residual: str) -> str:
    """Where an unknown acts, if that is not what its residual is called by.

    Args:
        place: as `Dependence.acts_on` has it.
        residual: in which it shows.

    Returns:
        For example ', as if rail 2 moved outward'; nothing where the residual says it or nobody knows.
    """
    if place is None or place == residual or place in ("x", "y", "z"):
        return ""
    if place.startswith("link"):
        return f", as if {place} changed its length"
    return f", as if {place.rsplit(' ', 1)[0]} moved {place.rsplit(' ', 1)[1]}"


def _spoken(on: str) -> str:
    """A variable; the tool's way is no column of a table, so it is said what it is."""
    word, _, axis = on.partition(" ")
    spoken = {"way": f"the way along {axis} that the tool came", "turn": f"how the tool turns along {axis}"}
    return f"{spoken[word]} ({on})" if axis in ("x", "y", "z") and word in spoken else on


def _unstated(noise: Noise) -> str:
    """A word where only the rest tells the noise: what changes from reading to reading counts as noise then."""
    if noise.source != SATURATED:
        return ""
    return (
        " Only what is left tells the noise: an error that changes from each reading to the next would hide in it; "
        "repeats of some poses, or sigma_mm in the machine file, would show it."
    )


def _excess(after_um: float, noise: Noise, wander: Slow | None) -> str:
    """A word where much more is left than the noise is said to be, though it follows nothing that was recorded."""
    times = after_um / max(noise.total * 1e3, 1e-12)
    if times < NOTED:
        return ""
    if wander is not None:
        size = wander.size * noise.total * 1e3
        return f" The rest is slow: the readings wander by {size:.1f} um, {wander.lasts}."
    return (
        f" That is {times:.1f} x the noise by the {noise.source}: they understate the scatter of a reading, or "
        "something is missing that follows nothing recorded here."
    )


def _upper(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"
