"""The error as one stacked bar: the part that each finding removes, what stays without a name, and the noise."""

from collections.abc import Callable, Mapping
from html import escape
from typing import Any

from ptt.show.card.words import length

COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#8fb4d0", "#6a8ca8", "#b7c9d6")  # of findings; safe for colour blindness
UNNAMED, NOISE = "#d55e00", "#9aa3aa"
MOST_FINDINGS = 3  # shown at first by page and report; the others are one click away, or further below
LEAST_SHARE = 0.004  # of the bar, below which a part is left out


def parts_of_bar(card: Mapping[str, Any]) -> list[tuple[str, float, str]]:
    """The parts of an error: noise, what is left without a name, then the findings, the last one first.

    The reduction by each step is scaled so that all parts together give the error, as errors do not add up.

    Args:
        card: a result card as plain values.

    Returns:
        (words, length in um, colour) of each.
    """
    error, left, noise = (float(card[key]) for key in ("error_um", "left_um", "noise_um"))
    falls = [max(one["before_um"] - one["after_um"], 0.0) for one in card["findings"]]
    whole, error = sum(falls), max(error, left)
    share = (error - left) / whole if whole > 0.0 else 0.0
    rest = left if card["findings"] else error
    if card.get("verdict") == "nothing-missing":  # the rest differs from the noise floor by chance alone
        noise = rest = max(rest, 0.0)
        parts = [("left (noise)", rest, NOISE)]
    else:
        parts = [("noise", noise, NOISE) if rest >= noise else ("left (noise)", rest, NOISE)]
    parts.append(("without a name", max(rest - noise, 0.0), UNNAMED))
    named = [
        (one["effect"], share * fall, COLOURS[i % len(COLOURS)])
        for i, (one, fall) in enumerate(zip(card["findings"], falls, strict=True))
    ]
    return [part for part in (*parts, *reversed(named)) if part[1] > LEAST_SHARE * error]


def bar_html(card: Mapping[str, Any], say: Callable[[str], str] = lambda text: text) -> str:
    """The bar as HTML, with a legend.

    Args:
        card: a result card as plain values.
        say: translates words.

    Returns:
        An HTML fragment; its CSS classes begin with 'pc-'.
    """
    parts = parts_of_bar(card)
    whole = sum(size for _, size, _ in parts) or 1.0
    pieces = "".join(
        f'<span style="width:{100.0 * size / whole:.2f}%;background:{colour}"></span>' for _, size, colour in parts
    )
    lines = "".join(
        f'<li><i style="background:{colour}"></i>{escape(say(words))} <b>{length(size)}</b></li>'
        for words, size, colour in reversed(parts)
    )
    error = length(float(card["error_um"]))
    spoken = f"{say('error')} {error}: " + ", ".join(
        f"{say(words)} {length(size)}" for words, size, _ in reversed(parts)
    )
    return (
        f'<div class="pc-bar" role="img" aria-label="{escape(spoken)}">{pieces}</div>'
        f'<div class="pc-ends"><span>0</span><span>{escape(say("error"))} <b>{error}</b></span></div>'
        f'<ul class="pc-key">{lines}</ul>'
    )
