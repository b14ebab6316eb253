"""Faults that no effect of the library describes: shifts of sliders, links, tool and readings of a 3-PTT."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.rig import odd_schema as kinds
from ptt.rig.nominal import Array
from ptt.rig.odd_law import random_law
from ptt.rig.odd_state import SliderState, heat_of_work
from ptt.rig.units import MM_PER_UM, RAD_PER_URAD

DIRECTIONS = ("along", "radial", "tangential")
NO_SHIFTS = (kinds.Hose, kinds.WarmBacklash, kinds.LoadBacklash)  # forces and gaps, not shifts


@dataclass(frozen=True)
class OddShifts:
    """Shifts by odd faults.

    Attributes:
        slider: (n, 3, 3) mm, of each slider: along its rail, across it outward, tangentially.
        link: (n, 3) mm, added to the length of each link.
        tool: (n, 3) mm, of the tool, base frame.
        sight: (n, 3) mm, of the readings alone, as by the line of sight, base frame.
    """

    slider: Array
    link: Array
    tool: Array
    sight: Array


def odd_shifts(odd: Sequence[kinds.Odd], state: SliderState) -> OddShifts:
    """Sum of the shifts by odd faults.

    Args:
        odd: the faults.
        state: the run, with the slider heights that faults are to follow.

    Returns:
        The shifts.
    """
    rows = len(state.time)
    total = OddShifts(np.zeros((rows, 3, 3)), np.zeros((rows, 3)), np.zeros((rows, 3)), np.zeros((rows, 3)))
    for fault in odd:
        if isinstance(fault, NO_SHIFTS):
            continue
        if isinstance(fault, kinds.SettlingTable):
            total.tool[:] += _tilt(fault, state)
        elif isinstance(fault, kinds.RandomLaw):
            _add(total, fault.place, fault.leg, fault.size_um * random_law(fault, state))
        elif isinstance(fault, kinds.OnLeg):
            place = "link" if isinstance(fault, kinds.LooseJoint) else getattr(fault, "direction", "along")
            _add(total, place, fault.leg, _profile(fault, state))
    return total


def extra_gap(odd: Sequence[kinds.Odd], screw: Array, payload: Array) -> Array:
    """Backlash that opens with temperature or load.

    Args:
        odd: the faults.
        screw: (n, 3) degrees Celsius, temperatures of the screws.
        payload: (n,) kg.

    Returns:
        (n, 3) mm, added to the gap of each nut.
    """
    gap = np.zeros_like(screw)
    for fault in odd:
        if isinstance(fault, kinds.WarmBacklash):
            above = np.maximum(screw[:, fault.leg - 1] - fault.opens_at_c, 0.0)
            gap[:, fault.leg - 1] += MM_PER_UM * fault.gap_um_per_k * above
        elif isinstance(fault, kinds.LoadBacklash):
            gap[:, fault.leg - 1] += MM_PER_UM * fault.gap_um_per_kg * np.maximum(payload - fault.opens_at_kg, 0.0)
    return gap


def hose_force(hose: kinds.Hose, position: Array) -> Array:
    """Force of a hose on the platform: a constant pull, and that of a spring once the hose is taut.

    Args:
        hose: the fault.
        position: (n, 3) mm, platform centre.

    Returns:
        (n, 3) N, towards the anchor.
    """
    towards = np.asarray(hose.anchor_mm) - position
    length = np.linalg.norm(towards, axis=1, keepdims=True)
    tension = hose.pull_n + hose.stiffness_n_per_mm * np.maximum(length - hose.free_length_mm, 0.0)
    return tension * towards / np.maximum(length, 1e-9)


def _add(total: OddShifts, place: str, leg: int | None, size: Array) -> None:
    """Add sizes (n,) um at a place: a direction of a slider, a link, or an axis of tool or sight."""
    if leg is None:
        where, axis = place.split("-")
        getattr(total, where)[:, "xyz".index(axis)] += MM_PER_UM * size
    elif place == "link":
        total.link[:, leg - 1] += MM_PER_UM * size
    else:
        total.slider[:, leg - 1, DIRECTIONS.index(place)] += MM_PER_UM * size


def _profile(fault: kinds.OnLeg, state: SliderState) -> Array:
    """Size of a fault of one leg, (n,) um."""
    leg = fault.leg - 1
    height = state.joint[:, leg]
    match fault:
        case kinds.Splice():
            return np.where(height > fault.height_mm, fault.step_um, 0.0)
        case kinds.Periodic():
            return fault.size_um * np.cos(2.0 * np.pi * height / fault.period_mm - fault.phase_rad)
        case kinds.Bump():
            return fault.size_um * np.exp(-0.5 * ((height - fault.height_mm) / fault.width_mm) ** 2)
        case kinds.GuideDamage():
            part = np.clip((height - fault.height_mm) / fault.width_mm, -0.5, 0.5)
            return fault.size_um * 0.5 * (1.0 + np.cos(2.0 * np.pi * part))
        case kinds.CrossCoupling():
            return -fault.size_um * ((state.joint[:, fault.other - 1] - fault.height_mm) / fault.span_mm) ** 2
        case kinds.CableDrag():
            part = np.clip((height - fault.low_mm) / (fault.high_mm - fault.low_mm), 0.0, 1.0)
            return -fault.size_um * part * state.direction[:, leg]
        case kinds.LooseJoint():
            return 0.5 * fault.size_um * np.sign(state.tool @ state.drawing.sideways[leg])
        case kinds.LooseClamp():
            return fault.um_per_mm * np.maximum(height - fault.height_mm, 0.0)
        case kinds.ScalePitch():
            return fault.size_um * (2.0 * ((height / fault.pitch_mm + fault.phase) % 1.0) - 1.0)
        case _:
            return _profile_of_history(fault, state)


def _profile_of_history(fault: kinds.OnLeg, state: SliderState) -> Array:
    """Size of a fault of one leg that depends on the travel so far, (n,) um."""
    leg = fault.leg - 1
    match fault:
        case kinds.MotorHeat():
            return fault.um_s_per_mm * heat_of_work(state, leg, fault.constant_s)
        case kinds.StickSlip():
            return -fault.size_um * state.direction[:, leg] * np.exp(-state.step[:, leg] / fault.step_mm)
        case kinds.SlippingCoupling():
            return -fault.um_per_reversal * state.reversals[:, leg]
        case kinds.CarriageTip():
            return 0.5 * fault.size_um * state.direction[:, leg]
        case _:
            raise AssertionError(f"no shift is defined for {type(fault).__name__}")


def _tilt(fault: kinds.SettlingTable, state: SliderState) -> Array:
    """Shift of the tool by a table that tilts about a pivot below it, towards the load, (n, 3) mm; first order."""
    mass = state.payload + state.platform + fault.moving_kg
    x, y, z = state.tool.T
    tilt = RAD_PER_URAD * fault.urad_per_kg_mm * mass
    lever = z + fault.pivot_mm
    # A tilt of t x towards +x moves the tool by t x lever sideways and by -t x^2 down.
    return np.column_stack([tilt * x * lever, tilt * y * lever, -tilt * (x**2 + y**2)])
