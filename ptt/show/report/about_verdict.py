"""Section of the report on the verdict: what is missing, why, and what could not be tested."""

from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.explanation import Candidate
from ptt.effects import Library
from ptt.effects.card import Card
from ptt.effects.cards import card_of
from ptt.effects.registry import parse_key
from ptt.judge.compare.rows import percent
from ptt.show.report.about_error import depends_grid
from ptt.show.report.blocks import Block, Lines, Section, Words, grid, side_by_side
from ptt.show.report.contents import Contents, ModelLook
from ptt.show.report.numbers import chance, plus_minus, um

NOTE = (
    "Share: part of the residual's variance that an effect explains by itself; p-value: corrected for the number of "
    "tests; J e: the error expressed as errors of the sliders or joints that would cause it."
)


def verdict_section(contents: Contents) -> Section:
    """The diagnoses of the bare drawing and of the model, with all candidates."""
    blocks = _diagnosis(contents.drawing, "the drawing", contents)
    if not contents.bare:
        blocks += [*_diagnosis(contents.given, "the model", contents)]
    return Section("verdict", "What is missing", tuple(blocks))


def _diagnosis(look: ModelLook, what: str, contents: Contents) -> list[Block]:
    found, known = look.diagnosis, contents.known
    if found is None:
        return [Words(f"No verdict on {what}: {look.why_not}.", "lack")]
    effects = f" ({', '.join(look.model.keys)})" if look.model.terms else ""
    blocks: list[Block] = [Words(f"{what.capitalize()}{effects}: {in_short(found)}", "verdict")]
    if found.candidates:
        blocks += [*_steps(found, known), *_others(found, known)]
    if found.depends_on:
        blocks.append(depends_grid(found.depends_on, "The remaining error depends on", contents.problem))
        if said := tuple(one.words for one in found.depends_on if one.words):
            blocks.append(Lines(said))
    if found.measure_next:
        blocks += [Words("Measure next:"), Lines(found.measure_next)]
    if found.not_testable:
        rows = [(name, lack) for name, lack in found.not_testable.items()]
        blocks.append(grid(f"Could not be tested on {what}", ("effect", "it needs"), rows, left=2))
    return blocks


def in_short(found: Diagnosis) -> str:
    """The verdict in a sentence or two; of a verdict 'missing' the effects by name, as each is described further below.

    Args:
        found: the diagnosis.

    Returns:
        The sentences, the first without a capital.
    """
    if found.verdict == "unknown":
        return f"no full explanation. {found.words}"
    if found.verdict == "nothing-missing":
        return f"{found.words[0].lower()}{found.words[1:]}"
    before, after = (found.rms_um[when]["total"] for when in ("before", "after"))
    steps = ", then ".join(" or ".join(step) for step in found.suggested)
    if found.first:
        would = f"As the machine file stands, {steps} would take the error from {before:.1f} to {after:.1f} um RMS"
        return f"something is missing. {found.first} {would}."
    return f"something is missing. Add {steps}: the error goes from {before:.1f} to {after:.1f} um RMS."


def _steps(found: Diagnosis, known: Library) -> list[Block]:
    steps = found.candidates[: len(found.suggested)]
    if not steps:
        return []
    rows = [(one.effect, *_figures(one), ", ".join(one.indistinguishable_from) or "nothing") for one in steps]
    head = ("step", "p-value", "share", "held-out um", "cannot be told from")
    blocks: list[Block] = [grid("What is added, in this order", head, rows, wordy=True)]
    for one in steps:
        cells = side_by_side([_value(*parameter) for parameter in one.parameters])
        blocks += [
            Words(f"{one.words} Its signature: {_card(one, found, known).fingerprint.rstrip('.')}."),
            grid(f"{one.effect}: parameters with one standard error", ("",) * 6, cells, left=6),
        ]
    note = "A value without an error was found by search, or is held near zero as the run does not determine it."
    return [*blocks, Words(note, "note")]


def _others(found: Diagnosis, known: Library) -> list[Block]:
    others = found.candidates[len(found.suggested) :]
    if not others:
        return []
    rows = [(one.effect, *_figures(one), _card(one, found, known).cause.rstrip(".")) for one in others]
    head = ("effect", "p-value", "share", "held-out um", "which would be")
    return [
        grid("What else would explain part of it, each by itself", head, rows, wordy=True),
        Words(NOTE, "note"),
    ]


def _figures(candidate: Candidate) -> tuple[str, str, str]:
    fall = f"{um(candidate.heldout_before)} \N{RIGHTWARDS ARROW} {um(candidate.heldout_after)}"
    return chance(candidate.p_value), percent(candidate.explained_share), fall


def _value(name: str, unit: str, value: float, std: float | None) -> tuple[str, str, str]:
    return name, plus_minus(value, std), unit


def _card(candidate: Candidate, found: Diagnosis, known: Library) -> Card:
    """The card of an effect, in the words of the machine's family."""
    return card_of(known[parse_key(candidate.effect)[0]]).on(found.model.file.machine.kind)
