"""Lengths of an arm's machine file in another unit: metres, inches or centimetres under keys of mm."""

from collections.abc import Iterator

import numpy as np

from ptt.machine import JointSpec, SerialSpec
from ptt.setup.arm_fit import arm_spec, judge_arm
from ptt.setup.candidates import UNITS
from ptt.setup.drawing import LONGEST, SHORTEST, drawn_with
from ptt.setup.setup import Hypothesis, Setup

KEYS = ("a_mm", "d_mm")
SHORTEST_TOOL, LONGEST_TOOL = 10.0, 1e3  # mm, tools of arms
OWN = ("inches", "centimetres")  # no unit of readings differs from mm by such a factor the other way round


def other_lengths(setup: Setup, rows: np.ndarray) -> list[tuple[float, Hypothesis]]:
    """Units of an arm's lengths that may be meant, with what the readings leave in each, mm; the best first.

    Readings in micrometres differ from a drawing in mm as readings in mm do from one in metres. Only the size of arms
    tells which it is.

    Args:
        setup: both files of a serial arm.
        rows: the rows that are fitted.
    """
    tried = [(judge_arm(item.undo(setup), rows), item) for item in _slips(setup, rows)]
    return sorted(tried, key=lambda each: each[0])


def is_no_arm(spec: SerialSpec) -> bool:
    """Whether the links are too short or too long in mm for any arm, and not in another unit."""
    return not _is_size(links_mm(spec)) and any(_is_size(factor * links_mm(spec)) for factor in UNITS.values())


def remarks_on(spec: SerialSpec) -> tuple[str, ...]:
    """A remark on links that are too short or too long for any arm."""
    if not is_no_arm(spec):
        return ()
    size = links_mm(spec)
    known = [f"{factor * size:,.0f} mm if in {unit}" for unit, factor in UNITS.items() if _is_size(factor * size)]
    keys = ", ".join([*KEYS, *(["com_mm"] * _has_centres(spec))])
    return (f"the links are {size:.3g} mm long together, as of no arm: {' or '.join(known)}; write {keys} in mm",)


def links_mm(spec: SerialSpec) -> float:
    """The sum over links of hypot(a, d), mm."""
    return float(sum(np.hypot(joint.a_mm, joint.d_mm) for joint in spec.joint))


def _is_size(length: float) -> bool:
    return SHORTEST <= length <= LONGEST


def _slips(setup: Setup, rows: np.ndarray) -> Iterator[Hypothesis]:
    """Every other unit in which the links are those of an arm."""
    spec = arm_spec(setup)
    size = links_mm(spec)
    for unit, factor in UNITS.items():
        if not _is_size(factor * size) or (_is_size(size) and unit not in OWN):
            continue
        ways = [_slip(spec, unit, factor, tool=tool) for tool in (True, False)]
        if not any(spec.tool_mm):
            yield ways[1]
        elif setup.file.tracker.tool == "trusted":
            yield min(ways, key=lambda way: judge_arm(way.undo(setup), rows, mounted=False))
        else:
            yield ways[1 if _is_tool(spec, size) else 0]


def _is_tool(spec: SerialSpec, size: float) -> bool:
    """Whether the tool is in mm already: it has the size of one, or is longer than all links, `size`, together."""
    length = float(np.linalg.norm(spec.tool_mm))
    return SHORTEST_TOOL <= length <= LONGEST_TOOL or length > size


def _slip(spec: SerialSpec, unit: str, factor: float, *, tool: bool) -> Hypothesis:
    """The lengths in another unit, centres of mass with them, the tool with them or not."""
    joints = _in_mm(spec, factor)
    number, key, value = next(_lengths(joints))
    own = ["com_mm"] * _has_centres(spec) + ["tool_mm"] * tool
    also = f" ({' and '.join(own)} too)" if own else ""
    words = f"the machine file's lengths taken as {unit}{also}"
    fix = f"write {key} = {value:g} for joint {number} and so on, in mm{also}"
    more = {"tool_mm": tuple(round(factor * each, 9) for each in spec.tool_mm)} if tool else {}
    return Hypothesis("unit-scale", words, fix, drawn_with(joint=joints, **more), 0.1)


def _has_centres(spec: SerialSpec) -> bool:
    return any(any(joint.com_mm or ()) for joint in spec.joint)


def _in_mm(spec: SerialSpec, factor: float) -> tuple[JointSpec, ...]:
    def scaled(joint: JointSpec) -> dict[str, object]:
        centre = joint.com_mm and tuple(round(factor * value, 9) for value in joint.com_mm)
        return {key: round(factor * getattr(joint, key), 9) for key in KEYS} | {"com_mm": centre}

    return tuple(joint.model_copy(update=scaled(joint)) for joint in spec.joint)


def _lengths(joints: tuple[JointSpec, ...]) -> Iterator[tuple[int, str, float]]:
    """Number of the joint, key and mm of each length that is not zero."""
    for number, joint in enumerate(joints, 1):
        yield from ((number, key, getattr(joint, key)) for key in KEYS if getattr(joint, key))
