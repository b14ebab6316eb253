"""A free function of one variable, or a field of several: what `ptt effects new NAME --like D.json` writes."""

import re
from dataclasses import replace
from typing import Any, ClassVar, cast

import torch
from torch import Tensor

from ptt.effects.base import CONTEXTS, Effect
from ptt.effects.curve_basis import (
    DEGREE,
    GRAVITY,
    JOINT,
    LOAD,
    SMOOTH,
    TURNS,
    field_basis,
    field_powers,
    of_turns,
    powers_of,
    products,
    smooth_basis,
    value_of,
)
from ptt.effects.dh_offsets import links_along
from ptt.effects.geometry import ACROSS, across_axes
from ptt.effects.hysterons import HYSTERONS, hysterons
from ptt.effects.layout import family
from ptt.effects.parameter import Parameter
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.statics import load_levers
from ptt.mechanisms.three_ptt import LEGS
from ptt.run.axes import AXES
from ptt.run.frames import rigid_columns
from ptt.run.view import View

PLACE = re.compile(
    r"(slider|joint|link) ([1-9][0-9]*)|(rail) ([1-9][0-9]*) (outward|sideways)|([xyz])|(set-up|mount|load)"
)
OTHERS = ("payload", "temperature", "time", "run", *GRAVITY)
CURVE_SHAPES = ("levels", "smooth", "step", "bump", "period", "varying", "gradual")
HARMONICS = 6  # of a period, the k-th weighed by 1/k: they make a sawtooth but for its edges
HATS = 13  # hat functions of a bump, since local damage has no shape that is known beforehand
MOTIONS = ("shift x", "shift y", "shift z", "turn x", "turn y", "turn z", "scale")  # of a set-up
ARM = 100.0  # mm from the base's origin at which rotations and scale of a set-up move a point as far as its shift
PAIR_DEGREE = 6  # the same in two variables: as many terms as there are of degree 4 in three, and finer
MANY_DEGREE = 3  # in four variables and more: a load times how gravity lies
STEP_DEGREE = 2  # of what changes at one moment over the workspace: a load bends a machine so


class Curve(Effect):
    """A free function of one variable, or a field of several: it shifts a joint, rail, link, the tool or the readings.

    A subclass sets the class attributes below; stage, parameters and requirements are derived from them.

    Class attributes:
        on: the variable: 'b2' or 'q2', 'direction2', 'speed2', the load 'force2' (N) of a slider or 'torque2' (N m) of
            an arm's joint, 'payload', 'temperature', 'time', 'run', of an arm 'gravity x' to 'gravity z' along the axes
            of its tool, or 'x', 'y', 'z', which without `acts_on` stand for a free field over the workspace.
        acts_on: what it shifts: 'slider 2' or 'joint 2', 'rail 2 outward', 'rail 2 sideways', 'link 2', 'x', 'y', 'z'
            of the tool, of an arm 'mount' (the tool in its holder) or 'load' (its centre, with `on` the payload), or
            'set-up' (tracker against machine, which no command corrects); '' for the joint that `on` names, else the
            tool, or the readings for 'time' and 'run'.
        moments: of shape 'levels' over time, the moments at which it switches, s, ascending.
        shape: 'levels', 'smooth', 'step', 'bump', 'period', 'varying' or 'gradual', as a diagnosis names it.
        between: range of the variable in the data (of 'varying': of the second variable; of 'gradual': of the joint
            that reverses), or ends of the step or bump; mm, rad, s, kg, N, or K above the drawing's temperature.
        period: of shape 'period', mm or rad.
        together: of shape 'smooth' or 'step', the variables that it takes all of, `on` among them; a step over time is
            by an amount that varies with the others.
        ranges: of each of these, as `between`; beyond them it stays as at their ends, but for two angles of an arm, of
            which it takes the first harmonics.
        along: of shape 'varying', the second variable, on which the effect of a direction depends.
        stage: of what acts on the tool, 'structure', or 'metrology' where it is the tracker that errs: no command
            follows it then; of the others the place says it.
    """

    on: ClassVar[str] = ""
    acts_on: ClassVar[str] = ""
    shape: ClassVar[str] = "smooth"
    between: ClassVar[tuple[float, float]] = (0.0, 1.0)
    period: ClassVar[float] = 0.0
    along: ClassVar[str] = ""
    moments: ClassVar[tuple[float, ...]] = ()
    together: ClassVar[tuple[str, ...]] = ()
    ranges: ClassVar[tuple[tuple[float, float], ...]] = ()

    def __init_subclass__(cls, **named: Any) -> None:
        """Derive stage, parameters and requirements from the class attributes.

        Raises:
            TypeError: no such variable, place, stage or shape, an empty range, or no period.
        """
        super().__init_subclass__(**named)
        _require_possible(cls)
        followed = (cls.on, cls.along, *cls.together)
        kind, index = cls._place()
        own_stage = vars(cls).get("stage")
        if own_stage is not None and (kind not in ("axis", "tool") or own_stage not in ("structure", "metrology")):
            raise TypeError(f"a curve that acts on '{cls.acts_on}' has no stage '{own_stage}'")
        if kind in ("slider", "joint", "load"):
            cls.stage = "drive"
        elif kind in ("link", "rail", "mount"):
            cls.stage = "geometry"
        else:
            of_readings = kind == "set-up" or cls.on in ("time", "run")
            cls.stage = own_stage or ("metrology" if of_readings else "structure")
        count, words = _size(cls)
        size = {"tool": 3, "mount": 3, "set-up": len(MOTIONS)}.get(kind, 1) * count
        of_joint = kind in ("slider", "joint")
        usual, unit = (1e-4, "rad") if of_joint and tuple(cls.mechanisms) == ("serial",) else (0.02, "mm")
        both = of_joint and len(cls.mechanisms) > 1  # mm of a slider, rad of an arm's joint
        cls.parameters = (
            Parameter("size", unit, usual, words, count=size, axis=both, usual_rad=1e-4 if both else None),
        )
        if kind == "load":
            words = "of each kg, by an offset along each axis of the tool"
            cls.parameters = (Parameter("size", "rad", 1e-4, words, per_joint=True, count=3),)
        joints = [int(joint[2]) for name in followed if (joint := JOINT.fullmatch(name))]
        cls.least_joints = max([1, *joints, index + 1 if kind in ("slider", "joint", "link") else 1])
        wanted = {name.rstrip("0123456789") for name in followed}
        cls.requires = tuple(name for name in CONTEXTS if name in wanted)
        cls.reverses = any(name.startswith("direction") for name in (cls.on, *cls.together))
        cls.follows_clock = not {"time", "temperature", "run"}.isdisjoint(followed)

    @classmethod
    def _place(cls) -> tuple[str, int]:
        """Object shifted (as `acts_on` calls it, but 'axis' and 'tool'), and its number from 0."""
        found = PLACE.fullmatch(cls.acts_on)
        if found is None:
            joint = JOINT.fullmatch(cls.on)
            return ("slider", int(joint[2]) - 1) if joint else ("tool", 0)
        if found[7]:
            return found[7], 0
        if found[6]:
            return "axis", AXES.index(found[6])
        return (found[1], int(found[2]) - 1) if found[1] else (found[3], int(found[4]) - 1)

    @property
    def shown(self) -> tuple[int, int]:
        """The joint that it acts on, and the one that it follows."""
        kind, index = self._place()
        acts, follows = index if kind in ("slider", "joint") else 0, JOINT.fullmatch(self.on)
        return acts, int(follows[2]) - 1 if follows else acts

    def basis(self, view: View, shape: Any) -> Tensor:
        """The basis functions of the variable, each in the outputs that it shifts."""
        kind, index = self._place()
        if kind == "tool":
            shapes = field_basis(view.p, self.between) if self.on in AXES else self._shapes(view)
            return torch.cat(
                [torch.eye(3).to(shapes)[axis, None, :, None] * shapes[:, None] for axis in range(3)], dim=2
            )
        shapes = self._shapes(view)
        if kind == "set-up":
            motions = torch.cat([rigid_columns(view.p, length=ARM), view.p[:, :, None] / ARM], dim=2)
            return (motions[:, :, :, None] * shapes[:, None, None]).flatten(2)
        if kind == "load":
            levers = load_levers(cast(Serial, view.mechanism), view.q, view.gravity)
            each = torch.diag_embed((view.payload[:, None, None] * levers).transpose(1, 2))  # shape: (n, i, j, j)
            return each.permute(0, 2, 3, 1).flatten(2)
        if kind == "mount":
            basis = shapes.new_zeros(view.rows, len(view.mechanism.slots), 3, shapes.shape[1])
            for axis in range(3):
                basis[:, axis - 3, axis] = shapes
            return basis.flatten(2)
        if kind == "rail":
            way = across_axes(view)[ACROSS.index(self.acts_on.split()[-1])][index]
            first, way = 4 * index, way.to(shapes)
        else:
            first, way = 4 * index + 3 if kind == "link" else index, shapes.new_ones(1)
        if kind == "link" and family(view) == "serial":
            first, way = 0, links_along(cast(Serial, view.mechanism))[:, index].to(shapes)
        out = {"rail": len(view.mechanism.slots), "link": len(view.mechanism.slots), "axis": 3}.get(kind, view.joints)
        basis = shapes.new_zeros(view.rows, out, shapes.shape[1])
        basis[:, first : first + len(way)] = way[:, None] * shapes[:, None]
        return basis

    def over_its_range(self, view: View) -> View:
        """The rows with the variable on every level, or spread over its range and, of a bump, over its feet."""
        low, high = self.between
        reach = high - low if self.shape == "bump" else 0.0
        spread = torch.linspace(low - reach, high + reach, view.rows, dtype=torch.float64)
        if self.moments:
            spread = spread.new_tensor((*self.moments, self.moments[-1] + 1.0)).repeat(view.rows)[: view.rows]
        if self.on in GRAVITY:  # on an arm that lies on its side and turns all joints, each component does
            turns = torch.linspace(-torch.pi, torch.pi, view.rows, dtype=torch.float64)
            every = turns[:, None] * torch.arange(1, view.joints + 1)
            return replace(view, q=every, gravity=view.gravity.new_tensor([1.0, 0.0, 0.0]))
        joint = JOINT.fullmatch(self.on)
        if joint and joint[1] in ("b", "q"):
            column = torch.arange(view.joints) == int(joint[2]) - 1
            return replace(view, q=torch.where(column, spread[:, None], view.q))
        if joint and LOAD.fullmatch(self.on):
            unit = 1e3 if joint[1] == "torque" else 1.0  # N mm, of N m
            return replace(view, torque=unit * spread[:, None].expand(-1, view.joints))
        match self.on:
            case "payload":
                return replace(view, payload=spread)
            case "temperature":
                return replace(view, warmth=spread)
            case "time":
                return replace(view, time=spread)
        return view

    def _shapes(self, view: View) -> Tensor:
        """Basis functions of the variable at each row, (n, count)."""
        low, high = self.between
        if self.shape == "gradual":
            elements = hysterons(view, view.q.new_full((view.joints,), high - low))
            return elements[:, int(self.on.removeprefix("direction")) - 1]
        value = value_of(view, self.on)
        if _is_of_turns(type(self)):
            return of_turns(view, self.together)
        if self.together:
            step = (value > 0.5 * (low + high)).to(value)[:, None] if self.shape == "step" else 1.0
            return step * products(view, *_factors(type(self)))
        if self.along:
            return value[:, None] * smooth_basis(value_of(view, self.along), low, high)
        if self.shape == "period":
            phase = value * (2.0 * torch.pi / self.period)
            numbers = range(1, HARMONICS + 1)
            return torch.stack([wave(k * phase) / k for k in numbers for wave in (torch.cos, torch.sin)], dim=1)
        if self.moments:
            level = torch.searchsorted(value.new_tensor(self.moments), value.contiguous())
            return torch.nn.functional.one_hot(level, len(self.moments) + 1).to(value)
        if self.shape == "step":  # play goes from one side to the other of where the drawing has the joint
            below = 0.5 if LOAD.fullmatch(self.on) else 0.0
            return (value > 0.5 * (low + high)).to(value)[:, None] - below
        if self.shape == "bump":
            reach = high - low  # wider than found: damage fades out beyond the feet that a test can see
            knots = torch.linspace(low - reach, high + reach, HATS + 2, dtype=value.dtype)
            return (1.0 - (value[:, None] - knots[1:-1]).abs() / (knots[1] - knots[0])).clamp(min=0.0)
        return value[:, None] if _proportional(type(self)) else smooth_basis(value, low, high)


def _require_possible(cls: type[Curve]) -> None:
    """Refuse a variable, place or shape that there is not, an empty range, or a missing period (TypeError)."""
    for name in filter(None, (cls.on, cls.along, *cls.together)):
        if not (JOINT.fullmatch(name) or name in AXES + OTHERS):
            raise TypeError(f"a curve cannot follow '{name}'")
    if not cls.on or cls.shape not in CURVE_SHAPES or not cls.between[0] < cls.between[1]:
        raise TypeError(f"a curve on '{cls.on}' of shape '{cls.shape}' between {cls.between}")
    if cls.shape == "period" and not cls.period > 0.0:
        raise TypeError("a period above zero is needed")
    if cls.moments and ((cls.on, cls.shape) != ("time", "levels") or list(cls.moments) != sorted(cls.moments)):
        raise TypeError("only levels over time change at moments, which are in ascending order")
    if cls.together and not (
        cls.shape in ("smooth", "step") and cls.on in cls.together and len(cls.ranges) == len(cls.together) > 1
        and all(low < high for low, high in cls.ranges)
    ):  # fmt: skip
        raise TypeError("a smooth curve or step of several variables has one of them as 'on', and a range of each")
    if cls.acts_on == "load" and (cls.on != "payload" or cls.together or cls.along):
        raise TypeError("what acts on the load follows the payload alone")
    if cls.shape == "gradual" and not cls.on.startswith("direction"):
        raise TypeError("only what follows a direction turns over gradually")
    if cls.acts_on and not (PLACE.fullmatch(cls.acts_on) and fits(cls.mechanisms, cls.acts_on)):
        raise TypeError(f"a curve of {' and '.join(cls.mechanisms)} cannot act on '{cls.acts_on}'")
    for name in (cls.on, cls.along, *cls.together):
        if not fits(cls.mechanisms, name):
            raise TypeError(f"a curve of {' and '.join(cls.mechanisms)} cannot follow '{name}'")


def fits(mechanisms: tuple[str, ...], name: str) -> bool:
    """Whether mechanism families have the joint, rail, link or variable that a name refers to.

    Args:
        mechanisms: 'three-ptt', 'serial'.
        name: for example 'b2', 'direction3', 'rail 2 outward', 'x'.

    Returns:
        Whether all of them do; the number of an arm's joints is not checked, since its file alone states it.
    """
    own = {
        "three-ptt": ("b", "force", "slider", "rail", "link"),
        "serial": ("q", "torque", "joint", "link", "mount", "load", "gravity"),
    }
    word = (re.match(r"[a-z]*", name) or [""])[0]
    number = re.search(r"[0-9]+", name)
    everywhere = word not in {each for kind in own.values() for each in kind}
    return all(
        (everywhere or word in own.get(kind, ())) and not (kind == "three-ptt" and number and int(number[0]) > LEGS)
        for kind in mechanisms
    )


def _proportional(cls: type[Curve]) -> bool:
    """Whether the function is a multiple of its variable, because that has few levels of which zero has no effect."""
    return (cls.shape == "levels" and not cls.moments) or cls.on.startswith(("direction", "payload", "speed"))


def _size(cls: type[Curve]) -> tuple[int, str]:
    """Number of basis functions at each output, and their meaning."""
    if cls.on in AXES and not cls.acts_on:
        return len(field_powers()), f"of each product of up to {DEGREE} coordinates"
    if _is_of_turns(cls):
        return (2 * TURNS + 1) ** len(cls.together), f"of each product of harmonics of {' and '.join(cls.together)}"
    if cls.together:
        names, _, degree = _factors(cls)
        return len(powers_of(len(names), degree)), f"of each product of {' and '.join(names)}"
    if cls.shape == "gradual":
        return HYSTERONS, "of each length over which it turns over"
    if cls.along:
        return SMOOTH, f"with the direction, along {cls.along}"
    if cls.shape == "period":
        return 2 * HARMONICS, "cosine and sine of the period, of half of it, of a third, ..."
    if cls.moments:
        return len(cls.moments) + 1, "of each level"
    if cls.shape == "step":
        return 1, "step"
    if cls.shape == "bump":
        return HATS, "height of each hat"
    if _proportional(cls):
        return 1, f"per unit of {cls.on}"
    return SMOOTH, f"bow, double bow, ..., slope and level along {cls.on}"


def _factors(cls: type[Curve]) -> tuple[list[str], list[tuple[float, float]], int]:
    """Variables of the products, their ranges, and the largest total degree."""
    steps = cls.shape == "step"
    wanted = [(name, ends) for name, ends in zip(cls.together, cls.ranges, strict=True) if not steps or name != cls.on]
    degree = STEP_DEGREE if steps else {2: PAIR_DEGREE, 3: DEGREE}.get(len(wanted), MANY_DEGREE)
    return [name for name, _ in wanted], [ends for _, ends in wanted], degree


def _is_of_turns(cls: type[Curve]) -> bool:
    """Whether it takes two angles of an arm together: what follows them repeats with each turn."""
    return cls.shape == "smooth" and len(cls.together) == 2 and all(name.startswith("q") for name in cls.together)
