"""Basis functions of curves and fields: of a variable, of several together, of the angles of an arm."""

import re
from itertools import product
from typing import cast

import torch
from torch import Tensor

from ptt.effects.shapes import SHAPES, smooth_shapes, straight_shapes
from ptt.mechanisms.serial import Serial
from ptt.run.axes import AXES
from ptt.run.view import View

JOINT = re.compile(r"(b|q|direction|speed|force|torque)([1-9][0-9]*)")
LOAD = re.compile(r"(force|torque)([1-9][0-9]*)")  # of what JOINT has, what a joint bears
SMOOTH = SHAPES + 2  # bending modes, slope and level of a smooth curve
GRAVITY = tuple(f"gravity {axis}" for axis in AXES)  # its components along the axes of an arm's tool
DEGREE = 4  # of the polynomial in x, y and z that stands for a free field over the workspace
TURNS = 2  # harmonics of each of two angles of an arm, as of the unknown that it describes


def powers_of(count: int, degree: int) -> list[tuple[int, ...]]:
    """Powers of each product of a number of variables up to a total degree, the constant first."""
    return [powers for powers in product(range(degree + 1), repeat=count) if sum(powers) <= degree]


def field_powers() -> list[tuple[int, ...]]:
    """Powers of x, y and z in a free field over the workspace; its constant belongs to the frame."""
    return powers_of(3, DEGREE)[1:]


def products(view: View, names: list[str], ranges: list[tuple[float, float]], degree: int) -> Tensor:
    """Products of powers of variables, each scaled to -1..1 over its range and kept at its ends, (n, count)."""
    low, high = torch.tensor(ranges, dtype=torch.float64).T
    values = torch.stack([value_of(view, name) for name in names], dim=1)
    scaled = ((2.0 * values - low - high) / (high - low)).clamp(-1.0, 1.0)
    powers = scaled.new_tensor(powers_of(len(names), degree))
    return (scaled[:, None] ** powers).prod(dim=2)


def of_turns(view: View, names: tuple[str, ...]) -> Tensor:
    """Products of the first harmonics of angles, the m-th of size 1/m, (n, count)."""
    found = view.q.new_ones(view.rows, 1)
    for name in names:
        angle = value_of(view, name)
        waves = [wave(m * angle) / m for m in range(1, TURNS + 1) for wave in (torch.cos, torch.sin)]
        each = torch.stack([torch.ones_like(angle), *waves], dim=1)
        found = (found[:, :, None] * each[:, None, :]).flatten(1)
    return found


def smooth_basis(value: Tensor, low: float, high: float) -> Tensor:
    """Bending modes and straight part over a range, (n, SMOOTH)."""
    place = (value - low) / (high - low)
    return torch.cat([smooth_shapes(place), straight_shapes(place)], dim=1)


def field_basis(tool: Tensor, between: tuple[float, float]) -> Tensor:
    """Monomials of the tool position, scaled by the range, (n, count)."""
    x, y, z = (tool / max(abs(between[0]), abs(between[1]), 1.0)).T
    return torch.stack([x**i * y**j * z**k for i, j, k in field_powers()], dim=1)


def value_of(view: View, name: str) -> Tensor:
    """The variable at each row, (n,)."""
    joint = JOINT.fullmatch(name)
    if joint:
        return _of_joints(view, joint[1])[:, int(joint[2]) - 1]
    if name in GRAVITY:
        turn = cast(Serial, view.mechanism).pose(view.q)[1]
        return torch.einsum("nc,c->n", turn[:, :, GRAVITY.index(name)], view.gravity)
    if name in AXES:
        return view.p[:, AXES.index(name)]
    return {"payload": view.payload, "temperature": view.warmth, "time": view.time, "run": view.run.double()}[name]


def _of_joints(view: View, name: str) -> Tensor:
    """A variable that each joint has, (n, k)."""
    match name:
        case "direction":
            return view.direction
        case "speed":
            return view.velocity
        case "force":
            return view.axis_force()
        case "torque":
            return 1e-3 * view.axis_force()  # N m, of N mm
    return view.q
