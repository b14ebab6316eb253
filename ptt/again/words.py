"""A recheck in words: which value is otherwise than it was, on which side, by how much, and since when."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np
import torch

from ptt.again.figures import TOTAL, Moved
from ptt.effects import Effect
from ptt.effects.layout import family
from ptt.effects.phrases import Said, capital, compose, figure, listed, sizes_in_words
from ptt.run.view import View

WORST = 3  # effects that are worth a word after a repair


def on_date(since: str | None) -> str:
    """When the model was made, as in 'on 15 March 2026'."""
    if since is None:
        return "by the model"
    try:
        day = datetime.fromisoformat(since)
    except ValueError:
        return f"on {since}"
    return f"on {day.day} {day:%B %Y}"


def say_change(effect: Effect, place: int, moved: Moved, view: View, since: str | None, repaired: bool) -> str:
    """One value that has changed.

    Args:
        effect: that it is a value of.
        place: of the value in the effect's flat parameters.
        moved: then and now.
        view: of the machine.
        since: date of the model.
        repaired: whether it is back near zero.

    Returns:
        For example 'Slider 2 loses 55 um on reversal, 25 um more than on 15 March 2026.'
    """
    then, noun = on_date(since), _noun(effect, view)
    before, now = (_say(effect, place, value, view) for value in (moved.before, moved.now))
    if before is None or now is None:
        body = f"{moved.effect} {moved.name} is {moved.now:.4g} {moved.unit}, {then} it was {moved.before:.4g}"
        return f"{'Repaired: ' if repaired else ''}{body}."
    if repaired:
        left = replace(now, size=np.copysign(now.size, moved.now * moved.before))
        error = figure(moved.std * abs(now.size / moved.now) if moved.now else 0.0)
        model = "by the model" if since is None else f"by the model of {then.removeprefix('on ')}"
        return f"Repaired: {compose([before], noun)} {model}, {sizes_in_words([left])} (+- {error}) in this run."
    return f"{capital(_beside(before, now, noun, then))}."


def say_whole(effect: Effect, at: np.ndarray, values: Sequence[Moved], view: View, since: str | None) -> str:
    """All values of an effect that have changed in proportion.

    Args:
        effect: the effect.
        at: (m,) places of the values in its flat parameters.
        values: then and now.
        view: of the machine.
        since: date of the model.

    Returns:
        For example 'Backlash is as a whole 2 % (+- 1) of what it was on 15 March 2026, when sliders 1 and 2 lost ...'.
    """
    most = max(values, key=lambda value: abs(value.before))
    share, error = most.now / most.before, most.std / abs(most.before)
    theta = torch.zeros(sum(parameter.size(view.joints) for parameter in effect.parameters), dtype=torch.float64)
    theta[torch.as_tensor(at)] = torch.tensor([value.before for value in values], dtype=torch.float64)
    said = _parts(effect, theta, view)
    what = f": {compose(said, _noun(effect, view))}" if said else ""
    cured = "Repaired: " if abs(share) < max(0.2, 3.0 * error) and abs(share) < 0.5 else ""
    name = effect.called or effect.key
    body = f"{name} as a whole is {100.0 * share:.0f} % (+- {100.0 * error:.1g}) of what it was {on_date(since)}{what}"
    return f"{cured}{body if cured else capital(body)}."


def _noun(effect: Effect, view: View) -> str:
    return effect.arm_noun if family(view) == "serial" else effect.noun


def _beside(before: Said, now: Said, noun: str, then: str) -> str:
    if before.size == 0.0:
        return f"{compose([now], noun)}, which it did not {then}"
    if now.size == 0.0:
        return f"{compose([before], noun)} {then}, and no longer does"
    if before.text != now.text:
        return f"{compose([now], noun)}; {then}: {compose([before], noun)}"
    more, step = now.size > before.size, replace(now, size=abs(now.size - before.size))
    return f"{compose([now], noun)}, {sizes_in_words([step])} {'more' if more else 'less'} than {then}"


def _say(effect: Effect, place: int, value: float, view: View) -> Said | None:
    """The words for one value of an effect; None where it has none."""
    theta = torch.zeros(sum(parameter.size(view.joints) for parameter in effect.parameters), dtype=torch.float64)
    theta[place] = value if value else 1e-30
    part = max(_parts(effect, theta, view), key=lambda one: one.worth, default=None)
    if part is None or part.worth == 0.0:
        return None
    return part if value else replace(part, size=0.0, worth=0.0)


def _parts(effect: Effect, theta: torch.Tensor, view: View) -> tuple[Said, ...]:
    try:
        return tuple(effect.say(theta, torch.full_like(theta, torch.nan), view))
    except (ValueError, IndexError, ZeroDivisionError):  # a curve of one value is no curve
        return ()


def explain(result: Any) -> str:
    """The verdict of a recheck.

    Args:
        result: the recheck: verdict, changed, new, error_um, made_um, noise_um, since.

    Returns:
        Lines, each one thing.
    """
    then, errors, noise = on_date(result.since), result.error_um, result.noise_um["total"]
    floor = f"the noise of this run is {noise:.1f} um"
    if result.verdict == "same":
        return (
            f"Nothing that this run could show has changed since the model was made ({then}): the error is "
            f"{errors['now']:.1f} um, {errors['expected']:.1f} um was to be expected; {floor}."
        )
    lines, told = [], set[str]()
    for item in result.changed:
        if item.words in told:
            continue
        told.add(item.words)
        tie = tie_words(item.indistinguishable_from, f"{item.moved.effect} {item.moved.name}")
        sure = f"{abs(item.moved.z):.1f} standard errors of the difference"
        lines.append(f"{tie + ' ' if tie else ''}{item.words} ({sure})")
    lines += _after_repair(result)
    if result.new is not None:
        lines.append(f"Something is new that the model of {then.removeprefix('on ')} does not have.")
        lines.append(result.new.words)
    lines.append(
        f"With the model as it was the error is {errors['now']:.1f} um, where {errors['expected']:.1f} um was to be "
        f"expected; with the changes named it is {errors['left']:.1f} um; {floor}."
    )
    return "\n".join(lines)


def _after_repair(result: Any) -> list[str]:
    """Whether a repair helped, and what is left."""
    cured = list(dict.fromkeys(item.moved.effect for item in result.changed if item.repaired))
    if not cured:
        return []
    before, now = result.made_um["before"], result.made_um["now"]
    order = sorted((key for key in now if key != TOTAL), key=lambda key: -now[key])
    rest = listed([f"{key} {now[key]:.1f} um" for key in order[:WORST]])
    helped = "helped" if now[TOTAL] < before[TOTAL] else "took its own error away, yet the tool does not gain"
    return [
        f"The repair {helped}: what the effects of the model do to the tool in this run goes from {before[TOTAL]:.1f} "
        f"to {now[TOTAL]:.1f} um ({rest}). The old model still corrects what is no longer there: fit it to this run "
        "(ptt fit; of a fleet, ptt fleet accept)."
    ]


def tie_words(names: Sequence[str], own: str) -> str:
    """What would do as well."""
    if not names:
        return ""
    return f"Either {own} or {listed(list(names), ' or ')}: this run cannot tell them apart."
