"""Sections of a RIG.toml: conditions of a run and faults of the virtual machine; units are part of the keys."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    model_validator,
)

Triple = tuple[float, float, float]


def _spread(value: object) -> object:
    """One number stands for all three legs."""
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _apart(ends: tuple[float, float]) -> tuple[float, float]:
    """A variable is scaled by the width of its span."""
    if ends[0] == ends[1]:
        raise ValueError("the two ends of a span are the same")
    return ends


def _rising(heights: tuple[float, ...]) -> tuple[float, ...]:
    """A cubic spline needs knots in order."""
    if any(after <= before for before, after in pairwise(heights)):
        raise ValueError("heights have to rise from one to the next")
    return heights


PerLeg = Annotated[Triple, BeforeValidator(_spread)]
GapPerLeg = Annotated[tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat], BeforeValidator(_spread)]
LengthPerLeg = Annotated[tuple[PositiveFloat, PositiveFloat, PositiveFloat], BeforeValidator(_spread)]
Leg = Annotated[int, Field(ge=1, le=3)]
Span = Annotated[tuple[float, float], AfterValidator(_apart)]
Heights = Annotated[tuple[float, ...], AfterValidator(_rising)]
ZERO: Triple = (0.0, 0.0, 0.0)
NO_TABLE: tuple[tuple[float, ...], ...] = ()


class Section(BaseModel):
    """A table of the file: frozen, no unknown keys, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Law(Section):
    """A random function, smooth, in steps or periodic, of variables scaled to -1 ... 1."""

    form: Literal["smooth", "jumpy", "periodic"]
    variables: Annotated[tuple[str, ...], Field(min_length=1)]
    span: tuple[Span, ...]
    law_seed: NonNegativeInt = 0
    memory_s: PositiveFloat = 1200.0

    @model_validator(mode="after")
    def _check_spans(self) -> Self:
        if len(self.span) != len(self.variables):
            raise ValueError("span: give one pair for each variable")
        return self


class Room(Section):
    """Room temperature: start + rise (1 - exp(-t / time constant)) + swing sin(2 pi t / period)."""

    start_c: float = 20.0
    rise_k: float = 0.0
    time_constant_s: PositiveFloat = 3600.0
    swing_k: float = 0.0
    swing_period_s: PositiveFloat = 86400.0


class Conditions(Section):
    """Conditions of a run: cycles, payload, feed, dwells, room, and the columns it reports."""

    label: str = "run 1"
    cycles: Annotated[int, Field(ge=1)] = 1
    run_per_cycle: bool = False
    payload_kg: NonNegativeFloat = 0.0
    payload_per_cycle_kg: tuple[NonNegativeFloat, ...] = ()
    feed_mm_s: PositiveFloat = 50.0
    feed_per_cycle_mm_s: tuple[PositiveFloat, ...] = ()
    moving: bool = False
    dwell_s: NonNegativeFloat = 2.0
    pause_s: NonNegativeFloat = 0.0
    lead_in_mm: NonNegativeFloat = 10.0
    report_force: bool = False
    report_direction: bool = False
    room: Room = Room()


class Controller(Section):
    """Compensation by the controller: it adds half of the backlash it knows in the direction of travel."""

    backlash_mm: PerLeg = ZERO


class Drive(Section):
    """Faults between the command and the slider."""

    homing_mm: PerLeg = ZERO
    homing_scatter_mm: NonNegativeFloat = 0.0
    slip_mm: PerLeg = ZERO
    slip_row: NonNegativeInt | None = None
    slip_time_s: NonNegativeFloat | None = None
    scale_um_per_m: PerLeg = ZERO
    curve_parabola_um: PerLeg = ZERO
    curve_cubic_um: PerLeg = ZERO
    curve_span_mm: Span | None = None
    map_height_mm: Heights = ()
    map_um: tuple[tuple[float, ...], ...] = NO_TABLE
    turn_um: PerLeg = ZERO
    turn_phase_rad: PerLeg = ZERO
    turn2_um: PerLeg = ZERO
    turn2_phase_rad: PerLeg = ZERO
    backlash_mm: GapPerLeg = ZERO
    windup_um: PerLeg = ZERO
    windup_length_mm: LengthPerLeg = (1.0, 1.0, 1.0)
    friction_um: PerLeg = ZERO
    friction_length_mm: LengthPerLeg = (1.0, 1.0, 1.0)
    following_s: PerLeg = ZERO
    compliance_um_per_n: PerLeg = ZERO


class Thermal(Section):
    """Thermal growth from the reference temperature, time constants of screws and frame, and the sensor."""

    growth_um_per_m_k: PerLeg = ZERO
    fixed_end_mm: PerLeg = ZERO
    screw_lag_s: NonNegativeFloat = 0.0
    duty_k_s_per_mm: NonNegativeFloat = 0.0
    frame_um_per_m_k: float = 0.0
    platform_um_per_m_k: float = 0.0
    link_um_per_m_k: float = 0.0
    frame_lag_s: NonNegativeFloat = 0.0
    sensor: Literal["screw", "screw 1", "screw 2", "screw 3", "frame", "room"] = "screw"
    sensor_sigma_k: NonNegativeFloat = 0.0


class Geometry(Section):
    """Faults of rails, links, universal joints and platform."""

    tower_radial_mm: PerLeg = ZERO
    tower_tangential_mm: PerLeg = ZERO
    platform_joint_radial_mm: PerLeg = ZERO
    platform_joint_tangential_mm: PerLeg = ZERO
    lean_radial_mrad: PerLeg = ZERO
    lean_tangential_mrad: PerLeg = ZERO
    lean_turns_joint_axis: bool = False
    link_mm: PerLeg = ZERO
    link_compliance_um_per_n: PerLeg = ZERO
    straightness_um: PerLeg = ZERO
    straightness_seed: NonNegativeInt = 0
    straightness_span_mm: Span | None = None
    straightness_waves: Annotated[int, Field(ge=1, le=20)] = 3
    straightness_height_mm: Heights = ()
    straightness_radial_um: tuple[tuple[float, ...], ...] = NO_TABLE
    straightness_tangential_um: tuple[tuple[float, ...], ...] = NO_TABLE
    joint_offset_rail_mm: PerLeg = ZERO
    joint_offset_slider_mm: PerLeg = ZERO
    joint_offset_platform_mm: PerLeg = ZERO
    slider_axis_radial_mrad: PerLeg = ZERO
    slider_axis_vertical_mrad: PerLeg = ZERO
    platform_axis_radial_mrad: PerLeg = ZERO
    platform_axis_vertical_mrad: PerLeg = ZERO
    clearance_um: PerLeg = ZERO


PerJoint = tuple[float, ...]
NonNegativePerJoint = tuple[NonNegativeFloat, ...]


class Arm(Section):
    """Faults of a serial arm; a list has one value per joint, an empty one stands for zeros."""

    backlash_mrad: NonNegativePerJoint = ()
    added_mrad: NonNegativePerJoint = ()
    windup_urad: NonNegativePerJoint = ()
    windup_length_mrad: tuple[PositiveFloat, ...] = ()
    slip_mrad: PerJoint = ()
    slip_row: NonNegativeInt | None = None
    scale_urad_per_rad: PerJoint = ()
    compliance_nrad_per_nmm: NonNegativePerJoint = ()
    turn_urad: PerJoint = ()
    turn_phase_rad: PerJoint = ()
    turn_harmonic: Annotated[int, Field(ge=1, le=1000)] = 1
    ring_urad: tuple[tuple[float, ...], ...] = ()
    ring_phase_rad: tuple[tuple[float, ...], ...] = ()
    link_a_mm: PerJoint = ()
    link_alpha_mrad: PerJoint = ()
    link_d_mm: PerJoint = ()
    link_theta_mrad: PerJoint = ()
    link_beta_mrad: PerJoint = ()
    growth_um_per_m_k: float = 0.0
    offset_growth_um_per_m_k: float | None = None
    mass_kg: NonNegativePerJoint = ()
    com_mm: tuple[Triple, ...] = ()
    reflector_mm: Triple = ZERO
    reflector_scatter_mm: NonNegativeFloat = 0.0


class Structure(Section):
    """The column that carries the sliders: a cantilever that the payload bends horizontally."""

    column_bend_um_per_kg: tuple[float, float] = (0.0, 0.0)
    column_height_mm: PositiveFloat = 800.0
    column_per_slider: bool = False


class Tracker(Section):
    """The laser tracker: its station, the frame of its readings, and its errors."""

    station_mm: Triple = (0.0, -3000.0, 300.0)
    translation_mm: Triple = ZERO
    rotation_mrad: Triple = ZERO
    frame_scatter_mm: NonNegativeFloat = 0.0
    frame_scatter_mrad: NonNegativeFloat = 0.0
    scale_ppm: float = 0.0
    drift_um_per_h: Triple = ZERO
    drift_um: Triple = ZERO
    drift_constant_s: PositiveFloat = 3600.0
    knock_row: NonNegativeInt | None = None
    knock_time_s: NonNegativeFloat | None = None
    knock_um: Triple = ZERO
    knock_mrad: Triple = ZERO
    radial_um: NonNegativeFloat = 1.0
    sideways_um_per_m: NonNegativeFloat = 1.25
    white_mm: NonNegativeFloat | None = None
    heavy_dof: Annotated[float, Field(gt=2)] | None = None
    axis_um: Triple = ZERO
    quantum_um: NonNegativeFloat = 0.0
    wander_um: NonNegativeFloat = 0.0
    wander_s: PositiveFloat = 300.0
    outlier_share: Annotated[float, Field(ge=0, le=1)] = 0.0
    outlier_mm: NonNegativeFloat = 0.2
    missing_share: Annotated[float, Field(ge=0, le=1)] = 0.0
    report_std: bool = False
    measure_base: bool | None = None
    base_every: NonNegativeInt = 0
    datum_every: NonNegativeInt = 0
    datum_mm: Triple = ZERO
