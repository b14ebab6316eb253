"""Effects of the drives: the actual joint value differs from the commanded one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.layout import per_joint
from ptt.effects.phrases import Phrase
from ptt.effects.sudden import AFTER, Sudden
from ptt.run.pace import PACES, SMOOTH
from ptt.run.view import View

BY_FEED = len(PACES)  # added to a pace: speeds by the feed, though by the clock the machine stood


@dataclass(frozen=True)
class HomingOffset(Effect):
    """Zero of each axis is off: c_i."""

    name: ClassVar[str] = "homing-offset"
    of_drawing: ClassVar[bool] = True
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("offset", "mm", 0.5, "where the axis really is when it says zero", True, axis=True, usual_rad=5e-3),
    )
    called: ClassVar[str] = "homing"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "offset",
            "stand{s} {what} higher than b says",
            "stand{s} {what} lower than b says",
            arm=("stand{s} {what} beyond q toward +", "stand{s} {what} beyond q toward -"),
            mend=("lower {who} by {what}{turn}", "raise {who} by {what}{turn}"),
            arm_mend=("add {what} to the zero of {who}", "take {what} off the zero of {who}"),
        ),
    )
    card: ClassVar[Card] = Card(
        cause="The reference switch or index mark of an axis is not where the drawing has its zero.",
        equation="dq_i = c_i",
        source="first-order geometry: J dp = dq",
        size="50 um to 1 mm",
        fingerprint="A constant in J e, one for each slider; changes by a jump each time the machine is homed.",
        confused_with=(
            ("tracker-frame", "the common part is tracker z: base reflectors, or a height gauge on the base"),
            ("link-length", "one leg's length is like its zero: poses far out in x and y, where curvature shows"),
            ("joint-offset", "its rail part is the same thing: no tracker can tell; a linear scale on the axis can"),
        ),
        remedy="Enter the offset in the controller's homing table, or shift the switch or the index mark.",
        arm_size="mastered by a gauge 0.1 to 1 mrad, by marks 1 to 10 mrad",
        arm_fingerprint="A constant in J e, one for each joint; changes by a jump each time the joint is mastered.",
        arm_remedy="Enter the offset in the controller's table of joint zeros, or master the joint again.",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit shift of each axis."""
        return per_joint(torch.ones_like(view.q))


@dataclass(frozen=True)
class HomingSlip(Sudden):
    """An axis was homed anew, hit or slipped: from some time on its zero is off by c_i."""

    name: ClassVar[str] = "homing-slip"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("slip", "mm", 0.05, "how far the zero of the axis has moved", True, axis=True, usual_rad=5e-4),
        AFTER,
    )
    called: ClassVar[str] = "slip"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "slip",
            "slip{s} up by {what}",
            "slip{s} down by {what}",
            arm=("slip{s} toward + by {what}", "slip{s} toward - by {what}"),
            mend=("lower {who} by {what}{turn}", "raise {who} by {what}{turn}"),
            arm_mend=("add {what} to the zero of {who}", "take {what} off the zero of {who}"),
        ),
    )
    card: ClassVar[Card] = Card(
        cause="An axis was homed anew, hit a stop, or its coupling or belt slipped: its zero moved during the run.",
        equation="dq_i = c_i after a moment, zero until then (seconds, or rows where there is no clock)",
        source="first-order geometry: J dp = dq",
        size="10 to 500 um",
        fingerprint="From one row on J e of a slider has another level; the other sliders and base reflectors stay.",
        confused_with=(
            ("setup-jump", "moves every reflector like a rigid body: read base reflectors, revisit a datum"),
            ("homing-offset", "is there from the first row: keep the rows in the order of measuring"),
            ("screw-growth", "comes slowly, with warmth: a datum every 20 points, a temp_c column"),
        ),
        remedy="Tighten coupling and clamps, home again, measure again; the model serves from the slip on.",
        needs="time_s or rows in order of measuring, at least 20",
        telling="time",
        arm_cause="A joint was mastered anew, hit a stop, or a belt or clamp slipped: its zero moved during the run.",
        arm_size="0.1 to 5 mrad; a tooth of a belt or gear is tens of mrad",
        arm_fingerprint="From one row on J e of a joint has another level; the other joints and base reflectors stay.",
        arm_remedy="Tighten belts and clamps, master again, measure again; the model serves from the slip on.",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit shift of each axis, from the moment on."""
        return per_joint(self.since(view, shape)[:, None].expand_as(view.q))


@dataclass(frozen=True)
class FollowingError(Effect):
    """The axis lags behind a moving command: -v_i tau_i."""

    name: ClassVar[str] = "following-error"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("lag", "s", 0.02, "time the axis is late by", True),
        Parameter(
            "pace", "1", 1.0, "speed that a row means: 0 of a smooth way, at corners of the move there; 1 mean of both "
            "sides; 2 of the move to the row; 3 of that with its tool running straight; 4 to 7 the same by the feed, "
            "though by the clock the machine stood", lower=min(PACES), upper=max(PACES) + BY_FEED, role="given",
            default=float(SMOOTH),
        ),
    )  # fmt: skip
    requires: ClassVar[tuple[str, ...]] = ("speed",)
    called: ClassVar[str] = "following error"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "lag",
            "come{s} {what} late while moving",
            "come{s} {what} early while moving, as late readings do and no loop",
        ),
    )
    card: ClassVar[Card] = Card(
        cause="The position loop lags behind a moving command, and the reading is taken on the move.",
        equation="dq_i = -v_i tau_i, v_i from the feed and the path, else time stamps; which speed a row means, at a "
        "corner above all, is searched",
        source="velocity lag of a proportional position loop: tau = 1/K_v",
        size="v/K_v: 670 um at 20 mm/s and K_v = 30/s; none at standstill",
        fingerprint="J e is proportional to the slider's velocity and points backward along the path.",
        confused_with=(
            ("backlash", "both change sign with direction: two speeds, or dwell before reading"),
            ("tracker-drift", "a late trigger of the tracker looks the same: check the trigger at standstill"),
        ),
        remedy="Dwell before reading; raise the loop gain or use velocity feed-forward.",
        needs="two or more speeds (feed_mm_s, or time_s while moving)",
        telling="speed",
        arm_size="v/K_v: 17 mrad at 0.5 rad/s and K_v = 30/s; none at standstill",
        arm_fingerprint="J e is proportional to the joint's velocity and points backward along the path.",
    )

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """Every definition of the speed at a row."""
        if view.fed is not None:
            ways = [way + BY_FEED for way in PACES]
        else:
            ways = list(PACES if view.paces is not None else PACES[:1])
        return tuple({"pace": torch.tensor([float(way)])} for way in ways)

    def needs(self, view: View) -> str | None:
        """Several speeds; feeds that vary will do."""
        return None if view.fed is not None else super().needs(view)

    def lacks(self, theta: Tensor, view: View) -> str | None:
        """Several speeds; feeds will do only for a lag that follows them."""
        return self.needs(view) if theta[-1] >= BY_FEED else super().needs(view)

    def cause(self, theta: Tensor, view: View) -> str:
        """With a word where it contradicts the clock."""
        told = ", of readings on the move though by the clock it stood" if theta[-1] >= BY_FEED else ""
        return f"{super().cause(theta, view)}{told}"

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Velocity of each axis, reversed."""
        way = pace_number(shape)
        if shape["pace"] >= BY_FEED and view.fed is not None:
            return per_joint(-view.fed[..., way])
        return per_joint(-view.velocity if way == SMOOTH or view.paces is None else -view.paces[..., way - 1])


def pace_number(shape: Mapping[str, Tensor]) -> int:
    """Definition of speed in the shape of a following error, one of `ptt.run.pace.PACES`."""
    return int(shape["pace"]) % BY_FEED


@dataclass(frozen=True)
class AxisCompliance(Effect):
    """The axis yields under its load: c_i tau_i."""

    name: ClassVar[str] = "axis-compliance"
    told_by: ClassVar[str] = "payload"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("compliance", "mm/N", 2e-4, "yield per unit of load", True, axis=True, usual_rad=1e-8),
    )
    one_way: ClassVar[bool] = True
    called: ClassVar[str] = "axis compliance"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase("compliance", "give{s} way by {what}", "move{s} against the load by {what}, as no spring does"),
    )
    card: ClassVar[Card] = Card(
        cause="Nut, bearing and screw yield under the load of the axis.",
        equation=(
            "dq_i = c_i f_i; f from tau columns, else f = (dp/dq)^T F with F = (0, 0, -m g), m payload and platform "
            "(arms: payload)"
        ),
        source="virtual work; stiffness mapping: Gosselin, IEEE Trans. Robotics and Automation 6(3), 1990",
        size="2 to 50 N/um; 5 kg at x = 60 mm and 5 N/um: (-11, 0, -6) um",
        fingerprint="Proportional to payload; the tool sags, toward the leg that carries most.",
        confused_with=(
            ("joint-clearance", "a step, not a slope: load and unload through several payloads"),
            ("column-bend", "the same everywhere in x and y: one payload at poses spread wide"),
            ("link-compliance", "like it times (L/w)^2: payloads at poses spread wide, a linear scale on the axis"),
        ),
        remedy="Preload the nut, stiffen bearing seats and screw; keep payloads alike and correct by payload.",
        needs="payload_kg (or measured loads tau1, tau2, ...) that varies",
        telling="load",
        shade="payload",
        arm_cause="Gear and bearings of a joint yield under the load that it carries.",
        arm_size="1 to 20 urad/N m (gears of 0.05 to 1 MN m/rad)",
        arm_fingerprint="Proportional to payload and its lever: the tool sags, most with the arm stretched out level.",
        arm_remedy="Stiffer gears and bearings; keep payloads alike and correct by payload.",
    )

    def needs(self, view: View) -> str | None:
        """A load that varies."""
        force = view.axis_force()
        varied = float((force.amax(dim=0) - force.amin(dim=0)).max()) > 1e-6
        return None if varied else "a payload (column payload_kg) or measured loads (tau1, tau2, ...)"

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Load of each axis."""
        return per_joint(view.axis_force())
