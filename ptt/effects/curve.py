"""A law of which only the variable and the shape are known: what `ptt effects new NAME --like D.json` starts from."""

import re
from itertools import product
from typing import Any, ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect
from ptt.effects.parameter import Parameter
from ptt.effects.shapes import smooth_shapes, straight_shapes
from ptt.run.view import View

JOINT = re.compile(r"(b|q|direction|speed)([1-9][0-9]*)")
COORDINATES = ("x", "y", "z")
OTHERS = ("payload", "temperature", "time", "run")
KINDS = ("levels", "smooth", "step", "bump", "period", "varying")
BENDS = 6  # bows, double bows, ... of a smooth law: what a run of a few hundred rows can tell
HATS = 13  # of a bump: damage of a spot has no shape that one could know
DEGREE = 4  # of a free field over the workspace: what pulls from one side is no function of one coordinate
FIELD = [powers for powers in product(range(DEGREE + 1), repeat=3) if 0 < sum(powers) <= DEGREE]
CONTEXTS = ("payload", "temperature", "time", "direction")


class Curve(Effect):
    """A free function of one variable, acting where that variable is: on its joint, the tool or the readings.

    A subclass says what it follows; stage, parameters and needs come from that.

    Class attributes:
        on: 'b2' or 'q2', 'direction2', 'speed2', 'payload', 'temperature', 'time', 'run', or 'x', 'y', 'z', which
            stand for a free field over the workspace.
        shape: 'levels', 'smooth', 'step', 'bump', 'period' or 'varying' as a diagnosis says it.
        between: where the variable (of 'varying': the second one) was seen, or where the step or bump is; mm, rad, s,
            kg, or K above the drawing's temperature.
        period: of 'period', mm or rad.
        along: the second variable that a direction's say varies with.
    """

    on: ClassVar[str] = ""
    shape: ClassVar[str] = "smooth"
    between: ClassVar[tuple[float, float]] = (0.0, 1.0)
    period: ClassVar[float] = 0.0
    along: ClassVar[str] = ""

    def __init_subclass__(cls, **named: Any) -> None:
        """Derive the rest from what it follows.

        Raises:
            TypeError: no such variable or shape, an empty range, or no period.
        """
        super().__init_subclass__(**named)
        for name in filter(None, (cls.on, cls.along)):
            if not (JOINT.fullmatch(name) or name in COORDINATES + OTHERS):
                raise TypeError(f"a curve cannot follow '{name}'")
        if not cls.on or cls.shape not in KINDS or not cls.between[0] < cls.between[1]:
            raise TypeError(f"a curve on '{cls.on}' of shape '{cls.shape}' between {cls.between}")
        if cls.shape == "period" and not cls.period > 0.0:
            raise TypeError("a period above zero is needed")
        joint = JOINT.fullmatch(cls.on)
        rad = cls.mechanisms == ("serial",) and joint is not None
        count, words = _size(cls)
        cls.stage = "drive" if joint else "metrology" if cls.on in ("time", "run") else "structure"
        size = count if joint else 3 * count
        usual, unit = (1e-4, "rad") if rad else (0.02, "mm")
        cls.parameters = (Parameter("size", unit, usual, words, count=size),)
        wanted = {name.rstrip("0123456789") for name in (cls.on, cls.along)}
        cls.requires = tuple(name for name in CONTEXTS if name in wanted)
        cls.reverses = cls.on.startswith("direction")
        cls.follows_clock = cls.on in ("time", "temperature", "run")

    def basis(self, view: View, shape: Any) -> Tensor:
        """The shapes where they act."""
        shapes = _field(view.p, self.between) if self.on in COORDINATES else self._shapes(view)
        joint = JOINT.fullmatch(self.on)
        if joint is None:
            return torch.cat(
                [torch.eye(3).to(shapes)[axis, None, :, None] * shapes[:, None] for axis in range(3)], dim=2
            )
        basis = shapes.new_zeros(view.rows, view.joints, shapes.shape[1])
        basis[:, int(joint[2]) - 1] = shapes
        return basis

    def _shapes(self, view: View) -> Tensor:
        """Shape: (n, count)."""
        value, (low, high) = _value(view, self.on), self.between
        if self.along:
            return value[:, None] * _smooth(_value(view, self.along), low, high)
        if self.shape == "period":
            phase = value * (2.0 * torch.pi / self.period)
            return torch.stack([wave(k * phase) for k in (1, 2) for wave in (torch.cos, torch.sin)], dim=1)
        if self.shape == "step":
            return (value > 0.5 * (low + high)).to(value)[:, None]
        if self.shape == "bump":
            reach = high - low  # damage fades out beyond the feet that a test finds
            knots = torch.linspace(low - reach, high + reach, HATS + 2, dtype=value.dtype)
            return (1.0 - (value[:, None] - knots[1:-1]).abs() / (knots[1] - knots[0])).clamp(min=0.0)
        return value[:, None] if _proportional(type(self)) else _smooth(value, low, high)


def _proportional(cls: type[Curve]) -> bool:
    """Whether it is a multiple of its variable: few levels, of which zero does nothing."""
    return cls.shape == "levels" or cls.on.startswith(("direction", "payload", "speed"))


def _size(cls: type[Curve]) -> tuple[int, str]:
    """How many shapes it has where it acts, and what they are."""
    if cls.on in COORDINATES:
        return len(FIELD), f"of each product of up to {DEGREE} coordinates"
    if cls.along:
        return BENDS + 2, f"with the direction, along {cls.along}"
    if cls.shape == "period":
        return 4, "cosine and sine of the period and of half of it"
    if cls.shape == "step":
        return 1, "step"
    if cls.shape == "bump":
        return HATS, "height of each hat"
    if _proportional(cls):
        return 1, f"per unit of {cls.on}"
    return BENDS + 2, f"bow, double bow, ..., slope and level along {cls.on}"


def _smooth(value: Tensor, low: float, high: float) -> Tensor:
    place = (value - low) / (high - low)
    return torch.cat([smooth_shapes(place)[:, :BENDS], straight_shapes(place)], dim=1)


def _field(tool: Tensor, between: tuple[float, float]) -> Tensor:
    x, y, z = (tool / max(abs(between[0]), abs(between[1]), 1.0)).T
    return torch.stack([x**i * y**j * z**k for i, j, k in FIELD], dim=1)


def _value(view: View, name: str) -> Tensor:
    """The variable, (n,)."""
    joint = JOINT.fullmatch(name)
    if joint:
        table = {"b": view.q, "q": view.q, "direction": view.direction, "speed": view.velocity}[joint[1]]
        return table[:, int(joint[2]) - 1]
    if name in COORDINATES:
        return view.p[:, COORDINATES.index(name)]
    return {"payload": view.payload, "temperature": view.warmth, "time": view.time, "run": view.run.double()}[name]
