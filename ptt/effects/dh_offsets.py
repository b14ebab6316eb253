"""Errors of an arm's Denavit-Hartenberg parameters."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, cast

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.phrases import Phrase, ValuePhrase
from ptt.mechanisms.serial import LINK_SLOTS, Serial
from ptt.run.view import View

BETA = 4  # place of the Hayati angle among a link's slots


def links_along(arm: Serial) -> Tensor:
    """Geometry shifts by which each link grows along the line between its joints, as a warm one does.

    Link i is the body behind joint i. In the modified convention its common normal belongs to the next joint.

    Args:
        arm: k joints.

    Returns:
        (G, k) mm per mm of growth: a / hypot(a, d) for its common normal a and d / hypot(a, d) for its offset d; zero
        for a link of no length.
    """
    along = torch.zeros(len(arm.slots), arm.joints, dtype=torch.float64)
    later = arm.convention == "modified"
    for link, d in enumerate(arm.d_mm):
        row = link + later
        a = arm.a_mm[row] if row < arm.joints else 0.0
        length = math.hypot(a, d)
        if length > 0.0:
            along[len(LINK_SLOTS) * link + LINK_SLOTS.index("dd [mm]"), link] = d / length
            if a:
                along[len(LINK_SLOTS) * row + LINK_SLOTS.index("da [mm]"), link] = a / length
    return along


@dataclass(frozen=True)
class DhOffsets(Effect):
    """Denavit-Hartenberg parameters are off, link by link; with the Hayati angle beta between parallel joint axes.

    Every link has all five parameters. Combinations that the data do not determine (offsets along parallel axes, first
    and last link against a fitted frame and tool) the prior keeps near zero. Beta acts between parallel axes only,
    because elsewhere twist and joint angle of the neighbours do the same.
    """

    name: ClassVar[str] = "dh-offsets"
    of_drawing: ClassVar[bool] = True
    stage: ClassVar[Stage] = "geometry"
    mechanisms: ClassVar[tuple[str, ...]] = ("serial",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("da", "mm", 0.5, "added to the drawing's a, along the common normal", True),
        Parameter("dalpha", "rad", 1e-3, "added to the drawing's alpha, the twist between the joint axes", True),
        Parameter("dd", "mm", 0.5, "added to the drawing's d, along the joint axis", True),
        Parameter("dtheta", "rad", 2e-3, "joint angle larger than the encoder says", True),
        Parameter("dbeta", "rad", 1e-3, "lean of parallel joint axes across their common normal (Hayati)", True),
    )
    card: ClassVar[Card] = Card(
        cause="Links and joint axes are not where the drawing has them: machining, assembly, encoder zeros.",
        equation=(
            "dp = sum over links of (dp/da da + dp/dalpha dalpha + dp/dd dd + dp/dtheta dtheta + dp/dbeta dbeta), "
            "carried by the exact chain; beta, a rotation about y behind the twist, between parallel axes only"
        ),
        source=(
            "Hui Jizhuang et al., Mechanical Engineering and Technology 5(4), 2016, eq. 7; parallel axes: Hayati and "
            "Mirmirani, J. Robotic Systems 2, 1985"
        ),
        size="a and d 100 um to 1 mm, angles 0.1 to 5 mrad",
        fingerprint="A field that is smooth in the joint values, with periods of one turn of each joint.",
        confused_with=(
            ("homing-offset", "is the dtheta of every joint, so only one of the two goes in"),
            ("tracker-frame", "first link and joint one is a moved base: base reflectors"),
            ("reflector mount", "last link and joint is a moved reflector: a second mount, or turns of the last joint"),
            ("axis-compliance", "gravity bends alike in the same poses: repeat under another payload"),
        ),
        remedy="Enter the measured Denavit-Hartenberg parameters in the controller, or command corrected joints.",
        telling="b",
        shade="z",
    )
    arm_noun: ClassVar[str] = "link"
    called: ClassVar[str] = "link geometry"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase("da", "{is_} {what} too long", "{is_} {what} too short"),
        Phrase("dalpha", "{is_} twisted {what} too far", "{is_} twisted {what} too little"),
        Phrase("dd", "{has} {what} too much offset along its axis", "{has} {what} too little offset along its axis"),
        Phrase(
            "dtheta", "stand{s} {what} further toward + than q says", "stand{s} {what} further toward - than q says"
        ),
        Phrase("dbeta", "lean{s} {what} toward + about y", "lean{s} {what} toward - about y"),
    )

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """Signs such that 'too long' or 'too far' is a larger magnitude where the drawing's own value is negative."""
        arm = cast(Serial, view.mechanism)
        drawn = theta.new_tensor((*arm.a_mm, *arm.alpha_rad, *arm.d_mm))
        outward = torch.ones_like(theta)
        outward[: len(drawn)] = torch.where(drawn < 0.0, -1.0, 1.0)
        return super().say(theta * outward, std, view)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit of each link's slots, parameter by parameter."""
        arm, width = cast(Serial, view.mechanism), len(LINK_SLOTS)
        slots, joints = len(arm.slots), view.joints
        units = torch.eye(slots, width * joints, dtype=view.q.dtype).unflatten(1, (joints, width)).clone()
        parallel = torch.tensor(arm.parallel_axes())
        units[:, :, BETA] *= parallel
        return units.transpose(1, 2).flatten(1).expand(view.rows, slots, width * joints)
