"""The verdict of a diagnosis in words, and what an unknown follows."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from ptt.dependence.said import MOVES, middle
from ptt.diagnosis.noise.slow import Slow
from ptt.diagnosis.telling.words import headline
from ptt.effects.cards import card_of
from ptt.effects.phrases import listed
from ptt.run.noise import SATURATED, VISITED, Noise

MISSING = "Something is missing that no known effect describes"
NOTED = 1.5  # times the noise that are worth a word
EVEN = 0.5  # probability of a verdict that tests of the rest gave, and not the sets of effects
LINES = 5  # that anybody reads
# What an effect's own variable is called among the columns of a run; joints and places vary with too many effects.
COLUMN = {"payload": "payload", "load": "payload", "link force": "payload", "temperature": "temperature"}


class Strongest(Protocol):
    """What the leading unknown depends on, as `ptt.dependence.dependence.Dependence` says it."""

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


def explain_verdict(result: Any, steps: int | None = None) -> str:
    """The verdict of a diagnosis.

    Args:
        result: the diagnosis: verdict, suggested, candidates, depends_on, rest, noise, rms_um, rows.
        steps: how many effects could be added; None for as many as it takes.

    Returns:
        Text; of an unknown at most five lines, and one on the workspace.
    """
    count = len(result.suggested)
    named = {step[0] for step in result.suggested}
    columns = {term.effect.key: COLUMN.get(card_of(term.effect).telling, "") for term in result.model.terms}
    followed = result.depends_on[0].on if result.depends_on else None  # the only one that is told in the verdict
    far = "" if result.elsewhere is None else result.elsewhere.words(result.rms_um["after"]["total"])
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
            overruled=result.verdict_probability[result.verdict] <= EVEN,
            bent={key: on for key, on in columns.items() if key in named and on == followed},
            cut_short=steps is not None and steps == count,
            wander=result.wander,
        ) + [far] * bool(far)
    )  # fmt: skip


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
    overruled: bool = False,
    bent: Mapping[str, str] | None = None,
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
        overruled: these say so alone, and the sets of effects do not.
        bent: of effects that are named, the column that they follow as the unknown does.
        cut_short: no more steps were allowed.
        wander: of the tracker's readings, where there is any.

    Returns:
        At most five lines where something unknown is missing; else one for each step and one for the errors.
    """
    before, after = error_um
    beyond = _beyond_stated(noise)
    floor = f"the noise {noise.total * 1e3:.1f} um ({noise.source}{beyond})"
    excess = _excess(after, noise, wander)
    if verdict == "nothing-missing":
        sound = f"Nothing is missing that these {rows} readings could show"
        varies = " Poses come back that badly, or something differs from visit to visit that no column tells."
        return [f"{sound}: the error is {after:.1f} um, {floor}.{varies if beyond else ''}{excess}{_unstated(noise)}"]
    same, way = f"{after:.1f}" == f"{before:.1f}", "down" if after < before else "up"
    fall = f"the error is {after:.1f} um, {'as it was' if same else f'{way} from {before:.1f} um'}; {floor}."
    if verdict == "missing":
        # A tie stands at the head of its step's words; a later one has to be heard of first, too.
        open_ones = [name for name, tie in zip(names, ties, strict=False) if tie]
        open_words = f"What is called {listed(open_ones)} below could as well be another effect."
        first = [open_words] if open_ones and not ties[0] else []
        return [*first, *steps, f"With that {fall}{excess}"]
    what = "More is missing, but no more steps were allowed" if cut_short else MISSING
    told = reasons and (overruled or not strongest)
    lines = [f"{what}: {reasons[0]}." if told else f"{what}."]
    lines += [f"{depends(strongest)}{_bent(bent or {})}"] if strongest else []
    if 0 < len(steps) <= LINES - 1 - len(lines):
        lines += [f"Named beside it: {step}" for step in steps]
    elif steps:
        lines.append(f"Named beside it: {listed(list(names))}; what each means is said with the candidates.")
    return [*lines, f"With what is named {fall}" if steps else f"The error is {after:.1f} um, {floor}."]


def _bent(bent: Mapping[str, str]) -> str:
    """A word where an effect that is named and the unknown beside it follow the same column: one cause may be both."""
    if not bent:
        return ""
    each = [f"{key} follows {column}" for key, column in bent.items()]
    law = "its law may be bent" if len(each) == 1 else "their laws may be bent"
    return f" As {listed(each)} too, {law} rather than another cause missing, and the value said of it holds here only."


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
