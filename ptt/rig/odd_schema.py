"""[[odd]] of a RIG.toml: faults of a 3-PTT that no effect of the library describes."""

from typing import Annotated, Literal

import pydantic
from pydantic import Field, NonNegativeFloat, PositiveFloat

from ptt.rig import arm_odd_schema as arm
from ptt.rig.schema import Law, Leg, PerLeg, Section, Triple

Place = Literal["along", "radial", "tangential", "link", "tool-x", "tool-y", "tool-z", "sight-x", "sight-y", "sight-z"]
Variable = Literal[
    "b1", "b2", "b3", "x", "y", "z", "direction1", "direction2", "direction3", "speed1", "speed2", "speed3",
    "payload", "temperature", "memory", "time",
]  # fmt: skip


class OnLeg(Section):
    """A fault of one slider, rail or link."""

    leg: Leg


class Splice(OnLeg):
    """Two pieces of linear scale that do not join: a step at a height."""

    kind: Literal["splice"]
    height_mm: float
    step_um: float


class GuideDamage(OnLeg):
    """A damaged spot on a guide: a bump of raised-cosine shape, `width_mm` from foot to foot."""

    kind: Literal["guide-damage"]
    height_mm: float
    size_um: float
    width_mm: PositiveFloat = 10.0
    direction: Literal["along", "radial", "tangential"] = "along"


class Periodic(OnLeg):
    """A periodic error whose period is no screw's, such as a roller's."""

    kind: Literal["periodic"]
    size_um: float
    period_mm: PositiveFloat
    phase_rad: float = 0.0


class Bump(OnLeg):
    """A Gaussian error of one slider over its height, such as a worn part of its screw."""

    kind: Literal["bump"]
    height_mm: float
    size_um: float
    width_mm: PositiveFloat


class Hose(Section):
    """A hose from an anchor to the platform: tension = pull + stiffness (length - free length), never pushing."""

    kind: Literal["hose"]
    anchor_mm: Triple
    pull_n: NonNegativeFloat = 0.0
    stiffness_n_per_mm: NonNegativeFloat = 0.0
    free_length_mm: NonNegativeFloat = 0.0
    compliance_um_per_n: PerLeg = (0.2, 0.2, 0.2)


class WarmBacklash(OnLeg):
    """A nut that loses its preload when warm: the gap opens in proportion above a temperature."""

    kind: Literal["warm-backlash"]
    gap_um_per_k: NonNegativeFloat
    opens_at_c: float


class LoadBacklash(OnLeg):
    """A nut whose preload the payload takes off: the gap opens in proportion above a load."""

    kind: Literal["load-backlash"]
    gap_um_per_kg: NonNegativeFloat
    opens_at_kg: NonNegativeFloat = 0.0


class CrossCoupling(OnLeg):
    """A crossbeam that sags under another slider: this one sinks with the square of that one's way from a height."""

    kind: Literal["cross-coupling"]
    other: Leg
    height_mm: float
    span_mm: PositiveFloat
    size_um: float


class CableDrag(OnLeg):
    """A cable chain that drags the more of it hangs on the slider: against the travel, growing from low to high."""

    kind: Literal["cable-drag"]
    low_mm: float
    high_mm: float
    size_um: float

    @pydantic.model_validator(mode="after")
    def _check(self) -> "CableDrag":
        if self.low_mm == self.high_mm:
            raise ValueError("low_mm and high_mm are the same")
        return self


class LooseJoint(OnLeg):
    """A universal joint that rattles across: its link is longer on one side of the leg's plane than on the other."""

    kind: Literal["loose-joint"]
    size_um: float


class SettlingTable(Section):
    """A table that tilts under the moment of what moves on it, about a pivot below the tool."""

    kind: Literal["settling-table"]
    urad_per_kg_mm: float
    moving_kg: NonNegativeFloat = 10.0
    pivot_mm: PositiveFloat = 500.0


class LooseClamp(OnLeg):
    """A rail that its upper clamp no longer holds: it yields sideways above a height."""

    kind: Literal["loose-clamp"]
    height_mm: float
    um_per_mm: float
    direction: Literal["radial", "tangential"] = "radial"


class MotorHeat(OnLeg):
    """A motor that warms its own bearing block: the slider moves with the heat of its work, which it keeps for long."""

    kind: Literal["motor-heat"]
    um_s_per_mm: float
    constant_s: PositiveFloat


class ScalePitch(OnLeg):
    """An encoder that interpolates badly within its pitch: a sawtooth over the height."""

    kind: Literal["scale-pitch"]
    pitch_mm: PositiveFloat
    size_um: float
    phase: float = 0.0


class StickSlip(OnLeg):
    """A slider that stops short of where a short step should take it."""

    kind: Literal["stick-slip"]
    size_um: float
    step_mm: PositiveFloat


class SlippingCoupling(OnLeg):
    """A coupling that loses a little at every reversal."""

    kind: Literal["slipping-coupling"]
    um_per_reversal: float


class CarriageTip(OnLeg):
    """A carriage with play on its rail that tips over on reversal: sideways, half to either side."""

    kind: Literal["carriage-tip"]
    size_um: float
    direction: Literal["radial", "tangential"] = "tangential"


class RandomLaw(Law):
    """A random law that acts at a place."""

    kind: Literal["random-law"]
    place: Place
    leg: Leg | None = None
    variables: Annotated[tuple[Variable, ...], Field(min_length=1)]
    size_um: float

    @pydantic.model_validator(mode="after")
    def _check(self) -> "RandomLaw":
        if (self.leg is None) == (self.place in ("along", "radial", "tangential", "link")):
            raise ValueError("leg: slider, rail and link faults have one, the others none")
        return self


# Of a 3-PTT, and of an arm.
Odd = Annotated[
    Splice | GuideDamage | Periodic | Bump | Hose | WarmBacklash | LoadBacklash | CrossCoupling | CableDrag
    | LooseJoint | SettlingTable | LooseClamp | MotorHeat | ScalePitch | StickSlip | SlippingCoupling | CarriageTip
    | RandomLaw
    | arm.HardeningJoint | arm.LoadedFriction | arm.DamagedTooth | arm.SlippingTool | arm.RockingBase
    | arm.WobblingAxis | arm.DressPack | arm.BeltResonance | arm.RoundingController | arm.WarmJoint | arm.BusyJoint
    | arm.CoupledJoints | arm.LoadedPlay | arm.LossAtReversal | arm.ArmLaw,
    Field(discriminator="kind"),
]  # fmt: skip
