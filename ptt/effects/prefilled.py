"""The file of a user's own effect, written for what a diagnosis found that no known effect describes."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.effects.template import class_name, free_name
from ptt.errors import InputError

KNOTS = 7
REFERENCE_C = 20.0  # where warmth is zero unless the drawing says otherwise
COORDINATES = ("x", "y", "z")
DEGREE = 4  # of a free field over the workspace: what pulls from one side is no function of one coordinate


@dataclass(frozen=True)
class _Part:
    """Lines of code for the shapes of an effect.

    Attributes:
        lines: of the body, the last of which sets `shapes` (n, count).
        count: of shapes.
        words: what the shapes are.
    """

    lines: tuple[str, ...]
    count: int
    words: str


def prefilled(name: str, dependence: Mapping[str, Any]) -> str:
    """Text of an effect with the variable and the shape that a diagnosis found.

    Args:
        name: its name, lower case words joined by hyphens.
        dependence: an entry of `depends_on` as the diagnosis gives it in JSON.

    Returns:
        Python source of a working effect of about ten lines.

    Raises:
        InputError: the name is taken, or the entry lacks something.
    """
    free_name(name)
    dependence = _checked(dependence)
    on, shape = str(dependence["on"]), str(dependence["shape"])
    part = _part(on, shape, dependence)
    serial = on.startswith("q") or str(dependence["residual"]).startswith("joint")
    usual, unit = ("1e-4", "rad") if serial and re.search(r"\d$", on) else ("0.02", "mm")
    joint = re.fullmatch(r"(?:b|q|direction|speed)(\d+)", on)
    stage = "drive" if joint else "metrology" if on in ("time", "run") else "structure"
    size = part.count if joint else 3 * part.count
    lines = [
        f'"""{_headline(on, dependence)}, as a diagnosis found; use it with --effects FILE.py."""',
        "",
        "import torch",
        "",
        "from ptt.effects import Effect, Parameter",
        "",
        "",
        f"class {class_name(name)}(Effect):",
        '    """Say the physical cause here in one line."""',
        "",
        f'    name = "{name}"',
        f'    stage = "{stage}"',
        f'    mechanisms = ("{"serial" if serial else "three-ptt"}",)',
        f'    parameters = (Parameter("size", "{unit}", {usual}, "{part.words}", count={size}),)',
        f"    requires = {_requires(on, dependence)}",
        *(["    reverses = True"] if on.startswith("direction") else []),
        *(["    follows_clock = True"] if on in ("time", "temperature", "run") else []),
        "",
        "    def basis(self, view, shape):",
        *(f"        {line}" for line in part.lines),
        *(f"        {line}" for line in _placed(joint[1] if joint else None)),
    ]
    return "\n".join(lines) + "\n"


def _checked(dependence: Mapping[str, Any]) -> dict[str, Any]:
    """The entry with every part of the kind it should be: what is written below ends up in a file that is run."""
    checked = {key: dependence.get(key) for key in ("residual", "on", "shape", "place", "period_mm", "with")}
    names = {"residual": r"(?:slider|joint) \d+|[xyz]", "on": _VARIABLE, "shape": "[a-z]+", "with": _VARIABLE}
    for key, pattern in names.items():
        if (key, checked[key]) != ("with", None) and not re.fullmatch(pattern, str(checked[key])):
            raise InputError(f"the dependence has no proper '{key}'", fix=_FIX)
    try:
        at = [float(value) for value in dependence["curve"]["at"]]
        place = None if checked["place"] is None else [float(value) for value in checked["place"]]
        period = None if checked["period_mm"] is None else float(checked["period_mm"])
    except (KeyError, TypeError, ValueError):
        raise InputError("the dependence has no proper curve, place or period", fix=_FIX) from None
    if len(at) < 2 or (place is not None and len(place) != 2):
        raise InputError("the dependence has no proper curve or place", fix=_FIX)
    if place is not None and checked["on"] == "temperature":
        place = [value - REFERENCE_C for value in place]
    return checked | {"curve": {"at": at}, "place": place, "period_mm": period}


_VARIABLE = r"(?:b|q|direction|speed)\d+|[xyz]|payload|temperature|time|run"
_FIX = "give the JSON of `ptt diagnose --json`"


def _placed(joint: str | None) -> tuple[str, ...]:
    """Code that puts the shapes where they act."""
    if joint is None:
        return ("return torch.cat([torch.eye(3)[axis, None, :, None] * shapes[:, None] for axis in range(3)], dim=2)",)
    index = int(joint) - 1
    return (
        "basis = torch.zeros(view.rows, view.joints, shapes.shape[1], dtype=torch.float64)",
        f"basis[:, {index}] = shapes",
        "return basis",
    )


def _part(on: str, shape: str, dependence: Mapping[str, Any]) -> _Part:
    if on in COORDINATES:
        return _field(dependence)
    value = _value(on)
    if shape == "period" and dependence.get("period_mm"):
        turn = f"phase = {value} * {2.0 * np.pi / float(dependence['period_mm']):.9g}"
        waves = "shapes = torch.stack([f(k * phase) for k in (1, 2) for f in (torch.cos, torch.sin)], dim=1)"
        return _Part((turn, waves), 4, "cosine and sine of the period and of half of it")
    if shape == "step" and dependence.get("place"):
        low, high = dependence["place"]
        step = f"shapes = ({value} > {0.5 * (low + high):.6g}).to(torch.float64)[:, None]"
        return _Part((step,), 1, "step")
    if shape == "bump" and dependence.get("place"):
        low, high = dependence["place"]
        reach = high - low  # damage fades out beyond the feet that a test finds
        return _hats(value, np.linspace(low - reach, high + reach, 2 * KNOTS + 1)[1:-1], "height of each hat")
    second = dependence.get("with")
    if second:
        low, high = _range(dependence, str(second))
        hats = _hats(_held(_value(str(second)), low, high), np.linspace(low, high, KNOTS), "")
        return _Part((*hats.lines, f"shapes = {value}[:, None] * shapes"), KNOTS, f"with the direction, along {second}")
    if shape == "levels" or on.startswith(("direction", "payload", "speed")):
        return _Part((f"shapes = {value}[:, None]",), 1, f"per unit of {on}")
    low, high = _range(dependence, on)
    return _hats(_held(value, low, high), np.linspace(low, high, KNOTS), f"height of each hat along {on}")


def _field(dependence: Mapping[str, Any]) -> _Part:
    low, high = _range(dependence, str(dependence["on"]))
    reach = max(abs(low), abs(high), 1.0)
    lines = (
        f"x, y, z = (view.p / {reach:.4g}).T",
        f"powers = [(i, j, k) for i in range({DEGREE + 1}) for j in range({DEGREE + 1}) for k in range({DEGREE + 1})]",
        f"chosen = [(i, j, k) for i, j, k in powers if 0 < i + j + k <= {DEGREE}]",
        "shapes = torch.stack([x**i * y**j * z**k for i, j, k in chosen], dim=1)",
    )
    count = (DEGREE + 1) * (DEGREE + 2) * (DEGREE + 3) // 6 - 1
    return _Part(lines, count, f"of each product of up to {DEGREE} coordinates")


def _held(value: str, low: float, high: float) -> str:
    """Code of a value that beyond its range counts as the range's end."""
    return f"{value}.clamp({low:.5g}, {high:.5g})"


def _hats(value: str, knots: np.ndarray, words: str) -> _Part:
    """Piecewise linear functions, one at one knot and zero at the others."""
    listed = ", ".join(f"{knot:.5g}" for knot in knots)
    lines = (
        f"knots = torch.tensor([{listed}], dtype=torch.float64)",
        f"shapes = (1.0 - ({value}[:, None] - knots).abs() / {knots[1] - knots[0]:.5g}).clamp(min=0.0)",
    )
    return _Part(lines, len(knots), words)


def _range(dependence: Mapping[str, Any], name: str) -> tuple[float, float]:
    at = dependence["curve"]["at"]
    shift = REFERENCE_C if name == "temperature" else 0.0
    return float(at[0]) - shift, float(at[-1]) - shift


def _value(on: str) -> str:
    joint = re.fullmatch(r"(b|q|direction|speed)(\d+)", on)
    if joint:
        field = {"b": "q", "q": "q", "direction": "direction", "speed": "velocity"}[joint[1]]
        return f"view.{field}[:, {int(joint[2]) - 1}]"
    return {"payload": "view.payload", "temperature": "view.warmth", "time": "view.time", "run": "view.run.double()"}[
        on
    ]


def _headline(on: str, dependence: Mapping[str, Any]) -> str:
    place = dependence.get("place")
    where = f" between {place[0]:.4g} and {place[1]:.4g}" if place else ""
    period = f" with a period of {float(dependence['period_mm']):.4g}" if dependence.get("period_mm") else ""
    return f"What of {dependence['residual']} follows {on}{period}{where}"


def _requires(on: str, dependence: Mapping[str, Any]) -> str:
    wanted = {on.rstrip("0123456789"), str(dependence.get("with"))} & {"payload", "temperature", "time", "direction"}
    quoted = [f'"{name}"' for name in sorted(wanted)]
    return f"({quoted[0]},)" if len(quoted) == 1 else f"({', '.join(quoted)})"
