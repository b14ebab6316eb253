"""The file of a user's own effects, written for what a diagnosis found that no known effect describes."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ptt.effects.curve import CURVE_SHAPES, OTHERS, PLACE, fits
from ptt.effects.curve_basis import GRAVITY, JOINT
from ptt.effects.phrases import listed
from ptt.effects.template import class_name, require_free_name
from ptt.errors import InputError, shown
from ptt.run.axes import AXES

REFERENCE_C = 20.0  # of a diagnosis of before it said where the drawing holds
OF_READINGS = '    # stage = "metrology"  # where it is the tracker that errs: then no command follows it'
_IMPROPER = "the dependence has no proper curve, place, moments or period"
_FIX = "give the JSON of `ptt diagnose --json`"


@dataclass(frozen=True)
class Written:
    """Effects written for what a diagnosis found.

    Attributes:
        names: of the effects, the leading one's first.
        text: Python source that defines them.
        left_out: what the error follows that no effect can say, and why; a line each.
    """

    names: tuple[str, ...]
    text: str
    left_out: tuple[str, ...] = ()


def prefilled(name: str, dependences: Sequence[Mapping[str, Any]]) -> Written:
    """Effects with the variables and the shapes that a diagnosis found, one for each thing that the error follows.

    Args:
        name: of the first, lower case words joined by hyphens; the others are this and a number.
        dependences: `depends_on` as the diagnosis gives it in JSON, at least one entry.

    Returns:
        Working effects of about ten lines each.

    Raises:
        InputError: a name is taken, no entry can be written, or one lacks something.
    """
    laws, left_out = dict[str, str](), list[InputError]()
    for entry in dependences:
        own = name if not laws else f"{name}-{len(laws) + 1}"
        require_free_name(own)
        try:
            law = _law(_checked(entry))
        except UnreadableError as error:
            left_out.append(error)
            continue
        if law not in laws.values():
            laws[own] = law
    if not laws:
        raise left_out[0]
    classes = [law.format(class_name=class_name(own), name=own) for own, law in laws.items()]
    head = [
        '"""What a diagnosis found, its leading part first; use it with --effects FILE.py."""',
        "",
        "from ptt.effects import Curve",
        *(["", *(f"# left out: {why}" for why in left_out)] if left_out else []),
    ]
    return Written(tuple(laws), "\n\n\n".join(["\n".join(head), *classes]) + "\n", tuple(map(str, left_out)))


class UnreadableError(InputError):
    """Something follows what no effect can read."""


def _law(found: Mapping[str, Any]) -> str:
    """The class of one entry, its names left open."""
    kinds = _mechanisms(found)
    named = [(key, found[key]) for key in ("on", "along", "acts_on")]
    for key, value in (*named, *(("together", each) for each in found["together"])):
        if not fits(kinds, value):
            what = f"the dependence has no proper '{key}': no {' or '.join(kinds)} has '{shown(value)}'"
            raise InputError(what, fix=_FIX)
    written = str(kinds).replace("'", '"')
    low, high = found["between"]
    lines = [
        "class {class_name}(Curve):",
        f'    """{_headline(found)}: say the cause here.',
        "",
        "    A law of your own goes into basis(self, view, shape).",
        '    """',
        "",
        '    name = "{name}"',
        f"    mechanisms = {written}",
        f'    on, shape = "{found["on"]}", "{found["shape"]}"',
        f"    between = ({low:.6g}, {high:.6g})",
        *([f"    period = {found['period']:.9g}"] if found["period"] else []),
        *([f"    moments = {found['moments']}"] if found["moments"] else []),
        *([f'    along = "{found["along"]}"'] if found["along"] else []),
        *_of_several(found["together"]),
        *([f'    acts_on = "{found["acts_on"]}"'] if found["acts_on"] else []),
        *([OF_READINGS] if _may_be_of_readings(found) else []),
    ]
    return "\n".join(lines)


def _of_several(together: Mapping[str, tuple[float, float]]) -> list[str]:
    """Lines on the variables that it takes all of, if any."""
    if not together:
        return []
    names = ", ".join(f'"{name}"' for name in together)
    ranges = ", ".join(f"({low:.6g}, {high:.6g})" for low, high in together.values())
    return [f"    together = ({names})", f"    ranges = ({ranges})"]


def _checked(dependence: Mapping[str, Any]) -> dict[str, Any]:
    """The entry's parts, each validated, because they are written into a Python file that is run later."""
    residual, on, shape, along, acts_on = _words(dependence)
    together = _together(dependence) if not along and shape in ("smooth", "step") else {}
    on, acts_on = _at_its_joint(on, acts_on, residual, together)
    free = on in AXES and not acts_on  # a field over the workspace, whatever shape one coordinate shows
    if free:
        shape = "smooth"
    place, period, moments, (low, high) = _figures(dependence, free=free)
    if free:
        together = {}
    if on != dependence.get("on"):
        low, high = together[on]
    if not along and not together and shape != "gradual":
        shape, along, (low, high) = _with_size(dependence, shape, (low, high))
    reference = dependence.get("reference_c")
    warm = float(reference) if isinstance(reference, int | float) else REFERENCE_C
    shift = warm if (along or on) == "temperature" else 0.0
    if not low < high or (shape == "period" and not period > 0.0):
        raise InputError(_IMPROPER, fix=_FIX)
    if (on, shape) != ("time", "levels"):
        moments = ()
    between = low - shift, high - shift
    if "temperature" in together:
        together["temperature"] = (together["temperature"][0] - warm, together["temperature"][1] - warm)
    return {"residual": residual, "on": on, "shape": shape, "along": along, "place": place, "period": period,
            "moments": moments, "between": between, "acts_on": acts_on, "together": together}  # fmt: skip


def _words(dependence: Mapping[str, Any]) -> tuple[str, str, str, str, str]:
    """Residual, variable, shape, second variable ('' for none) and place ('' for that of the residual)."""
    keys = ("residual", "on", "shape", "with", "acts_on")
    residual, on, shape, along, acts_on = (str(dependence.get(key) or "") for key in keys)
    if shape == "gradual":  # its second variable, travel since the last reversal, is computed by the effect itself
        along = ""
    proper = {
        "residual": re.fullmatch(r"(?:slider|joint) [0-9]+|[xyz]", residual),
        "on": is_variable(on),
        "shape": shape in CURVE_SHAPES and (shape != "gradual" or on.startswith("direction")),
        "with": not along or is_variable(along),
        "acts_on": not acts_on or PLACE.fullmatch(acts_on),
    }
    _require_readable(on, acts_on, tuple(map(str, dependence.get("together") or ())))
    _require_clock(dependence)
    for key in (key for key, right in proper.items() if not right):
        raise InputError(f"the dependence has no proper '{key}'", fix=_FIX)
    return residual, on, shape, along, acts_on


def _figures(
    dependence: Mapping[str, Any], *, free: bool
) -> tuple[list[float], float, tuple[float, ...], tuple[float, float]]:
    """Ends of a step or bump, period, moments, and the range of the variable; of a free field moments and range."""
    try:
        at = [float(value) for value in dependence["curve"]["at"]]
        place = [] if free else [float(value) for value in dependence.get("place") or ()]
        period = 0.0 if free else float(dependence.get("period_mm") or 0.0)
        moments = tuple(float(moment) for moment in dependence.get("moments") or ())
        low, high = place or [float(end) for end in dependence["curve"].get("between") or (at[0], at[-1])]
    except (KeyError, TypeError, ValueError, IndexError):
        raise InputError(_IMPROPER, fix=_FIX) from None
    if not all(map(math.isfinite, moments)) or list(moments) != sorted(set(moments)):
        raise InputError(_IMPROPER, fix=_FIX)
    return place, period, moments, (low, high)


def _require_readable(on: str, acts_on: str, together: tuple[str, ...]) -> None:
    """Refuse what no effect should say: a tool that moved in its holder, or what follows what an effect cannot read."""
    if _is_loose(acts_on, on, together):
        what = "no effect moves the tool in its holder"
        raise UnreadableError(what, fix="fasten it, and measure where it is")
    if on and not is_variable(on):
        moves = on.startswith(("way ", "turn ")) or on in ("step", "pause")
        whose = "the tool's moves" if moves else "the feed" if on == "feed" else "a column of your own"
        what = f"no proper 'on': an effect cannot read '{shown(on)}'; what follows {whose} is not corrected"
        raise UnreadableError(what, fix="keep it steady, at the tracker and at work")


def _require_clock(dependence: Mapping[str, Any]) -> None:
    """Refuse a law over the time of a run that has none: `ptt add` would refuse it on that run."""
    if dependence.get("by_rows") is True:
        what = "the run has no clock: its time is the number of the row, which no effect can read"
        raise UnreadableError(what, fix="give the run a column time_s, and diagnose it again")


def _at_its_joint(on: str, acts_on: str, residual: str, together: Mapping[str, Any]) -> tuple[str, str]:
    """The leading variable of a field, one of its own, and its place: the joint that errs, unless another is told."""
    if not together:
        return on, acts_on
    place = acts_on if acts_on or residual in AXES else residual
    return on if on in together else next(iter(together)), place


def _together(dependence: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Ranges of the variables that it takes all of; none where the leading one is enough, or an effect reads not all.

    Raises:
        InputError: ranges that are none.
    """
    names = [str(name) for name in dependence.get("together") or ()]
    try:
        ranges = [(float(low), float(high)) for low, high in dependence.get("ranges") or ()]
    except (TypeError, ValueError):
        raise InputError("the dependence has no proper ranges", fix=_FIX) from None
    if len(names) < 2 or len(ranges) != len(names) or not all(map(is_variable, names)):
        return {}
    if len({*names}) < len(names) or not all(low < high for low, high in ranges):
        raise InputError("the dependence has no proper ranges", fix=_FIX)
    return dict(zip(names, ranges, strict=True))


def _with_size(
    dependence: Mapping[str, Any], shape: str, between: tuple[float, float]
) -> tuple[str, str, tuple[float, float]]:
    """Shape 'varying' with its second variable and range where the entry's `size` tells them, else as given."""
    size = dependence.get("size")
    told = size if isinstance(size, Mapping) and size.get("kind") == "varying" else {}
    along, ends = str(told.get("along") or ""), (told.get("low"), told.get("high"))
    numbers = [float(end) for end in ends if isinstance(end, int | float)]
    if not is_variable(along) or along == dependence.get("on") or len(numbers) < 2 or numbers[0] == numbers[1]:
        return shape, "", between
    return "varying", along, (min(numbers), max(numbers))


def can_write(on: str, acts_on: str | None, together: tuple[str, ...]) -> bool:
    """Whether an effect can hold an entry of `depends_on`.

    Args:
        on: its variable.
        acts_on: where it acts.
        together: the variables that it takes all of; () for one.
    """
    return is_variable(on) and not _is_loose(acts_on, on, together)


def _is_loose(acts_on: str | None, on: str, together: tuple[str, ...]) -> bool:
    """Whether a tool moves in its holder otherwise than by how gravity lies, which no command should follow."""
    return acts_on == "mount" and {on, *together}.isdisjoint(GRAVITY)


def is_variable(name: str) -> bool:
    """Whether an effect's view holds a variable: it does not hold the tool's moves, nor the user's own columns.

    Args:
        name: as in `depends_on`.
    """
    return bool(JOINT.fullmatch(name)) or name in AXES + OTHERS


def _mechanisms(found: Mapping[str, Any]) -> tuple[str, ...]:
    """Mechanism families that it fits: that of the joint named by variable, residual or place; both for the tool."""
    on, residual, acts_on = found["on"], found["residual"], found["acts_on"]
    of_arm = re.fullmatch(r"(q|torque)[0-9]+", on) or on in GRAVITY or acts_on in ("mount", "load")
    if residual.startswith("joint") or of_arm:
        return ("serial",)
    of_tool = residual in AXES and acts_on in ("", "set-up", *AXES) and not re.fullmatch(r"(b|force)[0-9]+", on)
    return ("three-ptt", "serial") if of_tool and (acts_on or not JOINT.fullmatch(on)) else ("three-ptt",)


def _may_be_of_readings(found: Mapping[str, Any]) -> bool:
    """Whether it acts on the tool, where a tracker that errs looks the same, and is taken as the machine's."""
    tool = found["residual"] in AXES and found["acts_on"] in ("", *AXES)
    return tool and found["on"] not in ("time", "run") and (bool(found["acts_on"]) or not JOINT.fullmatch(found["on"]))


def _headline(found: Mapping[str, Any]) -> str:
    where = f" between {found['place'][0]:.4g} and {found['place'][1]:.4g}" if found["place"] else ""
    period = f" with a period of {found['period']:.4g}" if found["period"] else ""
    second = f" with {found['along']}" if found["along"] else ""
    on = f"{listed(list(found['together']))} together" if found["together"] else found["on"]
    what = f"the tool's own {found['residual']}" if found["acts_on"] == "mount" else found["residual"]
    if found["acts_on"] == "load":
        return "What a load does whose centre lies beside the tool point"
    return f"What of {what} follows {on}{second}{period}{where}"
