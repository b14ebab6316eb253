"""[[odd]] of a RIG.toml: faults of an arm that no effect of the library describes."""

from typing import Annotated, Literal

import pydantic
from pydantic import Field, NonNegativeFloat, PositiveFloat

from ptt.rig.schema import Law, Section, Triple

Joint = Annotated[int, Field(ge=1, le=7)]
Place = Literal["joint", "lean-x", "lean-y", "tool-x", "tool-y", "tool-z", "sight-x", "sight-y", "sight-z"]


class OfArm(Section):
    """A fault of an arm."""


class OnJoint(OfArm):
    """A fault of one joint."""

    joint: Joint


class HardeningJoint(OnJoint):
    """A joint that is soft at first and hardens: size t / (half + |t|) under a torque t.

    Source: soft and stiff zone of strain-wave gears, Tuttle and Seering, IEEE Trans. Robotics and Automation 12, 1996.
    """

    kind: Literal["hardening-joint"]
    size_urad: float
    half_nmm: PositiveFloat
    hand_kg: NonNegativeFloat = 0.0


class LoadedFriction(OnJoint):
    """A joint that stops short of where it goes, the more it is loaded: Coulomb friction by load."""

    kind: Literal["loaded-friction"]
    urad_per_nmm: float
    hand_kg: NonNegativeFloat = 0.0


class DamagedTooth(OnJoint):
    """A damaged tooth: a bump of Gaussian shape at one angle of every turn of the wheel."""

    kind: Literal["damaged-tooth"]
    angle_rad: float
    width_rad: PositiveFloat
    size_urad: float
    turn_rad: PositiveFloat = 6.283185307179586


class SlippingTool(OfArm):
    """A tool that slips in its holder in the middle of a run."""

    kind: Literal["slipping-tool"]
    shift_um: Triple
    share: Annotated[float, Field(ge=0, le=1)] = 0.5


class RockingBase(OfArm):
    """A base that rocks on its bolts under the moment of the arm and what it carries, as springs would let it.

    Source: rotation = compliance x (r x F), F the weight of arm and payload as if it were at the tool, r from the base.
    """

    kind: Literal["rocking-base"]
    nrad_per_nmm: float
    moving_kg: NonNegativeFloat = 10.0


class WobblingAxis(OnJoint):
    """A bearing whose race is out of round: the axis leans round and round, some times a turn of the joint."""

    kind: Literal["wobbling-axis"]
    size_urad: float
    times: Annotated[int, Field(ge=1, le=50)] = 2
    phase_rad: float = 0.0


class DressPack(OnJoint):
    """Cables that drag at a joint against its travel, the more the farther it has turned from one end to another."""

    kind: Literal["dress-pack"]
    low_rad: float
    high_rad: float
    size_urad: float

    @pydantic.model_validator(mode="after")
    def _check(self) -> "DressPack":
        if self.low_rad == self.high_rad:
            raise ValueError("low_rad and high_rad are the same")
        return self


class BeltResonance(OnJoint):
    """A belt that swings with its own period, no whole part of a turn."""

    kind: Literal["belt-resonance"]
    size_urad: float
    period_rad: PositiveFloat
    phase_rad: float = 0.0


class RoundingController(OnJoint):
    """A controller that sends the nearest of its counts."""

    kind: Literal["rounding-controller"]
    step_urad: PositiveFloat


class WarmJoint(OnJoint):
    """A joint whose bearing block moves with the room's warmth, which it takes on slowly; all others stay."""

    kind: Literal["warm-joint"]
    urad_per_k: float
    constant_s: NonNegativeFloat = 0.0


class BusyJoint(OnJoint):
    """A motor that warms its own joint: it moves with the heat of its work, which it keeps for long."""

    kind: Literal["busy-joint"]
    urad_s_per_rad: float
    constant_s: PositiveFloat


class CoupledJoints(OnJoint):
    """A hollow wrist whose gears run on one another: a joint turns by the square of another's way from an angle."""

    kind: Literal["coupled-joints"]
    other: Joint
    angle_rad: float
    span_rad: PositiveFloat
    size_urad: float


class LoadedPlay(OnJoint):
    """A gear whose preload the payload takes off: the gap opens in proportion above a load."""

    kind: Literal["loaded-play"]
    urad_per_kg: NonNegativeFloat
    opens_at_kg: NonNegativeFloat = 0.0


class LossAtReversal(OnJoint):
    """A coupling that loses a little at every reversal."""

    kind: Literal["loss-at-reversal"]
    urad_per_reversal: float


class ArmLaw(OfArm, Law):
    """A random law that acts at a place: urad on a joint or where its axis leans, um on an axis of tool or base."""

    kind: Literal["arm-law"]
    place: Place
    joint: Joint | None = None
    size: float

    @pydantic.model_validator(mode="after")
    def _check(self) -> "ArmLaw":
        if (self.joint is None) == (self.place in ("joint", "lean-x", "lean-y")):
            raise ValueError("joint: faults of a joint and its axis have one, the others none")
        return self
