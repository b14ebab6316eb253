"""What to look at and measure next where something unknown is left."""

import re
from collections.abc import Sequence

from ptt.dependence.contexts import is_direction
from ptt.dependence.dependence import Dependence
from ptt.dependence.said import MOVES, changed_at, switched_at
from ptt.effects.curve_basis import GRAVITY, JOINT
from ptt.effects.phrases import listed
from ptt.run.axes import AXES

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
    if {_place(first), *variables} <= {*AXES}:
        lines.append(OTHER_STAND)
    return tuple(lines)


def asks_for_poses(depends_on: Sequence[Dependence], *, untold: bool) -> bool:
    """Whether more poses would show an unknown better: it follows places, moves or loads, or next to nothing.

    Args:
        depends_on: as of `next_look`.
        untold: as of `next_look`.
    """
    first = depends_on[0] if depends_on else None
    if first is None or untold:
        return first is not None
    return first.on != "pause" and (_of_poses(first) or first.on in (*MOVES, "payload"))


def _of_poses(first: Dependence) -> bool:
    return first.on in AXES or (bool(JOINT.fullmatch(first.on)) and not first.on.startswith("speed"))


def _place(first: Dependence) -> str:
    return first.acts_on or first.residual


def _looks(first: Dependence, variables: Sequence[str]) -> list[str]:
    """Where to look, and what would show it better."""
    if first.moments:
        moments = switched_at(first.moments, first.unit)
        return [f"Look for what was switched {moments}: a pump, a clamp, a door, another machine."]
    if first.on == "time" and first.shape == "step" and first.place:
        return [f"Look for what changed {changed_at(*first.place, first.unit)}: a load, a clamp, the tool, a stop."]
    over = "" if is_direction(first.on) else f" over the range of {listed(variables)}"
    if first.on == "time":
        more = "A longer run, or another one,"
    elif first.on == "pause":
        more = "More readings after longer and after shorter rests"
    elif first.on == "run":
        more = "Another run"
    elif first.on in GRAVITY:
        more = "More poses that turn the tool against gravity"
    elif first.on in MOVES:
        more = "More poses in another order"
    else:
        more = f"More poses{over}, each approached from both sides," if _of_poses(first) else f"More readings{over}"
    where = WAY.sub(r" (\1)", _place(first)).replace("set-up", "the set-up").replace("mount", "the tool's holder")
    if where == "load":
        return ["Look for where the load's centre lies: hang it at the tool point.", f"{more} would show it better."]
    look = f"what moves the readings along {where}" if where in AXES else f"the cause in {where}"
    return [f"Look for {look}.", f"{more} would show it better."]
