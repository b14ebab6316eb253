"""The drawing of a machine: what [machine] of machine.toml says."""

import math
from typing import Annotated, ClassVar, Literal

import pydantic
from pydantic import BaseModel, ConfigDict, Discriminator, Field, NonNegativeFloat, PositiveFloat

LEAST_APART = 1.0  # deg between sliders; nearer, the links are coplanar everywhere (a direct singularity)

Lead = Annotated[float, Field(ge=0.01, le=1e4)]  # mm a turn: no nut takes a finer thread
Period = Annotated[float, Field(ge=1e-5, le=1e4)]  # rad: finer than any gear
Sigma = Annotated[float, Field(ge=1e-9)]  # mm; a hundredth of an atom: less is no scatter, and its square vanishes
Celsius = Annotated[float, Field(ge=-100.0, le=100.0)]  # no machine is warmer or colder; 293 is kelvin
Pair = tuple[float, float]
Triple = tuple[float, float, float]


class Frozen(BaseModel):
    """A table of machine.toml: nothing in it that is not known, nothing infinite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ThreePttSpec(Frozen):
    """The drawing of a 3-PTT machine; units are in the key names."""

    kind: Literal["three-ptt"]
    name: str = "machine"
    base_radius_mm: PositiveFloat
    platform_radius_mm: PositiveFloat
    link_length_mm: PositiveFloat
    slider_azimuth_deg: Triple = (0.0, 120.0, 240.0)
    slider_travel_mm: Pair | tuple[Pair, Pair, Pair]
    screw_lead_mm: Lead | None = None
    sliders: Literal["above", "below"] = "above"
    joint_height_mm: float = 0.0
    slider_lean_deg: Triple = (0.0, 0.0, 0.0)
    moves: Literal["sliders", "straight", "smooth"] = "sliders"
    reference_temp_c: Celsius = 20.0
    reflector_mm: Triple = (0.0, 0.0, 0.0)
    platform_mass_kg: NonNegativeFloat = 0.0

    joints: ClassVar[int] = 3
    noun: ClassVar[str] = "slider"
    letter: ClassVar[str] = "b"
    unit: ClassVar[Literal["mm"]] = "mm"

    @property
    def turn(self) -> float | None:
        """How far a joint goes in one turn of its screw, mm."""
        return self.screw_lead_mm

    @property
    def travel_ends(self) -> tuple[Pair, Pair, Pair]:
        """Least and greatest height of each slider, mm."""
        first = self.slider_travel_mm[0]
        if isinstance(first, tuple):
            return self.slider_travel_mm  # type: ignore[return-value]
        return (self.slider_travel_mm,) * 3  # type: ignore[return-value]

    @property
    def common_travel(self) -> Pair:
        """Heights that every slider reaches, mm; the first is the larger one where there are none."""
        return max(low for low, _ in self.travel_ends), min(high for _, high in self.travel_ends)

    @property
    def whole_travel(self) -> Pair:
        """Least and greatest height that any slider reaches, mm."""
        return min(low for low, _ in self.travel_ends), max(high for _, high in self.travel_ends)

    @pydantic.field_validator("slider_azimuth_deg")
    @classmethod
    def _check_azimuths(cls, value: Triple) -> Triple:
        for first, second in ((0, 1), (0, 2), (1, 2)):
            apart = abs((value[first] - value[second] + 180.0) % 360.0 - 180.0)
            if apart < LEAST_APART:
                raise ValueError(
                    f"sliders {first + 1} and {second + 1} stand at one azimuth: the tool could not be held"
                )
        if max(map(abs, value)) > 3600.0:
            raise ValueError("an azimuth beyond ten turns")
        return value

    @pydantic.model_validator(mode="after")
    def _check_geometry(self) -> "ThreePttSpec":
        if any(low >= high for low, high in self.travel_ends):
            raise ValueError("slider_travel_mm: the lower end must come first and be smaller than the upper end")
        spread = abs(self.base_radius_mm - self.platform_radius_mm)
        if spread >= self.link_length_mm:
            raise ValueError(
                f"link_length_mm: links of {self.link_length_mm:g} mm are too short to reach from the sliders to the "
                f"platform, {spread:g} mm further in; is a diameter given for a radius?"
            )
        return self


class JointSpec(Frozen):
    """One revolute joint of a serial arm, Denavit-Hartenberg."""

    a_mm: float = 0.0
    alpha_deg: float = 0.0
    d_mm: float = 0.0
    theta_offset_deg: float = 0.0
    limits_deg: Pair | None = None
    mass_kg: NonNegativeFloat | None = None
    com_mm: Triple | None = None

    @pydantic.field_validator("limits_deg")
    @classmethod
    def _check_limits(cls, value: Pair | None) -> Pair | None:
        if value is not None and value[0] >= value[1]:
            raise ValueError("the lower end must come first and be smaller than the upper end")
        return value


class SerialSpec(Frozen):
    """The drawing of a serial arm of revolute joints."""

    kind: Literal["serial"]
    name: str = "arm"
    convention: Literal["standard", "modified"]
    tool_mm: Triple = (0.0, 0.0, 0.0)
    joint: tuple[JointSpec, ...] = Field(min_length=1)
    moves: Literal["sliders", "straight", "smooth"] = "sliders"
    reference_temp_c: Celsius = 20.0
    gear_period_rad: Period | None = None
    gravity: Triple = (0.0, 0.0, -1.0)

    noun: ClassVar[str] = "joint"
    letter: ClassVar[str] = "q"
    unit: ClassVar[Literal["rad"]] = "rad"

    @property
    def joints(self) -> int:
        """How many."""
        return len(self.joint)

    @property
    def travel_ends(self) -> tuple[Pair, ...]:
        """Least and greatest angle of each joint, rad; infinite where it has no limits."""
        ends = [joint.limits_deg or (-math.inf, math.inf) for joint in self.joint]
        return tuple((math.radians(low), math.radians(high)) for low, high in ends)

    @property
    def turn(self) -> float:
        """How far a joint goes in one turn of its gear, rad."""
        return self.gear_period_rad or 2.0 * math.pi

    @property
    def reflector_mm(self) -> Triple:
        """Where the reflector is on the last link."""
        return self.tool_mm

    @pydantic.model_validator(mode="after")
    def _check_gravity(self) -> "SerialSpec":
        if not any(self.gravity):
            raise ValueError("gravity: the direction in which weights pull, such as [0, 0, -1], cannot be all zero")
        return self


MachineSpec = Annotated[ThreePttSpec | SerialSpec, Discriminator("kind")]
