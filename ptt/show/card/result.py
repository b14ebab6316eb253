"""The result card: verdict, errors, findings with their sizes, cures and ties, and what to measure next."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.explanation import Candidate
from ptt.diagnosis.telling.verdict_words import (
    MISSING,
    MOSTLY_UNTOLD,
    depends,
    doubted,
    excess_in_words,
    mostly_untold,
)
from ptt.diagnosis.telling.words import doubt_in_words, headline, remedy, sentence
from ptt.effects.cards import card_of
from ptt.effects.layout import family
from ptt.effects.phrases import ONE, ValuePhrase, capital, sizes_in_words, worth_saying
from ptt.fitting.gauge import GaugedTerm, sparsest
from ptt.record import Record
from ptt.run.problem import Problem
from ptt.show.card.words import in_prose, length, pretty

VALUES = 6  # listed of one finding at most
OFF_SCALE = 10.0  # usual sizes above which a value is flagged: the drawing or a unit may be wrong


@dataclass(frozen=True)
class CauseValue:
    """One value of a finding.

    Attributes:
        who: the part that has it: 'slider 2', 'link 1', 'column'.
        joint: number of the joint, from 1; 0 where it belongs to none.
        text: predicate with the size, as in 'is 201 um too long'.
        size: absolute value, in `unit`.
        error: standard error, in `unit`; None where unknown.
        unit: as in the text.
        worth: size in units of the usual size.
        side: which way: the words after the size, as in 'too long'.
    """

    who: str
    joint: int
    text: str
    size: float
    error: float | None
    unit: str
    worth: float
    side: str = ""


@dataclass(frozen=True)
class Cause:
    """One finding: an effect that the diagnosis suggests.

    Attributes:
        effect: its key.
        words: direction and size in one sentence.
        cause: what is wrong with a machine that has this effect, from the effect's card.
        values: its values.
        cure: what to turn, move or enter, and by how much; where that is unknown, the remedy of the effect's card; ''
            where the set-up has errors that nothing explains.
        probability: that it is part of what is missing, 0 to 1.
        tie: sentence on what it cannot be told from; '' where there is nothing.
        others: keys of effects that explain the readings as well.
        before_um: held-out rms error before this step.
        after_um: held-out rms error with it.
        off_scale: whether a value exceeds `OFF_SCALE` usual sizes.
    """

    effect: str
    words: str
    cause: str
    values: tuple[CauseValue, ...]
    cure: str
    probability: float
    tie: str
    others: tuple[str, ...]
    before_um: float
    after_um: float
    off_scale: bool


@dataclass(frozen=True)
class DiagnosisCard(Record):
    """A diagnosis in short.

    Attributes:
        verdict: 'missing', 'nothing-missing' or 'unknown'.
        probability: of the verdict, 0 to 1.
        title: the verdict in a line.
        words: one or more sentences on it.
        error_um: rms error of the model as given.
        left_um: rms error with all findings.
        noise_um: noise of one reading, total.
        findings: in the order of the steps.
        measure_next: what to measure to resolve ties, or to show an unknown better, a line each.
    """

    verdict: str
    probability: float
    title: str
    words: str
    error_um: float
    left_um: float
    noise_um: float
    findings: tuple[Cause, ...]
    measure_next: tuple[str, ...]


def card_of_diagnosis(found: Diagnosis, problem: Problem) -> DiagnosisCard:
    """Put a diagnosis in short.

    Args:
        found: the diagnosis.
        problem: the readings; values are stated in the gauge that is sparsest on them.

    Returns:
        The card.
    """
    steps = found.candidates[: len(found.suggested)]
    findings = tuple(_finding(one, tied, found, problem) for one, tied in zip(steps, found.suggested, strict=True))
    noise = found.noise.to_dict()
    return DiagnosisCard(
        verdict=found.verdict,
        probability=float(found.verdict_probability.get(found.verdict, 0.0)),
        title=_title(found, findings),
        words=pretty(f"{_set_up(found)}{_words(found, problem)}{_doubt(steps)}{_far(found)}"),
        error_um=float(found.rms_um["before"]["total"]),
        left_um=float(found.rms_um["after"]["total"]),
        noise_um=float(noise["total"]),
        findings=findings,
        measure_next=tuple(map(pretty, found.measure_next)),
    )


def _title(found: Diagnosis, findings: Sequence[Cause]) -> str:
    if found.verdict == "nothing-missing":
        return "Nothing is missing"
    if found.verdict == "unknown":
        return MISSING
    ties = sum(bool(one.tie) for one in findings)
    count = {1: "One cause", 2: "Two causes", 3: "Three causes"}.get(len(findings), f"{len(findings)} causes")
    if found.first:
        return f"{count} found, as the machine file stands"
    if ties == len(findings) == 1:
        return "One cause, which this run cannot tell from another"
    return f"{count} found" + (f"; {'one' if ties == 1 else ties} cannot be told from another" if ties else "")


def _set_up(found: Diagnosis) -> str:
    """Sentences on errors in the set-up that nothing explains, and on what to settle first, or ''."""
    return "".join(f"{capital(said)} " for said in (found.unexplained, found.first) if said)


def _words(found: Diagnosis, problem: Problem) -> str:
    """The errors, or, of an unknown, what it depends on or why nothing can be said."""
    before, after = (float(found.rms_um[when]["total"]) for when in ("before", "after"))
    noise = found.noise.total * 1e3
    if found.verdict == "nothing-missing":
        if after > noise:  # by chance, by a wander, or beside a stated figure that is too small
            apart = f"The error is {length(after)}; the readings scatter by {length(noise)}."
            return f"{apart}{excess_in_words(after, found.noise, found.wander)}"
        return f"The error of {length(after)} is no more than the scatter of the readings ({length(noise)})."
    if found.verdict == "missing":
        them = "it" if len(found.suggested) == 1 else "them"
        fall = f"the error falls from {length(before)} to {length(after)}"
        return " ".join([f"With {them} {fall}; the readings scatter by {length(noise)}.", *doubted(found)])
    if found.depends_on:
        serial = family(problem.view) == "serial"
        most = f"{MOSTLY_UNTOLD}. " if mostly_untold(found) else ""
        return most + depends(found.depends_on[0], lambda on: in_prose(on, serial))
    reasons = found.rest.reasons
    return f"{capital(reasons[0])}." if reasons else ""


def _far(found: Diagnosis) -> str:
    """Sentence on the error in the rest of the workspace, or ''."""
    words = "" if found.elsewhere is None else found.elsewhere.words(float(found.rms_um["after"]["total"]))
    return f" {words.partition(';')[0]}." if words else ""


def _doubt(steps: Sequence[Candidate]) -> str:
    """Sentence on how far the tool may be off without any reading showing it, or ''."""
    words = doubt_in_words(steps[-1].heldout_after, steps[-1].tool_doubt) if steps else ""
    return f" {capital(words)}." if words else ""


def _finding(one: Candidate, tied: Sequence[str], found: Diagnosis, problem: Problem) -> Cause:
    term = next(term for term in found.model.terms if term.effect.key == one.effect)
    beside = [other for other in found.model.terms if other is not term]
    told = sparsest([term], problem, found.noise, beside=beside, extra=found.fitted.unnamed_covariance)[0]
    words, card = sentence(told, problem.view), card_of(term.effect).on(family(problem.view))
    values = tuple(_value(part, noun_of(told, problem)) for part in _said(told, problem)[:VALUES])
    return Cause(
        effect=one.effect,
        words=pretty(f"{capital(words)}."),
        cause=card.cause,
        values=values,
        # Columns that disagree by more than any machine error, or a reflector beside the tool point, are no reason to
        # adjust the machine.
        cure=pretty(remedy(told, problem.view) or card.remedy.rstrip(".")) if found.is_settled else "",
        probability=float(one.probability),
        tie=pretty(headline(one.effect, tied[1:], one.sum_of)),
        others=tuple(tied[1:]),
        before_um=float(one.heldout_before),
        after_um=float(one.heldout_after),
        off_scale=any(value.worth > OFF_SCALE for value in values),
    )


def noun_of(told: GaugedTerm, problem: Problem) -> str:
    """What the joints of an effect are called on this machine."""
    effect = told.term.effect
    return effect.arm_noun if family(problem.view) == "serial" else effect.noun


def _said(told: GaugedTerm, problem: Problem) -> list[ValuePhrase]:
    """Phrases for the values that are worth saying; for the largest one where none is."""
    effect, theta = told.term.effect, told.term.theta
    std = torch.full_like(theta, torch.nan) if told.term.std is None else told.term.std
    parts = effect.say(theta, std, problem.view)
    return worth_saying(parts) or sorted(parts, key=lambda part: -part.worth)[:1]


def _value(part: ValuePhrase, noun: str) -> CauseValue:
    who = part.who or (f"{noun} {part.joint}" if part.joint else "machine")
    error = None if part.error != part.error else float(part.error)
    text = part.text.format(what=sizes_in_words([part]), **ONE)
    side = part.text.partition("{what}")[2].format(**ONE).strip()
    return CauseValue(
        who, part.joint, pretty(text), float(part.size), error, pretty(part.unit), float(part.worth), pretty(side)
    )
