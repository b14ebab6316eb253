"""Effects of the metrology: the tracker's readings are off, not the machine. Commands never correct them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.phrases import Phrase
from ptt.effects.refinement import between_trials
from ptt.effects.sudden import AFTER, Sudden
from ptt.run.frames import rigid_columns
from ptt.run.view import View

RIGID = "small rigid motion, Rodrigues' formula to first order"
USUAL_SCALE = 2e-5  # relative
WITHOUT_AIR = 3e-4  # relative error of a tracker that ignores the refractive index of air, 2.7e-4, and a tenth more
AWAY = 3e3  # mm along each axis: usual distance of the tracker
SETTLING = (1e3, 3.0, 1.25, 0.5, 0.2, 0.07)  # time constants as shares of the run: a straight line, then slow to fast


@dataclass(frozen=True)
class MetrologyEffect(Effect):
    """Base of the metrology effects."""

    stage: ClassVar[Stage] = "metrology"
    of_run: ClassVar[bool] = True


@dataclass(frozen=True)
class TrackerFrame(MetrologyEffect):
    """The readings are shifted and turned as a whole: t + w x p."""

    name: ClassVar[str] = "tracker-frame"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("shift", "mm", 0.5, "translation of the readings, x, y, z", count=3),
        Parameter("turn", "rad", 5e-4, "rotation of the readings about x, y, z", count=3),
    )
    stands_for: ClassVar[tuple[str, ...]] = ("homing-offset", "tower-position")  # in a trusted frame
    called: ClassVar[str] = "tracker frame"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase("shift", "are shifted {what} toward +{axis}", "are shifted {what} toward -{axis}", "the readings"),
        Phrase(
            "turn",
            "are turned {what} counter-clockwise about {axis}",
            "are turned {what} clockwise about {axis}",
            "the readings",
        ),
    )
    card: ClassVar[Card] = Card(
        cause="The frame the readings are in is not the base frame: registration of the tracker.",
        equation="dp = t + w x p",
        source=RIGID,
        size="20 um to 1 mm, 0.1 to 1 mrad",
        fingerprint="The whole field moves and turns like a rigid body.",
        confused_with=(
            ("homing-offset", "common zero is z: base reflectors"),
            ("tower-position", "common sideways is x, y; common tangential a turn about z: base reflectors"),
            ("tower-tilt", "common lean with matching zeros is a turn about x, y: base reflectors"),
        ),
        remedy='Nothing on the machine: measure reflectors fixed to the base and use frame = "measured".',
        residual="x",
        telling="y",
        shade="z",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Rigid motion, first order."""
        return rigid_columns(view.p)


@dataclass(frozen=True)
class TrackerScale(MetrologyEffect):
    """The tracker's unit of length is off: s (p - c) about the place c where it stands, or s p about the base origin.

    The shift -s c has parameters of its own, so that the effect is linear. A frame that is fitted or measured absorbs
    it, and the readings then do not determine it.
    """

    name: ClassVar[str] = "tracker-scale"
    of_run: ClassVar[bool] = False  # the instrument's, in every run
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("scale", "1", USUAL_SCALE, "share by which readings are long"),
        Parameter("shift", "mm", USUAL_SCALE * AWAY, "what that moves in a trusted frame: -s c, x, y, z", count=3),
    )
    stands_for_away: ClassVar[int] = 2  # its shift looks like zeros and towers together
    product: ClassVar[bool] = True
    called: ClassVar[str] = "tracker scale"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase("scale", "reads lengths {what} too long", "reads lengths {what} too short", "the tracker"),
        Phrase("shift", "reads {what} too far toward +{axis}", "reads {what} too far toward -{axis}", "the tracker"),
    )
    card: ClassVar[Card] = Card(
        cause="The tracker's unit of length is off: wrong air temperature, pressure or humidity.",
        equation="dp = s (p - c), c where the tracker stands or the base origin: s p + u, of which a fitted frame "
        "takes u = -s c",
        source="refractive index of air: Edlen, Metrologia 2, 1966 (about 1 ppm/K and 0.27 ppm/hPa)",
        size="1 um/m for each K of the air; 1 to 20 um/m",
        fingerprint="All distances long by the same share: error radial, growing with distance.",
        confused_with=(
            ("link-length + tower-position + lead-scale + homing-offset", "together exactly that: read a scale bar"),
            ("frame-growth", "follows the machine's temperature: read a scale bar cold and warm"),
        ),
        remedy="Nothing on the machine: set the tracker's weather station right, read a calibrated scale bar.",
        residual="x",
        telling="x",
    )

    def largest(self, shape: Mapping[str, Tensor]) -> Mapping[str, float | Tensor]:
        """No more than the refractive index of air, which a tracker corrects for."""
        return {"scale": WITHOUT_AIR}

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """The position, and a constant shift."""
        eye = torch.eye(3, dtype=view.p.dtype).expand(len(view.p), 3, 3)
        return torch.cat([view.p[..., None], eye], dim=-1)


@dataclass(frozen=True)
class TrackerDrift(MetrologyEffect):
    """The tracker's station wanders with time: a t, or a (1 - exp(-t / T)) while it settles."""

    name: ClassVar[str] = "tracker-drift"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("drift", "mm", 0.02, "how far it goes over the whole run, x, y, z", count=3),
        Parameter(
            "settling", "s", 3600.0, "time constant T; a thousand times the run is a straight line", role="given"
        ),
        Parameter("duration", "s", 3600.0, "length of the run that the drift is stated for", role="given"),
    )
    requires: ClassVar[tuple[str, ...]] = ("time",)
    follows_clock: ClassVar[bool] = True
    called: ClassVar[str] = "tracker drift"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase(
            "drift",
            "drift {what} toward +{axis} over the run",
            "drift {what} toward -{axis} over the run",
            "the tracker's readings",
        ),
    )
    card: ClassVar[Card] = Card(
        cause="Tripod or floor settles, or the tracker is still warming up, so its station wanders.",
        equation="dp = a (1 - exp(-t/T))/(1 - exp(-D/T)), D the run's length; T = 1000 D is a straight line a t/D",
        source="first-order settling",
        size="5 to 50 um/h",
        fingerprint="A smooth trend with time in x, y or z, the same at every pose; seen in datum revisits.",
        confused_with=(
            ("frame-growth", "fixed reflectors stand still: read base reflectors, give temp_c"),
            ("screw-growth", "a slope in slider height: poses in random order, a datum every 20 points"),
            ("setup-jump", "at once, not slowly: revisit a datum every 20 points"),
        ),
        remedy="Nothing on the machine: warm the tracker up, stand it firmly, revisit a datum, re-register.",
        needs="time_s over more than an instant",
        residual="x",
        telling="time",
    )

    def cause(self, theta: Tensor, view: View) -> str:
        """With its time constant."""
        settling, duration = float(theta[-2]), float(theta[-1])
        pace = "at an even pace" if settling > 10.0 * duration else f"settling with a time constant of {settling:.0f} s"
        return f"tracker drift, {pace}"

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """A straight line and five time constants of settling."""
        whole = view.time.max()
        return tuple({"settling": (part * whole).reshape(1), "duration": whole.reshape(1)} for part in SETTLING)

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Constants between the neighbouring trials; the straight line is not a neighbour of any."""
        straight, *trials = self.search(view)
        return (
            (shape,)
            if float(shape["settling"]) >= float(straight["settling"])
            else between_trials(trials, shape, "settling")
        )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Share of the drift that is reached, in each coordinate."""
        reached = torch.expm1(-view.time / shape["settling"]) / torch.expm1(-shape["duration"] / shape["settling"])
        return reached[:, None, None] * torch.eye(3, dtype=view.p.dtype)


@dataclass(frozen=True)
class SetupJump(Sudden, MetrologyEffect):
    """The tripod was knocked: from some time on the readings are shifted and turned."""

    name: ClassVar[str] = "setup-jump"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("shift", "mm", 0.05, "translation of the readings after the knock, x, y, z", count=3),
        Parameter("turn", "rad", 5e-5, "rotation of the readings after the knock, about x, y, z", count=3),
        AFTER,
    )
    called: ClassVar[str] = "knock of the tracker"
    phrases: ClassVar[tuple[Phrase, ...]] = (
        Phrase("shift", "jump {what} toward +{axis}", "jump {what} toward -{axis}", "the tracker's readings"),
        Phrase(
            "turn",
            "turn {what} counter-clockwise about {axis}",
            "turn {what} clockwise about {axis}",
            "the tracker's readings",
        ),
    )
    card: ClassVar[Card] = Card(
        cause="The tripod was knocked, or the tracker was set up anew without registration.",
        equation=(
            "dp = t + w x p after a moment, zero until then (seconds, or rows where there is no clock): six free "
            "numbers and a moment that is searched, so it can imitate much that begins part-way"
        ),
        source=RIGID,
        size="10 to 500 um",
        fingerprint="From one row on the whole field is shifted and turned; repeats before and after disagree.",
        confused_with=(
            ("tracker-drift", "slow, not at once: a datum every 20 points"),
            ("homing-slip", "one slider's zero moves, base reflectors stay: read base reflectors, revisit a datum"),
            ("poor repeatability", "scatter without order in time: keep the rows in the order of measuring"),
        ),
        remedy="Nothing on the machine: register again, or give the rows after the knock their own run.",
        needs="time_s or rows in order of measuring, at least 20",
        residual="x",
        telling="time",
    )

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Rigid motion after the knock."""
        return self.since(view, shape)[:, None, None] * rigid_columns(view.p)
