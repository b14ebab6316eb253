"""A recheck in words: which value is otherwise than it was, on which side, by how much, and since when."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import torch

from ptt.again.figures import TOTAL, Moved
from ptt.effects import Effect
from ptt.effects.layout import family
from ptt.effects.phrases import ValuePhrase, capital, compose, figure, listed, sizes_in_words
from ptt.model.model import Term
from ptt.run.view import View

BY_CHANCE = 2.0  # standard errors of a difference, within which a value of the other sign counts as zero
OTHER_MACHINE = (
    "Most of what the model has is otherwise in this run, all at once: is it a run of another machine, or was this one "
    "rebuilt? Then the model does not hold for it, and a diagnosis from the drawing tells more."
)
REPAIRED = "Repaired: "  # another machine is not a repaired one
WORST = 3  # effects that are listed after a repair, largest tool error first


def on_date(since: str | None) -> str:
    """When the model was made, as in 'on 15 March 2026'."""
    if since is None:
        return "when the model was made"
    try:
        day = datetime.fromisoformat(since)
    except ValueError:
        return f"on {since}"
    return f"on {day.day} {day:%B %Y}"


def model_of(since: str | None) -> str:
    """The model by its date, as in 'the model of 15 March 2026'."""
    return "the model" if since is None else f"the model of {on_date(since).removeprefix('on ')}"


@dataclass(frozen=True)
class Values:
    """All P parameters of an effect, flat, in the model and in this run.

    Attributes:
        effect: the effect.
        then: in the model, searched and given ones included, (P,).
        now: in this run: as in the model but for the values that have changed, (P,).
        std: standard errors of the differences, zero where nothing has changed, (P,).
    """

    effect: Effect
    then: torch.Tensor
    now: torch.Tensor
    std: torch.Tensor

    def told(self, place: int, view: View) -> tuple[ValuePhrase, ValuePhrase] | None:
        """The phrases on one value, in the model and in this run; None where the effect has none on it.

        One phrase may be on several values, as on the cosine and the sine of a wave. A value's phrases are those that
        differ if it alone changes; the one of the largest worth is taken.

        Args:
            place: index of the value in the flat parameters.
            view: rows of the machine.
        """
        ends = []
        for here, there in ((self.then, self.now), (self.now, self.then)):
            other = here.clone()
            other[place] = there[place]
            same = _parts(self.effect, other, self.std, view)
            own = [part for part in _parts(self.effect, here, self.std, view) if part not in same]
            ends.append(max(own, key=lambda part: part.worth, default=None))
        before, now = ends
        return None if before is None or now is None else (before, now)


def values_of(term: Term, changed: Sequence[tuple[int, Moved]]) -> Values:
    """The parameters of an effect of a solved model, in the model and in this run.

    Args:
        term: the effect in the model.
        changed: of each value that has changed its index in the flat parameters, and its figures.

    Returns:
        The values.
    """
    now, std = term.theta.clone(), torch.zeros_like(term.theta)
    for place, moved in changed:
        now[place], std[place] = moved.now, moved.std
    return Values(term.effect, term.theta, now, std)


def say_change(
    effect: Effect,
    told: tuple[ValuePhrase, ValuePhrase] | None,
    moved: Moved,
    view: View,
    since: str | None,
    repaired: bool,
) -> str:
    """Sentence on one value that has changed.

    Args:
        effect: whose value it is.
        told: phrases on it in the model and in this run; None where the effect has none.
        moved: its figures.
        view: rows of the machine.
        since: date of the model, ISO 8601; None where it is not known.
        repaired: whether it is back near zero.

    Returns:
        For example 'Slider 2 loses 55 um on reversal, 25 um more than on 15 March 2026.'
    """
    then, noun = on_date(since), _noun(effect, view)
    if told is None:
        body = f"{moved.effect} {moved.name} is {moved.now:.4g} {moved.unit}; {then} it was {moved.before:.4g}"
        return f"{REPAIRED if repaired else ''}{body}."
    error = figure(told[1].error)
    before, now = (replace(part, error=0.0) for part in told)  # `explain` states the significance
    if repaired:
        beyond = moved.now * moved.before < 0.0 and before.text != now.text and before.size > 0.0
        left = replace(now, size=-now.size) if beyond else now
        now_words = f"{sizes_in_words([left])} (+- {error}) in this run"
        return f"{REPAIRED}{compose([before], noun)} in {model_of(since)}, and {now_words}."
    less = min(before.size, now.size)
    if before.text != now.text and less < BY_CHANCE * told[1].error:  # the other sign is by chance
        before, now = (replace(part, size=0.0) if part.size == less else part for part in (before, now))
    return f"{capital(_beside(before, now, noun, since))}."


def say_whole(values: Values, moved: Sequence[Moved], view: View, since: str | None, *, repaired: bool) -> str:
    """Sentence on values of an effect that have changed in proportion.

    Args:
        values: of the effect.
        moved: figures of each value.
        view: rows of the machine.
        since: date of the model, ISO 8601; None where it is not known.
        repaired: whether all of them are back near zero.

    Returns:
        For example 'Backlash as a whole is 2 % (+- 1) of what it was on 15 March 2026 (then: slider 1 loses ...).'
    """
    effect, most = values.effect, max(moved, key=lambda value: abs(value.before))
    share, error = most.now / most.before, most.std / abs(most.before)
    said = _parts(effect, values.then, torch.zeros_like(values.then), view)
    what = f" (then: {compose(said, _noun(effect, view))})" if said else ""
    name = effect.called or effect.key
    body = f"{name} as a whole is {100.0 * share:.0f} % (+- {100.0 * error:.1g}) of what it was {on_date(since)}{what}"
    return f"{REPAIRED}{body}." if repaired else f"{capital(body)}."


def say_gone(words: str, effect: Effect, was: float, now: float) -> str:
    """Sentence on a value that has changed sides, while its effect's tool error is gone.

    Args:
        words: on the change.
        effect: whose value it is.
        was: tool error that it would cause in this run with the model's values, um.
        now: with those of this run, um.
    """
    return (
        f"{words.removesuffix('.')}; with that the tool error by {effect.called or effect.key} falls from {was:.1f} to "
        f"{now:.1f} um, as after a repair: its values count against each other."
    )


def _noun(effect: Effect, view: View) -> str:
    return effect.arm_noun if family(view) == "serial" else effect.noun


def _beside(before: ValuePhrase, now: ValuePhrase, noun: str, since: str | None) -> str:
    if before.size == 0.0:
        return f"{compose([now], noun)} in this run, but not in {model_of(since)}"
    if now.size == 0.0:
        return f"{compose([before], noun)} in {model_of(since)}, but not in this run"
    if before.text != now.text:
        return f"{compose([now], noun)}; in {model_of(since)}, {compose([before], noun)}"
    more, step = now.size > before.size, replace(now, size=abs(now.size - before.size))
    return f"{compose([now], noun)}, {sizes_in_words([step])} {'more' if more else 'less'} than {on_date(since)}"


def _parts(effect: Effect, theta: torch.Tensor, std: torch.Tensor, view: View) -> tuple[ValuePhrase, ...]:
    try:
        return tuple(effect.say(theta, std, view))
    except (ValueError, IndexError, ZeroDivisionError):  # a curve of one value is no curve
        return ()


def explain(result: Any) -> str:
    """The verdict of a recheck in sentences.

    Args:
        result: a `ptt.again.result.Recheck`, whose words are still empty.

    Returns:
        One line for each statement.
    """
    errors, noise = result.error_um, result.noise_um["total"]
    floor = f"the noise of this run is {noise:.1f} um"
    expected = f"{errors['now']:.1f} um, where {errors['expected']:.1f} um was expected"
    if result.verdict == "same":
        made = "" if result.since is None else f" ({on_date(result.since)})"
        return (
            f"Nothing that this run could show has changed since the model was made{made}: the error is {expected}; "
            f"{floor}."
        )
    lines, told = [OTHER_MACHINE] if result.other_machine else [], set[str]()
    for item in result.changed:
        if item.words in told:
            continue
        told.add(item.words)
        tie = tie_words(item.indistinguishable_from, f"{item.moved.effect} {item.moved.name}")
        sure = f"{abs(item.moved.z):.1f} standard errors of the difference"
        words = capital(item.words.removeprefix(REPAIRED)) if result.other_machine else item.words
        lines.append(f"{tie + ' ' if tie else ''}{words.removesuffix('.')} ({sure}).")
    lines += [] if result.other_machine else _after_repair(result)
    if result.new is not None:
        lines.append(f"Something is new that {model_of(result.since)} does not have.")
        lines.append(result.new.words)
    left = f"with the named changes it is {errors['left']:.1f} um; " if result.changed else ""
    lines.append(f"With the old model unchanged the error is {expected}; {left}{floor}.")
    return "\n".join(lines)


def _after_repair(result: Any) -> list[str]:
    """Whether a repair lowered the tool error, and the largest errors that remain; empty without a repair."""
    cured = list(dict.fromkeys(item.moved.effect for item in result.changed if item.repaired))
    if not cured:
        return []
    before, now = result.made_um["before"], result.made_um["now"]
    order = sorted((key for key in now if key != TOTAL), key=lambda key: -now[key])
    rest = listed([f"{key} {now[key]:.1f} um" for key in order[:WORST]])
    falls = now[TOTAL] < before[TOTAL]
    helped = "helped" if falls else "removed what it was for, but the tool is no more accurate"
    return [
        f"The repair {helped}: in this run the tool error due to the model's effects {'falls' if falls else 'rises'} "
        f"from {before[TOTAL]:.1f} to {now[TOTAL]:.1f} um (now {rest}). The old model still corrects what is no longer "
        "there: refit it to this run (ptt fit; in a fleet, ptt fleet accept)."
    ]


def tie_words(names: Sequence[str], own: str) -> str:
    """A sentence on what explains the run as well; '' without any."""
    if not names:
        return ""
    return f"Either {own} or {listed(list(names), ' or ')}: this run cannot tell them apart."
