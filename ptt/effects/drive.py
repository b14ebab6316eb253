"""Effects of the drives: what the axis does differs from what it was told."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage, finer, per_joint
from ptt.effects.memory import gradual_reversal, play
from ptt.effects.shapes import COARSE_SHAPES, SHAPES, from_coarse, smooth_shapes, straight_shapes
from ptt.effects.sudden import AFTER, Sudden
from ptt.mechanisms.serial import Serial
from ptt.turns import LINEAR
from ptt.view import View

WINDUP_LENGTHS = tuple(2.0 ** (half / 2.0) for half in range(-2, 11))  # mm, 0.5 to 32: neighbours look alike
PHASES = 5  # a turn seen at fewer phases than this cannot part a period from an offset


@dataclass(frozen=True)
class HomingOffset(Effect):
    """Zero of each axis is off: c_i."""

    name: ClassVar[str] = "homing-offset"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("offset", "mm", 0.5, "where the axis really is when it says zero", True, axis=True, usual_rad=5e-3),
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit shift of each axis."""
        return per_joint(torch.ones_like(view.q))


@dataclass(frozen=True)
class HomingSlip(Sudden):
    """An axis was homed anew, was hit or slipped: from some time on its zero is off by c_i."""

    name: ClassVar[str] = "homing-slip"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("slip", "mm", 0.05, "how far the zero of the axis has moved", True, axis=True, usual_rad=5e-4),
        AFTER,
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Unit shift of each axis, from the moment on."""
        return per_joint(self.since(view, shape)[:, None].expand_as(view.q))


@dataclass(frozen=True)
class LeadScale(Effect):
    """Lead of the screw is off: k_i (q - q0)."""

    name: ClassVar[str] = "lead-scale"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("scale", "1", 1e-4, "share by which the axis travels too far", True, usual_rad=1e-4),
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Distance of each axis from home."""
        return per_joint(view.q - view.home)


@dataclass(frozen=True)
class ScrewErrorMap(Effect):
    """Smooth error of the screw along its length, without the parts that homing and lead are.

    A curve that has no level and no slope over its whole range has a little of both over the heights that were
    visited; that little is held near zero, so that homing and lead stay their own causes.
    """

    name: ClassVar[str] = "screw-error-map"
    stage: ClassVar[Stage] = "drive"
    mechanisms: ClassVar[tuple[str, ...]] = ("three-ptt",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "curve",
            "mm",
            0.02,
            "heights of bow, double bow, ... along the range, each in its usual share",
            True,
            SHAPES,
            axis=True,
            usual_rad=2e-4,
        ),
        Parameter(
            "straight",
            "mm",
            0.004,
            "slope and level that belong to the curve",
            True,
            2,
            axis=True,
            usual_rad=4e-5,
            held=True,
        ),
        Parameter("from", "mm", 1.0, "lower end of the range", True, role="given", axis=True),
        Parameter("to", "mm", 1.0, "upper end of the range", True, role="given", axis=True),
    )

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """The range that the data cover."""
        return (covered_range(view),)

    def renew(self, values: Mapping[str, Tensor], joints: int) -> Mapping[str, Tensor]:
        """Six shapes on nine knots, as files had them, in the present shapes."""
        return renew_curves(values, ("curve",), joints)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Spline shapes of each axis."""
        place = (view.q - shape["from"]) / (shape["to"] - shape["from"])
        return per_joint(smooth_shapes(place), straight_shapes(place))


@dataclass(frozen=True)
class OncePerRev(Effect):
    """Error that repeats with every turn of the screw: a_i cos(2 pi q / lead) + b_i sin(2 pi q / lead).

    The label 'harmonic 2' makes it repeat twice a turn.
    """

    name: ClassVar[str] = "once-per-rev"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("cosine", "mm", 0.005, "part in phase with zero", True, axis=True, usual_rad=1e-4),
        Parameter("sine", "mm", 0.005, "part a quarter turn later", True, axis=True, usual_rad=1e-4),
        Parameter("period", "mm", 1.0, "length of a turn, or of a harmonic's part of it", role="given", axis=True),
    )

    def needs(self, view: View) -> str | None:
        """A lead, and poses at enough phases of the turn."""
        if view.lead is None:
            return "screw_lead_mm (gear_period_rad for an arm) in the machine file"
        phase = torch.remainder(view.q, self._period(view)) / self._period(view)
        seen = min(len(torch.unique((column * 3.0 * PHASES).round())) for column in phase.T)
        if seen >= PHASES:
            return None
        if isinstance(view.mechanism, Serial):
            return "joint values spread over more phases of gear_period_rad, a whole turn where the file has none"
        return "poses whose heights are not commensurate with the lead"

    def _period(self, view: View) -> float:
        assert view.lead is not None
        words = self.label.split()
        harmonic = int(words[1]) if len(words) == 2 and words[0] == "harmonic" and words[1].isdigit() else 1
        return view.lead / max(harmonic, 1)

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """The drawing's lead."""
        return ({"period": torch.tensor([self._period(view)], dtype=torch.float64)},)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Cosine and sine of the phase of each axis."""
        phase = 2.0 * torch.pi * view.q / shape["period"]
        return per_joint(torch.cos(phase), torch.sin(phase))


@dataclass(frozen=True)
class Backlash(Effect):
    """Play between nut and screw: the slider stays half the gap behind, on the side it comes from.

    A gap below zero is a controller that compensates more than there is: it throws the slider ahead, at once.
    """

    name: ClassVar[str] = "backlash"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "gap",
            "mm",
            0.05,
            "lost motion on reversal; below zero: compensated too much",
            True,
            axis=True,
            usual_rad=5e-4,
        ),
    )
    requires: ClassVar[tuple[str, ...]] = ("direction",)
    reverses: ClassVar[bool] = True

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """The limit of a small gap: half of it against the direction of arrival."""
        return per_joint(-0.5 * view.direction)

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """The play operator itself, which knows when the gap is not taken up yet; below zero the sign alone."""
        return torch.where(theta > 0.0, play(view, theta.clamp(min=0.0)), -0.5 * theta * view.direction)


@dataclass(frozen=True)
class Windup(Effect):
    """Friction winds the drive up: the error changes over gradually after a reversal, -h_i F(travel / l)."""

    name: ClassVar[str] = "windup"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "height", "mm", 0.005, "half the change on full reversal", True, lower=0.0, axis=True, usual_rad=1e-4
        ),
        Parameter(
            "length", "mm", 2.0, "travel over which it changes", lower=1e-3, role="searched", axis=True, usual_rad=2e-2
        ),
    )
    requires: ClassVar[tuple[str, ...]] = ("direction",)
    reverses: ClassVar[bool] = True

    def needs(self, view: View) -> str | None:
        """Readings soon and long after reversals."""
        wanting = super().needs(view)
        if wanting or self._lengths(view):
            return wanting
        return "readings at different travel since reversal (some within a few mm of it)"

    def _lengths(self, view: View) -> list[float]:
        """Travel constants that the data can see: some readings change over, some are done."""
        scale = 1.0 if float(view.travel_limits.abs().max()) > LINEAR else 0.01
        return [
            length * scale
            for length in WINDUP_LENGTHS
            if float((gradual_reversal(view, torch.tensor(length * scale)) - view.direction).abs().mean()) > 0.02
        ]

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """A geometric ladder of travel constants."""
        return tuple({"length": torch.tensor([length], dtype=torch.float64)} for length in self._lengths(view))

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Constants between the trials on either side; the fit itself goes on from there."""
        return finer(self.search(view), shape, "length")

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Normalised friction of each axis, against the travel."""
        return per_joint(-gradual_reversal(view, shape["length"]))


@dataclass(frozen=True)
class FollowingError(Effect):
    """The axis lags behind a moving command: -v_i tau_i."""

    name: ClassVar[str] = "following-error"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("lag", "s", 0.02, "time the axis is late by", True),)
    requires: ClassVar[tuple[str, ...]] = ("speed",)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Velocity of each axis, reversed."""
        return per_joint(-view.velocity)


@dataclass(frozen=True)
class ScrewGrowth(Effect):
    """The screw grows when it warms, from a fixed end that is not known: a_i dT (q - q0) + d_i dT."""

    name: ClassVar[str] = "screw-growth"
    stage: ClassVar[Stage] = "drive"
    mechanisms: ClassVar[tuple[str, ...]] = ("three-ptt",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("growth", "1/K", 1.2e-5, "expansion of the screw", True),
        Parameter("shift", "mm/K", 3e-3, "growth between the fixed end and the height of home", True),
    )
    requires: ClassVar[tuple[str, ...]] = ("temperature",)
    follows_clock: ClassVar[bool] = True

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Warmth times distance from home, and warmth."""
        warmth = view.warmth[:, None]
        return per_joint(warmth * (view.q - view.home), warmth.expand_as(view.q))


@dataclass(frozen=True)
class AxisCompliance(Effect):
    """The axis gives way under its load: c_i tau_i."""

    name: ClassVar[str] = "axis-compliance"
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("compliance", "mm/N", 2e-4, "yield per unit of load", True, axis=True, usual_rad=1e-8),
    )

    def needs(self, view: View) -> str | None:
        """A load that is not the same everywhere."""
        force = view.axis_force()
        varied = float((force.amax(dim=0) - force.amin(dim=0)).max()) > 1e-6
        return None if varied else "a payload (column payload_kg) or measured loads (tau1, tau2, ...)"

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Load of each axis."""
        return per_joint(view.axis_force())


def covered_range(view: View) -> dict[str, Tensor]:
    """Range of each joint that the rows cover, so that a saved curve keeps its own ruler.

    Args:
        view: n rows.

    Returns:
        'from' and 'to', each (k,).
    """
    low, high = view.q.amin(dim=0), view.q.amax(dim=0)
    still = high - low < 1e-6
    return {"from": low, "to": torch.where(still, low + 1.0, high)}


def renew_curves(values: Mapping[str, Tensor], stems: Sequence[str], joints: int) -> Mapping[str, Tensor]:
    """Curves of older machine files in the present shapes.

    Args:
        values: stem -> values as the file has them.
        stems: the curves among them; their straight parts lie side by side in 'straight'.
        joints: k.

    Returns:
        The same where they are in the present shapes already.
    """
    if not all(stem in values and len(values[stem]) == COARSE_SHAPES * joints for stem in stems):
        return values
    smooth, line = (torch.as_tensor(part) for part in from_coarse())
    curves = {stem: values[stem].reshape(joints, COARSE_SHAPES) for stem in stems}
    straight = torch.cat([curve @ line.T for curve in curves.values()], dim=1).flatten()
    return {
        **values,
        **{stem: (curve @ smooth.T).flatten() for stem, curve in curves.items()},
        "straight": straight + values.get("straight", torch.zeros_like(straight)),
    }
