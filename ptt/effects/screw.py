"""Effects of the screws (of an arm's gears and encoders): lead, error map, error of each turn, thermal growth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.curves import covered_range, curve_extremes
from ptt.effects.late import BEGAN, LATE, START, Growth, late_warmth
from ptt.effects.layout import family, per_joint
from ptt.effects.phrases import Phrase, ValuePhrase, figure, said
from ptt.effects.shapes import SHAPES, WAVES, smooth_shapes, straight_shapes, wave_shapes
from ptt.effects.structure import LARGEST_EXPANSION
from ptt.mechanisms.serial import Serial
from ptt.run.view import View

SCREW_STANDARD = "ISO 3408-3 (ball screws, tolerance classes)"
PHASES = 5  # fewer phases of a turn do not tell a periodic error from an offset


@dataclass(frozen=True)
class LeadScale(Effect):
    """Lead of the screw is off: k_i (q - q0)."""

    name: ClassVar[str] = "lead-scale"
    of_drawing: ClassVar[bool] = True
    stage: ClassVar[Stage] = "drive"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("scale", "1", 1e-4, "share by which the axis travels too far", True),
    )
    called: ClassVar[str] = "screw lead"
    arm_called: ClassVar[str] = "gear or encoder scale"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "scale",
            "travel{s} {what} too far",
            "travel{s} {what} not far enough",
            arm=("turn{s} {what} too far", "turn{s} {what} not far enough"),
            mend=("lower the counts per mm of {who} by {what}", "raise the counts per mm of {who} by {what}"),
        ),
    )
    card: ClassVar[Card] = Card(
        cause="The lead of the screw, or the controller's counts per mm, is off by a constant share.",
        equation="dq_i = k_i (q_i - q0_i), q0 the joint value at p = 0",
        source=f"{SCREW_STANDARD}: mean travel deviation; first-order geometry",
        size="C5 screw 23 um per 315 mm, 70 um/m",
        fingerprint="J e of the slider is a straight line in its height, through zero at q0.",
        confused_with=(
            ("screw-growth", "the slope follows temperature: measure cold and warm with a temp_c column"),
            ("tracker-scale", "with links, radius and zero it imitates a long tracker: read a scale bar"),
            ("tower-tilt", "a lean is weighted by q_i/w_i, a lead is not: poses wide in x and y, a linear scale"),
        ),
        remedy="Correct counts per mm in the controller (multiply by 1/(1 + k)).",
        arm_cause="The gear's ratio, or the controller's counts per turn, is off by a constant share.",
        arm_size="10 to 200 um/m, which is urad/rad; a wrong count of teeth or lines is far more",
        arm_fingerprint="J e of the joint is a straight line in its angle, through zero at q0.",
        arm_remedy="Correct counts per turn in the controller (multiply by 1/(1 + k)).",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Distance of each axis from home."""
        return per_joint(view.q - view.home)


@dataclass(frozen=True)
class ScrewErrorMap(Effect):
    """Error of the screw along its length, smooth or rough, without the constant and linear parts (homing, lead).

    A curve without level and slope over its whole range still has a little of both over the heights that were visited.
    That little is `straight`: held near zero where homing and lead are in the model, so that these keep what is theirs;
    free where they are not, since bending modes that imitate them would swing wildly between the heights visited.
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
        ),
        Parameter(
            "straight",
            "mm",
            0.004,
            "slope and level that belong to the curve",
            True,
            2,
            held=True,
            lent=("lead-scale", "homing-offset"),
        ),
        Parameter(
            "waves",
            "mm",
            5e-4,
            "heights beside the curve halfway between two knots, upward",
            True,
            WAVES,
            fine=True,
        ),
        Parameter("from", "mm", 1.0, "lower end of the range", True, role="given"),
        Parameter("to", "mm", 1.0, "upper end of the range", True, role="given"),
    )
    called: ClassVar[str] = "screw error"
    card: ClassVar[Card] = Card(
        cause="The lead varies along the screw: rolled or worn thread, bent shaft, end bearings out of line.",
        equation=(
            "dq_i = sum_j a_ij N_j(x) + sum_m w_im W_m(x) + b_i (2 x - 1) + c_i, x = (q_i - from_i)/(to_i - from_i) "
            "held to 0..1; N_j the 15 bending modes of a natural cubic spline on 17 knots, the first one high, the "
            "j-th about 1/j^2 (the prior of a smoothing spline); W_m what a rough screw does between these knots: "
            "splines that are one high halfway and zero at all others, of a size that is learned by itself; b and c, "
            "what a curve leaves of slope and level over the visited heights, are held near zero where lead-scale and "
            "homing-offset are in the model"
        ),
        source=(
            f"{SCREW_STANDARD}: travel variation; the form of a controller's leadscrew compensation table; shapes: "
            "Wahba, Spline Models for Observational Data, 1990"
        ),
        size="5 to 20 um",
        fingerprint="J e of one slider is a smooth curve in its own height, the same at every x and y.",
        confused_with=(
            ("guide-straightness", "enters weighted by q_i/w_i: poses wide in x and y, or a linear scale on the axis"),
            ("link-length", "curvature in x and y, not in height alone: poses at one height, wide in x and y"),
        ),
        remedy="Load the curve as the axis's compensation table; replace the screw if it is worn.",
    )

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """Maximum and minimum of each axis's curve, and where they are."""
        phrase = Phrase("curve", "run{s} up to {what} high", "run{s} up to {what} low")
        return curve_extremes(self, theta, std, ((phrase, ("curve", "waves"), slice(0, 2)),))

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """The range that the data cover."""
        return (covered_range(view),)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Bending modes, straight part and finer splines of each axis."""
        place = (view.q - shape["from"]) / (shape["to"] - shape["from"])
        return per_joint(smooth_shapes(place), straight_shapes(place), wave_shapes(place))


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
    called: ClassVar[str] = "error of each turn"
    card: ClassVar[Card] = Card(
        cause="The screw wobbles or its coupling or encoder is eccentric, so the error repeats with every turn.",
        equation="dq_i = a_i cos(2 pi q_i/T) + b_i sin(2 pi q_i/T), T = lead (label 'harmonic m': T = lead/m)",
        source=f"{SCREW_STANDARD}: travel variation within 2 pi",
        size="3 to 8 um (one turn: C3 6, C5 8)",
        fingerprint="A line at 1/lead in the spectrum of J e against the slider's height, perhaps with harmonics.",
        confused_with=(
            ("homing-offset", "heights whole leads apart show a constant: heights not commensurate with the lead"),
            ("screw-error-map", "steps above half the lead alias it to a slow curve: steps under half the lead"),
        ),
        remedy="Realign coupling and encoder, straighten the screw; or put the harmonic in the compensation table.",
        needs="screw_lead_mm (gear_period_rad) in the machine file, and heights not commensurate with it",
        telling="phase",
        arm_cause="The joint's gear, motor shaft or encoder is eccentric, so the error repeats with every turn of it.",
        arm_size="50 to 500 urad (strain-wave gears 100 to 300 urad twice a turn of the motor)",
        arm_fingerprint="A line at 1/period in the spectrum of J e against the joint's angle, perhaps with harmonics.",
        arm_remedy="Realign gear and encoder; or put the harmonic in the joint's compensation table.",
    )

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """Height of each axis's wave, and where in the turn it is highest."""
        k = view.joints
        waves, errors, period = theta[: 2 * k].reshape(2, k), std[: 2 * k].reshape(2, k), float(theta[-1])
        arm = isinstance(view.mechanism, Serial)
        turn, unit = ("gear", "rad") if arm else ("screw", "mm")
        own, parts = self.parameters[0].on(family(view)), []
        often = {1: "with every turn", 2: "twice every turn"}.get(self._harmonic, f"{self._harmonic} times every turn")
        for joint, ((cosine, sine), error) in enumerate(zip(waves.T.tolist(), errors.T, strict=True), 1):
            crest = (np.arctan2(sine, cosine) / (2.0 * np.pi) % 1.0) * period
            words = f"repeat{{s}} an error of {{what}} {often} of the {turn}, highest {figure(crest)} {unit} in"
            size = float(np.hypot(cosine, sine))
            parts.append(said(Phrase("", words, words), size, float(error.max()), own.unit, own.usual, joint))
        return tuple(parts)

    def needs(self, view: View) -> str | None:
        """A lead, and poses at enough phases of the turn."""
        if view.lead is None:
            return "screw_lead_mm (gear_period_rad for an arm) in the machine file"
        phase = torch.remainder(view.q, self.period(view)) / self.period(view)
        parts = 3.0 * PHASES
        # A phase of one is a phase of zero. Bins are tried at three offsets, so that no phase is always at an edge.
        ways = [torch.remainder((parts * phase + way / 3.0).round(), parts) for way in range(3)]
        seen = max(min(len(torch.unique(way[:, joint])) for way in ways) for joint in range(view.joints))
        if seen >= PHASES:
            return None
        if isinstance(view.mechanism, Serial):
            return "joint values spread over more phases of gear_period_rad, a whole turn where the file has none"
        return "poses whose heights are not commensurate with the lead"

    @property
    def odds_of_kind(self) -> float:
        """Prior 1/(m (m - 1)) of harmonic m > 1, which sums to one over all of them; the turn itself is no choice.

        Source: a prior of all integers, Rissanen, Annals of Statistics 11 (1983), in its simplest form.
        """
        return float(np.log(max(self._harmonic * (self._harmonic - 1), 1)))

    @property
    def _harmonic(self) -> int:
        """Number m of periods in a turn, from the label 'harmonic m'; 1 without it."""
        words = self.label.split()
        return max(int(words[1]), 1) if len(words) == 2 and words[0] == "harmonic" and words[1].isdigit() else 1

    def period(self, view: View) -> float:
        """Length of a turn over the harmonic's number, mm or rad; the drawing must state a lead."""
        assert view.lead is not None
        return view.lead / self._harmonic

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """The period by the drawing's lead."""
        return ({"period": torch.tensor([self.period(view)], dtype=torch.float64)},)

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Cosine and sine of the phase of each axis."""
        phase = 2.0 * torch.pi * view.q / shape["period"]
        return per_joint(torch.cos(phase), torch.sin(phase))


@dataclass(frozen=True)
class ScrewGrowth(Growth):
    """The screw grows when it warms, at once or late, from a fixed end that is not known: a_i dT (q - q0) + d_i dT."""

    name: ClassVar[str] = "screw-growth"
    stage: ClassVar[Stage] = "drive"
    mechanisms: ClassVar[tuple[str, ...]] = ("three-ptt",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("growth", "1/K", 1.2e-5, "expansion of the screw", True, within=(-0.1, LARGEST_EXPANSION)),
        Parameter("shift", "mm/K", 3e-3, "growth between the fixed end and the height of home", True),
        START,
        LATE,
    )
    called: ClassVar[str] = "screw growth"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase("growth", "grow{s} {what} with warmth", "shrink{s} {what} with warmth"),
        Phrase("shift", "rise{s} {what} at home with warmth", "sink{s} {what} at home with warmth"),
        BEGAN,
    )
    card: ClassVar[Card] = Card(
        cause="The screw warms and grows away from its fixed bearing.",
        equation="dq_i = a_i dT (q_i - q0_i) + d_i dT, dT = temp_c - reference_temp_c, or that of a body that is late: "
        "tau dT/dt = temp_c - T, T = temp_c + start where a clock begins; d carries the unknown fixed end",
        source="linear thermal expansion (steel 11 to 12 um/m/K); method of ISO 230-3",
        size="35 um at 300 mm and 10 K",
        fingerprint="The slope of J e against height drifts with temperature, more where the axis works most.",
        confused_with=(
            ("lead-scale", "does not follow temperature: measure cold and warm"),
            ("tracker-drift", "follows time, not temperature: revisit a datum, read base reflectors"),
            ("frame-growth", "a dish or a radius, not a line in height: poses over the whole volume, warm and cold"),
        ),
        remedy="Warm up before work, cool the screw, fit linear scales, or correct by a screw temperature sensor.",
        needs="temp_c with a change of temperature",
        telling="temperature",
        shade="b",
    )

    def ratio_limit(self, view: View) -> float | None:
        """Distance from home to the fixed bearing, mm: no more than the travel is long."""
        return float((view.travel_limits[:, 1] - view.travel_limits[:, 0]).max())

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Warmth times distance from home, and warmth."""
        warmth = late_warmth(view, shape["start"], shape["late"])[:, None]
        return per_joint(warmth * (view.q - view.home), warmth.expand_as(view.q))
