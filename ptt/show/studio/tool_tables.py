"""Results of planning, of ISO 9283 and of dexterity as HTML tables."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ptt.plan.expected import Expected, by_kind
from ptt.show.card.words import length, parameter_in_words, percent, pretty
from ptt.show.studio.tables import table_html

FAMILIES = 4  # of singular poses that are listed
UNBOUNDED = frozenset({"condition"})  # figures that are infinite at a singularity, which JSON has no number for


def plan_html(told: Mapping[str, Any]) -> str:
    """Which effects a run over planned poses would determine, and how well.

    Args:
        told: JSON of `ptt plan`.

    Returns:
        HTML.
    """
    rows = []
    for item in told["effects"]:
        name = f"{item['effect']} (in the model)" if item["in_model"] else item["effect"]
        if item["testable"]:
            rows.append((name, f"{item['seen']} of {item['of']}", _errors(item["parameters"])))
        else:
            rows.append((name, "\N{EN DASH}", pretty(f"needs {item['needs']}")))
    head = ("effect", "seen", f"expected standard error at {length(told['sigma_um'])} noise")
    return table_html(head, rows, words=3, caption="what planned poses would tell")


def plan_in_words(told: Mapping[str, Any]) -> str:
    """How many poses there are, and how they arrive."""
    rising = ", ".join(map(percent, told["rising_share"]))
    visits = f", {told['datum_visits']} visits of a datum among them" if told["datum_visits"] else ""
    return f"{told['rows']} poses{visits}; joints arrive upward in {rising} of them."


def _errors(parameters: Sequence[Mapping[str, Any]]) -> str:
    """The largest standard error of each kind of parameter."""
    said = []
    for kind in by_kind(Expected(**item) for item in parameters):
        name, size, _ = parameter_in_words(kind.name, float(f"{kind.std or 0.0:.2g}"), None)
        said.append(", ".join(filter(None, (f"{name} {size}", kind.unseen))) if kind.std else f"{name} {kind.unseen}")
    return "; ".join(said)


def iso_html(found: Mapping[str, Any]) -> str:
    """Figures of ISO 9283, mean and worst over the poses.

    Args:
        found: 'figures': pairs of a name and its 'mean' and 'worst' in um, or None where the run does not give it.

    Returns:
        HTML.
    """
    rows = [
        (name, *((length(figure[key]) for key in ("mean", "worst")) if figure else ("not told by this run", "")))
        for name, figure in found["figures"]
    ]
    return table_html(("figure", "mean", "worst"), rows, caption="figures of ISO 9283")


def dexterity_html(figures: Mapping[str, Any]) -> str:
    """Dexterity at home and over the workspace.

    Args:
        figures: JSON of `ptt dexterity`.

    Returns:
        HTML.
    """
    home, space = figures["home"], figures["workspace"]
    rows = [
        (_spoken(key), f"{_plain(value)}{' mm' if key.endswith('_mm') else ''}")
        for key, value in home.items()
        if isinstance(value, float) or key in UNBOUNDED
    ]
    if "condition" in space:
        rows += [
            (f"condition number over {space['poses']} poses, {key}", _plain(space["condition"][key]))
            for key in ("least", "median", "largest")
        ]
    else:
        rows.append(("over the workspace", "no pose was found that the travel reaches"))
    if "singular" in space:
        rows += _of_arm(space)
    elif "near_singular_share" in space:
        rows.append(("poses near a singularity", f"{100.0 * space['near_singular_share']:.1f} %"))
    return table_html((), rows, words=1, caption="dexterity")


def _of_arm(space: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Where an arm moves most evenly, and the families of its singular poses."""
    rows = [("most even pose", _degrees(space["most_isotropic_q"]))]
    for family in space["singular"][:FAMILIES]:
        joints = f"joint{'s' if len(family['joints']) > 1 else ''} {' and '.join(map(str, family['joints']))}"
        rows.append((f"singular by {joints}: {percent(family['share'])} of walks", f"as at {_degrees(family['q'])}"))
    return rows


def _degrees(q: Sequence[float]) -> str:
    return f"q = {', '.join(f'{math.degrees(each):.0f}' for each in q)} deg".replace("-", "\N{MINUS SIGN}")


def _plain(value: float | None) -> str:
    """Three significant digits, large numbers written out; infinite where JSON has none."""
    return "infinite (singular)" if value is None else f"{float(f'{value:.3g}'):,.12g}"


def _spoken(key: str) -> str:
    known = {
        "condition": "condition number at home", "manipulability": "manipulability at home",
        "determinant": "determinant of the Jacobian at home", "inverse_mm": "least reach of a link along its rail",
        "edge_mm": "way sideways to the inverse singularity",
        "inverse": "margin of the inverse singularity (0 is at it)",
        "direct": "margin of the direct singularity", "constraint": "margin of the constraint singularity",
    }  # fmt: skip
    return known.get(key, key.replace("_", " "))
