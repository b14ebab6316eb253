"""The verdict of a diagnosis in words, and what an unknown follows."""

from collections.abc import Sequence
from typing import Any

from ptt.dependence.dependence import Dependence
from ptt.dependence.said import MOVES, middle
from ptt.diagnosis.noise.slow import Slow
from ptt.diagnosis.telling.words import headline
from ptt.effects.cards import card_of
from ptt.effects.phrases import listed
from ptt.run.noise import SATURATED, VISITED, Noise

MISSING = "Something is missing that no known effect describes"
UNLIKE = "which can hardly be told from what is unknown and is not named"
NOTED = 1.5  # times the noise that are worth a word
EVEN = 0.5  # probability of a verdict that tests of the rest gave, and not the sets of effects
SURE = 0.9  # probability of a verdict that needs no word on the others: of such statements 95 % and more are right
LINES = 5  # that anybody reads
# What an effect's own variable is called among the columns of a run; joints and places vary with too many effects.
COLUMN = {"payload": "payload", "load": "payload", "link force": "payload", "temperature": "temperature"}


def explain_verdict(result: Any, steps: int | None = None) -> str:
    """The verdict of a diagnosis line by line, each line one thing, what cannot be told apart first.

    Args:
        result: the diagnosis: verdict, suggested, candidates, depends_on, rest, noise, rms_um, rows.
        steps: how many effects could be added; None for as many as it takes.

    Returns:
        Text; of an unknown at most five lines, else one for each step and one for the errors; and one on the workspace.
    """
    before, after = (result.rms_um[stage]["total"] for stage in ("before", "after"))
    noise, excess = result.noise, _excess(after, result.noise, result.wander)
    beyond = _beyond_stated(noise)
    floor = f"the noise {noise.total * 1e3:.1f} um ({noise.source}{beyond})"
    same, way = f"{after:.1f}" == f"{before:.1f}", "down" if after < before else "up"
    fall = f"the error is {after:.1f} um, {'as it was' if same else f'{way} from {before:.1f} um'}; {floor}."
    told = [candidate.words for candidate in result.candidates[: len(result.suggested)]]
    if result.verdict == "nothing-missing":
        sound = f"Nothing is missing that these {result.rows} readings could show"
        varies = " Poses come back that badly, or something differs from visit to visit that no column tells."
        lines = [f"{sound}: the error is {after:.1f} um, {floor}.{varies if beyond else ''}{excess}{_unstated(noise)}"]
    elif result.verdict == "missing":
        lines = [*_open_below(result), *doubted(result), *told, f"With that {fall}{excess}"]
    else:
        lines = _unknown(result, told, cut_short=steps == len(told))
        more = f" The readings ask for {listed(result.perhaps)} as well, {UNLIKE}." if result.perhaps else ""
        lines += [f"{f'With what is named {fall}' if told else f'The error is {after:.1f} um, {floor}.'}{more}"]
    if result.elsewhere is not None and (far := result.elsewhere.words(after)):
        lines.append(far)
    return "\n".join(lines)


def _open_below(result: Any) -> list[str]:
    """That steps are tied: it stands at the head of its step's words, but a later one has to be heard of first, too."""
    steps = zip(result.suggested, result.candidates, strict=False)
    ties = [step[0] if headline(step[0], step[1:], one.sum_of) else "" for step, one in steps]
    if not any(ties) or ties[0]:
        return []
    return [f"What is called {listed([name for name in ties if name])} below could as well be another effect."]


def doubted(result: Any) -> list[str]:
    """That an unknown may do a part of what is named, where the sets of effects say so.

    Args:
        result: the diagnosis, of which something is named.

    Returns:
        One sentence; none where nothing says so.
    """
    chance = result.verdict_probability["unknown"]
    if chance <= 1.0 - SURE:
        return []
    return [f"With a probability of {chance:.0%} a part of this is something that no known effect describes."]


def _unknown(result: Any, told: Sequence[str], *, cut_short: bool) -> list[str]:
    """That something is missing, what it follows, and what is named beside it; `cut_short` if no more was allowed."""
    strongest = result.depends_on[0] if result.depends_on else None
    # Tests of the rest may say so alone, where the sets of effects do not.
    overruled = result.verdict_probability[result.verdict] <= EVEN
    what = "More is missing, but no more steps were allowed" if cut_short else MISSING
    reasons = result.rest.reasons
    lines = [f"{what}: {reasons[0]}." if reasons and (overruled or not strongest) else f"{what}."]
    lines += [f"{depends(strongest)}{_bent(result, strongest.on)}"] if strongest else []
    if 0 < len(told) <= LINES - 1 - len(lines):
        lines += [f"Named beside it: {step}" for step in told]
    elif told:
        names = listed([step[0] for step in result.suggested])
        lines.append(f"Named beside it: {names}; what each means is said with the candidates.")
    return lines


def held_to_base(error_um: float) -> str:
    """A word on the tracker's frame where base reflectors hold it in other commands.

    Args:
        error_um: of the model as given, as `ptt compare` and `ptt add` print it.
    """
    return (
        " (Here the tracker's frame is free, as it stands beside all that explains the readings. Held to the base "
        f"reflectors, as compare and add hold it, the error of the model as given is {error_um:.1f} um.)"
    )


def with_free_mount(error_um: float) -> str:
    """A word on an arm's reflector that the machine file trusts to sit where the drawing has the tool.

    Args:
        error_um: of the model as given, the reflector free to sit elsewhere.
    """
    return (
        ' (The machine file trusts the reflector to sit at the tool point, tool = "trusted". Free to sit elsewhere, '
        f'tool = "fitted", it leaves {error_um:.1f} um of the model as given: measure where it sits.)'
    )


def _bent(result: Any, followed: str) -> str:
    """A word where an effect that is named and the unknown beside it follow the same column: one cause may be both."""
    named = {step[0] for step in result.suggested}
    columns = {term.effect.key: COLUMN.get(card_of(term.effect).telling, "") for term in result.model.terms}
    each = [f"{key} follows {on}" for key, on in columns.items() if key in named and on == followed]
    if not each:
        return ""
    law = "its law may be bent" if len(each) == 1 else "their laws may be bent"
    return f" As {listed(each)} too, {law} rather than another cause missing, and the value said of it holds here only."


def depends(strongest: Dependence) -> str:
    """What the leading unknown follows, how large it is and which way it goes, in one line."""
    period = f" with a period of {strongest.period_mm:.4g} {strongest.unit}".rstrip() if strongest.period_mm else ""
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
    """A variable; the tool's moves are no columns of a table, so it is said what they are."""
    return f"{MOVES[on]} ({on})" if on in MOVES else on


def _unstated(noise: Noise) -> str:
    """A word where only the rest tells the noise: what changes from reading to reading counts as noise then."""
    if noise.source == VISITED:
        return (
            " Readings of one visit to a pose scatter by less: whether the rest belongs to the pose or to the visit no "
            "reading tells; come back to some poses from elsewhere."
        )
    if noise.source != SATURATED:
        return ""
    return (
        " Only what is left tells the noise: an error that changes from each reading to the next would hide in it; "
        "repeats of some poses, or sigma_mm in the machine file, would show it."
    )


def _beyond_stated(noise: Noise) -> str:
    """How much more repeats scatter than is stated, where that is worth a word."""
    if noise.stated is None or noise.total < NOTED * noise.stated[1]:
        return ""
    source, total = noise.stated
    return f", {noise.total / total:.1f} x what the {source} state{'' if source.endswith('s') else 's'}"


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
