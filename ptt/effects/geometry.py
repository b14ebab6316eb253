"""Shared by the geometry effects of the 3-PTT: unit vectors of the legs, bases over geometry slots, link tension."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar, cast

import torch
from torch import Tensor

from ptt.effects.base import Effect, Stage
from ptt.effects.phrases import ValuePhrase
from ptt.mechanisms.statics import link_forces
from ptt.mechanisms.three_ptt import LEGS, SLOTS, ThreePtt
from ptt.run.view import View

ACROSS = ("outward", "sideways")  # names of the two directions across a rail, as of `across_axes`
UPWARD = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
CLOSURE = "first-order geometry: derivative of |p - c_i| = L_i"


def machine(view: View) -> ThreePtt:
    """The mechanism of a view that is one of a 3-PTT."""
    return cast(ThreePtt, view.mechanism)


def horizontal_axes(view: View) -> tuple[Tensor, Tensor]:
    """Radial and tangential unit vectors of the legs, each (3, 3)."""
    return machine(view).outward, machine(view).outer_axis


def across_axes(view: View) -> tuple[Tensor, Tensor]:
    """Unit vectors across the rails, each (3, 3): the way an upper end leans outward, and tangential."""
    return machine(view).across, machine(view).outer_axis


def foot_axes(view: View) -> tuple[Tensor, Tensor]:
    """Unit vectors along which a rail may be misplaced, each (3, 3): outward (across a flat rail), and tangential."""
    return machine(view).foot_direction, machine(view).outer_axis


def upright(said: Iterable[ValuePhrase], view: View) -> tuple[ValuePhrase, ...]:
    """Replace 'outward' and 'inward' by 'upward' and 'downward' where the rail is flat."""
    there = machine(view)
    rises = {leg + 1: float(there.across[leg, 2]) > 0.0 for leg in range(LEGS) if there.flat[leg]}

    def turned(text: str, leg: int) -> str:
        if leg not in rises:
            return text
        up = {"outward": rises[leg], "inward": not rises[leg]}
        return re.sub("outward|inward", lambda way: "upward" if up[way[0]] else "downward", text)

    return tuple(replace(one, text=turned(one.text, one.joint), mend=turned(one.mend, one.joint)) for one in said)


def centre_basis(*columns: Tensor) -> Tensor:
    """Geometry basis of parameters that each move the joint centre of their own leg.

    Args:
        columns: one (n, 3, 3) or (n, 3, 3, c) tensor per parameter: per row and leg, the centre's shift per unit.

    Returns:
        (n, 15, P).
    """
    parts = [column.unsqueeze(-1) if column.dim() == 3 else column for column in columns]  # shape: (n, leg, xyz, c)
    basis = columns[0].new_zeros(len(columns[0]), len(SLOTS), LEGS * sum(part.shape[-1] for part in parts))
    start = 0
    for part in parts:
        for leg in range(LEGS):
            basis[:, 4 * leg : 4 * leg + 3, start : start + part.shape[-1]] = part[:, leg]
            start += part.shape[-1]
    return basis


def centre_slots(centres: Tensor) -> Tensor:
    """Shifts of the legs' joint centres, (n, leg, xyz), as shifts of all slots, (n, 15)."""
    with_length = torch.nn.functional.pad(centres, (0, 1))  # shape: (n, leg, 4)
    return torch.nn.functional.pad(with_length.flatten(1), (0, len(SLOTS) - 4 * LEGS))


def length_basis(*columns: Tensor) -> Tensor:
    """Geometry basis of parameters that each change the link length of their own leg.

    Args:
        columns: one (n, 3) tensor per parameter: per row and leg, the length's change per unit.

    Returns:
        (n, 15, P).
    """
    blocks = []
    for column in columns:
        block = column.new_zeros(column.shape[0], len(SLOTS), LEGS)
        for leg in range(LEGS):
            block[:, 4 * leg + 3, leg] = column[:, leg]
        blocks.append(block)
    return torch.cat(blocks, dim=-1)


def tension(view: View) -> Tensor:
    """Tension in each link under platform and payload.

    Args:
        view: n rows.

    Returns:
        (n, 3) N, negative in compression; zero without any weight.
    """
    return -link_forces(machine(view), view.p, view.payload, view.platform_mass)


@dataclass(frozen=True)
class ThreePttEffect(Effect):
    """Base of the geometry effects of the 3-PTT."""

    stage: ClassVar[Stage] = "geometry"
    mechanisms: ClassVar[tuple[str, ...]] = ("three-ptt",)
