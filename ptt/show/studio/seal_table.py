"""The opened seal of a challenge as tables: hidden effects, the model's effects, and the true error of the tool."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ptt.effects.phrases import figure, scaled
from ptt.run.axes import AXES_TOTAL
from ptt.show.card.words import MICRO, length, parameter_in_words, prefixed
from ptt.show.studio.tables import table_html

MOST_NUMBERS = 6  # in one cell
UNIT = re.compile(r"_((?:nmm|um|mm|m|mrad|urad|rad|deg|n|kg|k|s|ms|h|c)(?:_per_[a-z]+(?:_[a-z]+)*)?)$")
SIGNS = {"n": "N", "nmm": "N mm", "k": "K", "c": "\N{DEGREE SIGN}C", "um": f"{MICRO}m", "urad": f"{MICRO}rad"}
TOLD = {
    "found": "found", "missed": "missed", "explained": "explained by others", "too small": "too small to count",
    "fair": "named in its place: this run cannot tell them apart", "partial": "helps, but is not what is hidden",
    "unclaimed": "not said to be there", "wrong": "nothing of the kind is hidden",
}  # fmt: skip


def seal_html(opened: Mapping[str, Any]) -> str:
    """An opened seal as HTML.

    Args:
        opened: JSON of `ptt challenge reveal`.

    Returns:
        HTML: a sentence, the table of effects, the table of the tool's error.
    """
    verdict = "Right: everything that counts was found." if opened["right"] else "Not right yet."
    noise = f"Noise of one reading {length(opened['noise_um']['total'])}; on the run without noise the model's effects"
    effects = table_html(
        ("effect", "told", "hidden in the machine", "in the model", "causes alone"), _effects(opened), words=4,
        caption="what was hidden and what was found",
    )  # fmt: skip
    tool = table_html(
        ("true error of the tool, rms", *AXES_TOTAL), _tool(opened["tool_error_um"]),
        caption="the tool measured again without noise",
    )  # fmt: skip
    return (
        f"<p><b>{verdict}</b> {noise} leave {length(opened['left_um'])}.</p>{effects}"
        f"<p>The commands of the model sent to the machine, after the best rigid motion:</p>{tool}"
    )


def _effects(opened: Mapping[str, Any]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        (item["effect"], _told(item), truth_in_words(item["truth"]), _model(item["model"]), length(item["size_um"]))
        for item in opened["hidden"]
    ]
    other = [item for item in opened["named"] if item["is"] != "right"]
    rows += [(item["effect"], TOLD[item["is"]], "\N{EN DASH}", _model(item["parameters"]), "") for item in other]
    return rows or [("nothing", "", "", "", "")]


def _told(item: Mapping[str, Any]) -> str:
    return TOLD[item["is"]] + (f" ({', '.join(item['instead'])})" if item["instead"] else "")


def truth_in_words(truth: Mapping[str, Any]) -> str:
    """Hidden values in words, each in a unit that suits it.

    Args:
        truth: name as in a rig's file, with its unit ('gap_mm', 'compliance_um_per_n') -> value or values.

    Returns:
        For example 'gap 40.3, 17.9 and 51.8 um' with the real sign.
    """
    return "; ".join(_hidden(name, value) for name, value in truth.items())


def _hidden(name: str, value: Any) -> str:
    found = UNIT.search(name)
    stem, unit = (name[: found.start()], _spoken(found[1])) if found else (name, "")
    values = list(value) if isinstance(value, Sequence) and not isinstance(value, str) else [value]
    if not values or not all(isinstance(each, int | float) and not isinstance(each, bool) for each in values):
        return f"{stem.replace('_', ' ')} {', '.join(map(str, values))}"
    sizes = [abs(float(each)) for each in values]
    factor, shown = prefixed(sizes, unit)
    if factor == 1.0:
        factor, shown = scaled(sizes, unit)
    said = ", ".join(figure(factor * each).replace("-", "\N{MINUS SIGN}") for each in values[:MOST_NUMBERS])
    more = f" and {len(values) - MOST_NUMBERS} more" if len(values) > MOST_NUMBERS else ""
    return f"{stem.replace('_', ' ')} {said} {shown}{more}".strip()


def _spoken(unit: str) -> str:
    """A unit as in names, such as 'um_per_m_k', as 'um/m/K' in typographic signs."""
    over, _, under = unit.partition("_per_")
    return "/".join(SIGNS.get(part, part) for part in (over, *under.split("_")) if part)


def _model(parameters: Sequence[Mapping[str, Any]] | None) -> str:
    if not parameters:
        return "\N{EN DASH}"
    said = [" ".join(parameter_in_words(one["name"], one["value"], one["std"])) for one in parameters[:MOST_NUMBERS]]
    more = f"; {len(parameters) - MOST_NUMBERS} more" if len(parameters) > MOST_NUMBERS else ""
    return "; ".join(map(str.strip, said)) + more


def _tool(error: Mapping[str, Mapping[str, float] | None]) -> list[tuple[str, ...]]:
    words = {"before": "with the controller's own commands", "after": "with the model's commands"}
    return [
        (words.get(when, when), *(length(row[axis]) if row else "cannot be followed" for axis in AXES_TOTAL))
        for when, row in error.items()
    ]
