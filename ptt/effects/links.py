"""Effects of the links and their joints: length, play, yield (3-PTT)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Parameter
from ptt.effects.card import Card
from ptt.effects.geometry import (
    CLOSURE,
    ThreePttEffect,
    horizontal_axes,
    length_basis,
    machine,
    tension,
)
from ptt.effects.phrases import Phrase
from ptt.mechanisms.statics import GRAVITY
from ptt.run.view import View

SLIGHT = 0.0025  # share of the weight: a joint misplaced by 1 mm at 400 mm changes a link's force by as much
FEWEST_A_SIDE = 3  # rows on either side of a change of sign; fewer may be the scatter of single readings


@dataclass(frozen=True)
class LinkLength(ThreePttEffect):
    """Link i is longer than drawn."""

    name: ClassVar[str] = "link-length"
    of_drawing: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("length", "mm", 0.1, "link too long", True),)
    noun: ClassVar[str] = "link"
    called: ClassVar[str] = "link length"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "length",
            "{is_} {what} too long",
            "{is_} {what} too short",
            mend=("shorten {who} by {what}", "lengthen {who} by {what}"),
        ),
    )
    card: ClassVar[Card] = Card(
        cause="A link is longer or shorter between its joint centres than drawn.",
        equation="dL_i = l_i; J_i dp = L_i dL_i/w_i",
        source=f"{CLOSURE}; calibration of parallel robots: Vischer and Clavel, Robotica 16, 1998",
        size="all links 50 to 500 um; one against the others 20 to 200 um",
        fingerprint="All alike: a dish, mostly in z. One: like that leg's zero, with curvature in x and y.",
        confused_with=(
            ("homing-offset", "that leg's zero has no curvature: poses wide in x and y"),
            ("tower-position", "common radius, 0.998 alike: measure one link on a coordinate measuring machine"),
            ("tracker-scale", "with radius, lead and zero it imitates a long tracker: read a scale bar"),
        ),
        remedy="Pair links of equal length, or enter the measured lengths in the controller.",
        telling="link angle",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit length of each leg."""
        return length_basis(torch.ones_like(view.q))


@dataclass(frozen=True)
class JointOffset(ThreePttEffect):
    """Axes of a universal joint do not meet, so the effective length varies with the link's angle."""

    name: ClassVar[str] = "joint-offset"
    of_drawing: ClassVar[bool] = True
    stands_for: ClassVar[tuple[str, ...]] = ("homing-offset", "link-length")  # the latter to 99 %
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("rail", "mm", 0.05, "times the cosine of the link's angle to the rail", True),
        Parameter("tangential", "mm", 0.05, "times the cosine of the link's sideways angle", True),
    )
    noun: ClassVar[str] = "link"
    called: ClassVar[str] = "joint offset"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "rail",
            "get{s} {what} longer when turned along the rail",
            "get{s} {what} shorter when turned along the rail",
        ),
        Phrase(
            "tangential",
            "get{s} {what} longer when not pointing sideways",
            "get{s} {what} shorter when not pointing sideways",
        ),
    )
    card: ClassVar[Card] = Card(
        cause="The two axes of a universal joint do not meet, so the link's length varies with its angle.",
        equation="dL_i = a_i |s_i . rail_i|/L_i + c_i sqrt(1 - (s_i . t_i/L_i)^2)",
        source=CLOSURE,
        size="10 to 100 um",
        fingerprint="Link length that follows the link's angle; the rail part is exactly a homing offset.",
        confused_with=(
            ("homing-offset", "the rail part is the same thing: no pose tells; measure the joint on the bench"),
            ("link-length", "the tangential part is 99 % a length: poses rich in sideways link angle"),
        ),
        remedy="Replace the joint; or leave it to homing-offset and link-length, which carry nearly all of it.",
        telling="link angle",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Cosines of each link's angles."""
        link = machine(view).link_vectors(view.p) / machine(view).link[:, None]
        _, tangential = horizontal_axes(view)
        sideways = (link * tangential).sum(dim=-1)
        along = (link * machine(view).rail).sum(dim=-1).abs()
        return length_basis(along, torch.sqrt(1.0 - sideways.square()))


@dataclass(frozen=True)
class JointClearance(ThreePttEffect):
    """Play in the joints of leg i: the pins rest on the side that the link force pushes to."""

    name: ClassVar[str] = "joint-clearance"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("clearance", "mm", 0.02, "play of the leg from pulled to pushed", True, lower=0.0),
    )
    noun: ClassVar[str] = "link"
    called: ClassVar[str] = "joint clearance"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "clearance",
            "{has} {what} of play that changes side with the link force",
            "{has} {what} less than no play",
        ),
    )
    card: ClassVar[Card] = Card(
        cause="Play in the pins of a leg's joints; they rest on the side that the link force pushes to.",
        equation=(
            "dL_i = (c_i/2) sign(F_i), F_i the pull in the link that holds platform and payload: "
            "sum_i F_i s_i/L_i = (0, 0, -m g)"
        ),
        source="statics of the platform; contact on the loaded side",
        size="5 to 50 um",
        fingerprint="A step where a link force changes sign, outside the triangle of the joints; poor repeats there.",
        confused_with=(
            ("backlash", "follows direction, not force: a linear scale and the tracker at once"),
            ("play of a nut", "by the side that its load pushes to is alike under steep links: a linear scale sees it"),
            ("axis-compliance", "grows with load: load and unload through several payloads"),
        ),
        remedy="Preload the joints with springs, replace pins; or work inside the triangle with a load on.",
        needs="platform_mass_kg or payload_kg, and poses on both sides of where a link force changes sign",
        telling="link force",
    )

    def needs(self, view: View) -> str | None:
        """A link force that takes both signs in the data, or is zero in some rows (no load) and not in others."""
        side = torch.sign(tension(view))
        rows = torch.stack([(side == one).sum(dim=0) for one in (-1.0, 0.0, 1.0)])  # shape: (side, leg)
        both = (rows >= FEWEST_A_SIDE).sum(dim=0) > 1
        return None if bool(both.any()) else "poses on both sides of where a link force changes sign, and a load"

    def undecided(self, view: View) -> Tensor:
        """Rows at which a link carries so little that errors of the drawing may change the sign of its force."""
        weight = GRAVITY * (view.payload + view.platform_mass)
        return (tension(view).abs() < SLIGHT * weight[:, None]).any(dim=1)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Half the play, longer when pulled and shorter when pushed."""
        return length_basis(0.5 * torch.sign(tension(view)))


@dataclass(frozen=True)
class LinkCompliance(ThreePttEffect):
    """Link i with its joints stretches under its axial force: dL_i = c_i N_i, N_i its tension."""

    name: ClassVar[str] = "link-compliance"
    told_by: ClassVar[str] = "payload"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "compliance", "mm/N", 5e-5, "stretch of link and joints per unit of pull", True, within=(0.0, math.inf)
        ),
    )
    noun: ClassVar[str] = "link"
    called: ClassVar[str] = "link compliance"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase("compliance", "stretch{es} {what} of pull", "shorten{s} {what} of pull, as no spring does"),
    )
    card: ClassVar[Card] = Card(
        cause="A link and the bearings of its joints stretch under the pull of platform and payload.",
        equation="dL_i = c_i F_i, F_i the pull in the link: sum_i F_i s_i/L_i = (0, 0, -m g), m platform and payload",
        source="statics of the platform; axial stiffness E A/L in series with the joints' bearings",
        size="10 to 100 N/um: 0.5 to 5 um at 50 N",
        fingerprint="The platform hangs lower with payload, and J e of a leg follows the pull in its link.",
        confused_with=(
            ("axis-compliance", "like it times (L/w)^2: payloads at poses spread wide, a linear scale on the axis"),
            ("joint-clearance", "a step, not a slope: load and unload through several payloads"),
            ("link-length", "does not follow payload: repeat under another payload"),
        ),
        remedy="Stiffer links and joint bearings; keep payloads alike, or correct by payload.",
        needs="platform_mass_kg or payload_kg, so that the pull in a link varies over pose or payload",
        telling="link force",
        shade="payload",
    )

    def needs(self, view: View) -> str | None:
        """A link force that varies."""
        force = tension(view)
        varied = bool((force.amax(dim=0) - force.amin(dim=0) > 1e-6).any())
        return None if varied else "platform_mass_kg in the machine file, or a payload (column payload_kg)"

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Pull in each link."""
        return length_basis(tension(view))
