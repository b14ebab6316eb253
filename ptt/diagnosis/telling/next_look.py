"""What to look at and measure next where something unknown is left."""

import re
from collections.abc import Sequence

from ptt.dependence.dependence import Dependence
from ptt.dependence.said import between, switched_at
from ptt.effects.curve import COORDINATES, JOINT
from ptt.effects.phrases import listed

SPREAD = "Measure more poses, spread over the workspace."
NOTE_MORE = "Measure again, and note what else changes meanwhile in columns of your own: loads, switches."
WAY = re.compile(r" (sideways|outward)$")  # of a rail
OTHER_STAND = "A tracker that errs so over its own range looks the same: measure again from another stand."


def next_look(depends_on: Sequence[Dependence], *, untold: bool) -> tuple[str, ...]:
    """Advice on an unknown.

    Args:
        depends_on: what it depends on, largest share first.
        untold: whether that explains next to nothing of it.

    Returns:
        A line each.
    """
    if not depends_on:
        return (NOTE_MORE,)
    first = depends_on[0]
    variables = first.together or (first.on,)
    lines = [SPREAD] if untold else _looks(first, variables)
    if {_place(first), *variables} <= {*COORDINATES}:
        lines.append(OTHER_STAND)
    return tuple(lines)


def asks_for_poses(depends_on: Sequence[Dependence]) -> bool:
    """Whether more poses would show an unknown better: not one over time, nor one that follows nothing recorded."""
    return bool(depends_on) and depends_on[0].on != "time"


def _place(first: Dependence) -> str:
    return first.acts_on or first.residual


def _looks(first: Dependence, variables: Sequence[str]) -> list[str]:
    """Where to look, and what would show it better."""
    if first.moments:
        moments = switched_at(first.moments, first.unit)
        since = f"{moments} after the first row" if first.unit else f"after rows {moments}"
        return [f"Look for what was switched {since}: a pump, a clamp, a door, another machine."]
    if first.on == "time" and first.shape == "step" and first.place:
        return [f"Look for what changed at {between(*first.place, first.unit)}: a load, a clamp, the tool, a stop."]
    sides = ", each approached from both sides," if JOINT.fullmatch(first.on) or first.on in COORDINATES else ""
    over = "" if first.on.startswith("direction") else f" over the range of {listed(variables)}"
    more = "A longer run, or another one," if first.on == "time" else f"More poses{over}{sides}"
    where = WAY.sub(r" (\1)", _place(first)).replace("set-up", "the set-up")
    look = (
        f"Look for what moves the readings along {where}."
        if where in COORDINATES
        else f"Look for the cause in {where}."
    )
    return [look, f"{more} would show it better."]
