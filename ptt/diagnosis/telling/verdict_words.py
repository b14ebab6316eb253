"""The verdict of a diagnosis in words, and what an unknown depends on."""

from collections.abc import Callable, Sequence
from typing import Any

from ptt.dependence.dependence import Dependence
from ptt.dependence.said import changed_at, described, middle, switched_at
from ptt.diagnosis.noise.slow import Slow
from ptt.diagnosis.search.excess import UNREPEATED, beyond_noise, remaining_error
from ptt.diagnosis.telling.untested import untested
from ptt.diagnosis.telling.words import headline
from ptt.effects.cards import card_of
from ptt.effects.curve_basis import GRAVITY
from ptt.effects.phrases import capital, listed
from ptt.run.axes import AXES
from ptt.run.noise import SATURATED, VISITED, Noise, source_in_words

MISSING = "Something is missing that no known effect describes"
MOSTLY_UNTOLD = "Most of the remaining error follows none of this run's variables; more poses may show what it follows"
NOTED_EXCESS = 1.5  # times the noise from which an excess is worth a sentence
EVEN_CHANCE = 0.5  # probability of a verdict that tests of the residuals gave, and not the sets of effects
# Probability from which a verdict is right in at least 95 % of cases, so that no other need be mentioned
SURE_VERDICT = 0.9
MINOR_SHARE = 0.05  # of the variance of the remaining error; what explains less is not what the error mostly follows
MOST_UNKNOWN_LINES = 5  # lines on an unknown
# The variable of an effect's law, as its card has it -> the run's column. Joints and positions are left out: most
# effects vary with them, so an unknown that does so too says nothing about their laws.
LAW_COLUMN = {"payload": "payload", "load": "payload", "link force": "payload", "temperature": "temperature"}


def explain_verdict(result: Any, steps: int | None = None) -> str:
    """The verdict of a diagnosis in lines, each about one thing, ties first.

    Args:
        result: the diagnosis, complete but for its words.
        steps: how many effects could be added; None for as many as it takes.

    Returns:
        Lines: of an unknown at most five; else one for each step, one for the errors, and one on the workspace.
    """
    before, after = (result.rms_um[stage]["total"] for stage in ("before", "after"))
    noise, excess = result.noise, excess_in_words(after, result.noise, result.wander)
    beyond = _beyond_stated(noise)
    floor = f"the noise is {noise.total * 1e3:.1f} um (from {source_in_words(noise.source)}{beyond})"
    varies = f" {capital(UNREPEATED)}." if beyond else ""
    told = [candidate.words for candidate in result.candidates[: len(result.suggested)]]
    if result.verdict == "nothing-missing":
        sound = f"Nothing is missing that these {result.rows} readings could show"
        lines = [f"{sound}: the error is {after:.1f} um; {floor}.{varies}{excess}{_unstated(noise)}{_unsure(result)}"]
    elif result.verdict == "missing":
        these = "this effect" if len(told) == 1 else "these effects"
        fall = f"With {these} {_fall(before, after)}; {floor}.{varies}{excess}{_likely_too(result.perhaps)}"
        lines = [*_open_below(result), *doubted(result), *told, fall]
    else:
        lines = _unknown(result, told, cut_short=steps == len(told))
        named = "the named effect" if len(told) == 1 else "the named effects"
        fall = f"With {named} {_fall(before, after)}" if told else f"The error is {after:.1f} um"
        too = _suggested_too([name for name in result.perhaps if name not in result.oversized])
        lines += [f"{fall}; {floor}.{too}{_oversized_too(result.oversized)}"]
    if result.elsewhere is not None and (far := result.elsewhere.words(after)):
        lines.append(far)
    return "\n".join(lines)


def _fall(before: float, after: float) -> str:
    """A clause on the error before and after, um."""
    if f"{after:.1f}" == f"{before:.1f}":
        return f"the error is unchanged at {after:.1f} um"
    return f"the error is {after:.1f} um, {'down' if after < before else 'up'} from {before:.1f} um"


def _suggested_too(names: Sequence[str]) -> str:
    """A sentence on effects that are not certain enough to be named beside an unknown; '' for none."""
    if not names:
        return ""
    are = "is" if len(names) == 1 else "are"
    hardly = f"which can hardly be separated from the unknown part and {are} therefore not named"
    return f" The readings also suggest {listed(list(names))}, {hardly}."


def _oversized_too(names: Sequence[str]) -> str:
    """A sentence on effects that would explain the unknown, but at a size beyond any seen; '' for none."""
    if not names:
        return ""
    size = "at a size that its cause has never been seen to reach: is the drawing right?"
    return f" By its form the unknown part could be {listed(list(names), ' or ')}, {size}"


def _likely_too(names: Sequence[str]) -> str:
    """A sentence on effects that are likely beside the named ones and change too little; '' for none."""
    return f" Likely as well, but worth too little to be named: {listed(list(names))}." if names else ""


def _open_below(result: Any) -> list[str]:
    """A line that announces ties of later steps; the first step's own words begin with its tie."""
    steps = zip(result.suggested, result.candidates, strict=False)
    ties = [step[0] if headline(step[0], step[1:], one.sum_of) else "" for step, one in steps]
    if not any(ties) or ties[0]:
        return []
    tied = [name for name in ties if name]
    each = "is" if len(tied) == 1 else "are each"
    return [f"Below, {listed(tied)} {each} one of several explanations that fit equally well."]


def doubted(result: Any) -> list[str]:
    """A sentence on the probability that an unknown is part of what is named.

    Args:
        result: a diagnosis that names something.

    Returns:
        One sentence; none where that is improbable.
    """
    chance = result.verdict_probability["unknown"]
    if chance <= 1.0 - SURE_VERDICT:
        return []
    return [f"There is a {chance:.0%} probability that part of this is something that no known effect describes."]


def _unsure(result: Any) -> str:
    """A sentence on the probability of a machine that is sound, and of what else may be; '' where it is sure."""
    chance = result.verdict_probability
    if chance[result.verdict] >= SURE_VERDICT:
        return ""
    others = {"missing": "that an effect is missing", "unknown": "that something is missing that no effect describes"}
    told = [f"{chance[name]:.0%} {what}" for name, what in others.items() if chance[name] > 1.0 - SURE_VERDICT]
    against = f", against {listed(told)}" if told else ""
    return f" This is {chance[result.verdict]:.0%} probable{against}; a longer run, or another one, would tell."


def _unknown(result: Any, told: Sequence[str], *, cut_short: bool) -> list[str]:
    """Lines of an unknown: that it is there, what it depends on, and what is named; `cut_short`: at the step limit."""
    strongest = result.depends_on[0] if result.depends_on else None
    # Only the residual tests may have forced the verdict, against the scored sets.
    overruled = result.verdict_probability[result.verdict] <= EVEN_CHANCE
    what = "More is missing, but no more steps were allowed" if cut_short else MISSING
    reasons = result.rest.reasons
    lines = [f"{what}: {reasons[0]}." if reasons and (overruled or not strongest) else f"{what}."]
    most = f"{MOSTLY_UNTOLD}. " if strongest and mostly_untold(result) else ""
    if strongest:
        bent = "" if strongest.acts_on == "load" else _bent(result, strongest.on)
        lines.append(f"{most}{depends(strongest)}{bent}{untested(result, strongest)}")
    if 0 < len(told) <= MOST_UNKNOWN_LINES - 1 - len(lines):
        lines += [f"Also identified: {step}" for step in told]
    elif told:
        names = listed([step[0] for step in result.suggested])
        lines.append(f"Also identified: {names}; the candidates say what each means.")
    return lines


def held_to_base(error_um: float) -> str:
    """A sentence on the tracker's frame, which base reflectors hold in other commands.

    Args:
        error_um: of the model as given, as `ptt compare` and `ptt add` print it.
    """
    return (
        " (Here the tracker's frame is fitted together with everything that explains the readings. In the frame of the "
        f"base reflectors, which `compare` and `add` use, the error of the model as given is {error_um:.1f} um.)"
    )


def with_free_mount(before_um: float, after_um: float, called: str) -> str:
    """Sentences on an arm's reflector, which the machine file trusts to be at the tool point.

    Args:
        before_um: error of a model.
        after_um: the same, the reflector free to sit elsewhere.
        called: the model in words.
    """
    return (
        'With tool = "trusted" the machine file says that the reflector sits exactly at the tool point. With tool = '
        f'"fitted" under [tracker] the error of {called} is {after_um:.1f} um instead of {before_um:.1f} um: '
        "measure where the reflector sits, or let it be fitted, before any effect is added."
    )


def _bent(result: Any, followed: str) -> str:
    """A sentence where a named effect and the unknown depend on the same column, so that one cause may be both."""
    named = {step[0] for step in result.suggested}
    columns = {term.effect.key: LAW_COLUMN.get(card_of(term.effect).telling, "") for term in result.model.terms}
    each = [key for key, on in columns.items() if key in named and on == followed]
    if not each:
        return ""
    depends_too, it = ("depends", "it") if len(each) == 1 else ("depend", "them")
    bent = f"this may be a nonlinearity of {it} rather than another cause"
    return (
        f" As {listed(each)} also {depends_too} on {followed}, {bent}; the fitted values then hold for this run only."
    )


def _spoken(on: str) -> str:
    """A variable by its column; moves of the tool and loads of joints, which are no columns, are described."""
    told = described(on)
    return f"{told} ({on})" if told else on


def _each(names: Sequence[str], name_of: Callable[[str], str]) -> list[str]:
    """Variables that are followed together; all of gravity's components at once."""
    others = [name_of(name) for name in names if name not in GRAVITY]
    if not {*GRAVITY} <= {*names}:
        return [name_of(name) for name in names]
    return [*others, f"how gravity lies in the tool's own frame ({GRAVITY[0]} to {GRAVITY[-1]})"]


def depends(strongest: Dependence, name_of: Callable[[str], str] = _spoken) -> str:
    """What the largest unknown depends on, with its size and direction, in one line.

    Args:
        strongest: the dependence.
        name_of: how a variable is called in a sentence.

    Returns:
        One or two sentences.
    """
    period = f" with a period of {strongest.period_mm:.4g} {strongest.unit}".rstrip() if strongest.period_mm else ""
    share = f"({_share(strongest, name_of)}){acting(strongest.acts_on, strongest.residual)}"
    size = f" {strongest.words}" if strongest.words else ""
    rest = capital(remaining_error(strongest.residual))
    if strongest.place and strongest.shape == "step" and not strongest.with_:
        where = f"where {name_of(strongest.on)} passes {middle(*strongest.place, strongest.unit)}"
        where = changed_at(*strongest.place, strongest.unit) if strongest.on == "time" else where
        return f"{rest} jumps {where} {share}.{size}"
    rivals = [name_of(rival.removeprefix(f"{strongest.residual} on ")) for rival in strongest.rivals]
    alike = f" {capital(listed(rivals))} would describe it about as well on this run." if rivals else ""
    if strongest.moments:
        return f"{rest} switches between levels, {switched_at(strongest.moments, strongest.unit)} {share}.{size}{alike}"
    place = f" near {middle(*strongest.place, strongest.unit)}" if strongest.place else ""
    place = f", by an amount that varies with {name_of(strongest.with_)}" if strongest.with_ else place
    place = " and turns over gradually after a reversal" if strongest.shape == "gradual" else place
    on = name_of(strongest.on) if strongest.on != "time" or strongest.unit else "the number of the row"
    if strongest.together:
        on = f"{listed(_each(strongest.together, name_of))} together"
    if strongest.on == f"direction{strongest.residual.split()[-1]}":
        on = f"its direction of arrival{f' ({on})' if on == strongest.on else ''}"
    return f"{rest} depends on {on}{period}{place} {share}.{size}{alike}"


def _share(item: Dependence, name_of: Callable[[str], str]) -> str:
    """What a variable explains of the variance, or several together and this one alone."""
    alone = "" if item.alone_share is None else f", {name_of(item.on)} alone {100.0 * item.alone_share:.0f} %"
    return f"{100.0 * item.share:.0f} % of its variance{alone}"


def mostly_untold(result: Any) -> bool:
    """Whether what an unknown depends on most explains next to nothing of an error that exceeds the noise.

    So it is on a run of a few poses, and where an axis that hardly errs follows what the others do not: a frame that is
    fitted to errors in z tilts. Where the noise is most of what is left, a small share may be the whole unknown.

    Args:
        result: a diagnosis.
    """
    after = result.rms_um["after"]
    if not result.depends_on or not after["total"] > NOTED_EXCESS * result.noise.total * 1e3:
        return False
    first = result.depends_on[0]
    of_axis = first.acts_on is None and first.residual in AXES
    part = (after[first.residual] / after["total"]) ** 2 if of_axis else 1.0
    return bool(first.share * part < MINOR_SHARE)


def acting(place: str | None, residual: str) -> str:
    """A clause on where an unknown acts, if the name of its residual does not say so.

    Args:
        place: `Dependence.acts_on`.
        residual: in which it shows.

    Returns:
        For example ', as if rail 2 moved outward'; '' where the residual says it or it is not known.
    """
    if place is None or place == residual or place in ("x", "y", "z"):
        return ""
    if place == "set-up":
        return ", as if tracker and machine moved against each other"
    if place == "load":
        return ", as if the load's centre lay beside the tool point"
    if place == "mount":
        return f", as if the tool moved in its holder, along its own {residual}"
    if place.startswith("link"):
        return f", as if {place} changed its length"
    return f", as if {place.rsplit(' ', 1)[0]} moved {place.rsplit(' ', 1)[1]}"


def _unstated(noise: Noise) -> str:
    """A sentence where the noise is known only from residuals; '' otherwise."""
    if noise.source == VISITED:
        return (
            " Readings within one visit to a pose scatter less. Whether the difference belongs to the pose or to the "
            "visit these readings cannot tell; revisit some poses from elsewhere."
        )
    if noise.source != SATURATED:
        return ""
    return (
        " The noise is known only from the residuals, so an error that changes from each reading to the next would be "
        "counted as noise; repeated poses, or sigma_mm in the machine file, would reveal it."
    )


def _beyond_stated(noise: Noise) -> str:
    """A clause on how much more repeats scatter than is stated, where that is notable."""
    if noise.stated is None or noise.total < NOTED_EXCESS * noise.stated[1]:
        return ""
    source, total = noise.stated
    return f", {noise.total / total:.1f} times the value in {source_in_words(source)}"


def excess_in_words(after_um: float, noise: Noise, wander: Slow | None) -> str:
    """A sentence where much more is left than the noise: a slow wander, or something that was not recorded.

    Args:
        after_um: what is left.
        noise: the noise floor.
        wander: the noise's wander; None for none.

    Returns:
        The sentence with a space before it; '' where no more is left.
    """
    times = after_um / max(noise.total * 1e3, 1e-12)
    if times < NOTED_EXCESS:
        return ""
    if wander is not None:
        size = wander.size * noise.total * 1e3
        return f" What remains varies slowly: the readings wander by {size:.1f} um {wander.lasts}."
    return f" {beyond_noise('This', times, noise.source)}."
