"""Faults of an arm that no effect of the library describes: shifts of joints, axes, tool, base and readings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.rig import arm_odd_schema as kinds
from ptt.rig.nominal import Array
from ptt.rig.odd_law import scaled, unit_law
from ptt.rig.odd_schema import Odd
from ptt.rig.serial_arm import ArmShifts
from ptt.rig.thermal import lag
from ptt.rig.units import GRAVITY, MM_PER_UM, RAD_PER_NRAD, RAD_PER_URAD


@dataclass(frozen=True)
class ArmState:
    """A run of an arm, row by row.

    Attributes:
        q: (n, k) rad, commands.
        direction: (n, k), direction of arrival, +1 or -1.
        step: (n, k) rad, travel of each joint since the row before.
        reversals: (n, k), number of reversals of each joint so far.
        lever: (n, k) N mm/kg, torque of gravity about each joint for each kg at the tool.
        tool: (n, 3) mm, commanded.
        down: (3,), direction of gravity in the base frame.
        payload: (n,) kg.
        temperature: (n,) degrees Celsius, of the room.
        time: (n,) s from the first row.
    """

    q: Array
    direction: Array
    step: Array
    reversals: Array
    lever: Array
    tool: Array
    down: Array
    payload: Array
    temperature: Array
    time: Array


def shift_arm(odd: Sequence[Odd], state: ArmState) -> ArmShifts:
    """Sum of the shifts by odd faults.

    Args:
        odd: the faults.
        state: the run.

    Returns:
        The shifts.
    """
    total = ArmShifts.none(*state.q.shape)
    for fault in odd:
        match fault:
            case kinds.SlippingTool():
                late = arm_variable("time", state) >= fault.share
                total.hand[:] += np.outer(late, MM_PER_UM * np.asarray(fault.shift_um))
            case kinds.RockingBase():
                force = np.outer(GRAVITY * (state.payload + fault.moving_kg), state.down)
                total.base[:] += RAD_PER_NRAD * fault.nrad_per_nmm * np.cross(state.tool, force)
            case kinds.WobblingAxis():
                phase = fault.times * state.q[:, fault.joint - 1] - fault.phase_rad
                lean = np.stack([np.cos(phase), np.sin(phase)], axis=-1)
                total.tilt[:, fault.joint - 1] += RAD_PER_URAD * fault.size_urad * lean
            case kinds.LoadedPlay():
                above = np.maximum(state.payload - fault.opens_at_kg, 0.0)
                total.gap[:, fault.joint - 1] += RAD_PER_URAD * fault.urad_per_kg * above
            case kinds.ArmLaw():
                _add_law(total, fault, state)
            case kinds.OnJoint():
                total.joint[:, fault.joint - 1] += RAD_PER_URAD * _turn(fault, state)
            case _:
                raise AssertionError(f"no shift of an arm is defined for {type(fault).__name__}")
    return total


def arm_variable(name: str, state: ArmState, memory_s: float = 1200.0) -> Array:
    """A variable of a run that a law may depend on.

    Args:
        name: q1.., direction1.., x, y, z, payload, temperature, memory (of the temperature) or time.
        state: the run.
        memory_s: s, time constant by which `memory` lags behind the temperature.

    Returns:
        (n,), in the units of `ArmState`; time as a share of the run, 0 to 1.
    """
    if name == "memory":
        return _lagging(state.temperature, state, memory_s)
    if name == "time":
        return state.time / max(float(state.time[-1]), 1e-9)
    if name in ("x", "y", "z"):
        return state.tool[:, "xyz".index(name)]
    if name in ("payload", "temperature"):
        return np.asarray(getattr(state, name))
    columns = {"q": state.q, "direction": state.direction}
    return np.asarray(columns[name[:-1]][:, int(name[-1]) - 1])


def _add_law(total: ArmShifts, law: kinds.ArmLaw, state: ArmState) -> None:
    """Add the values of a random law where it acts."""
    columns = [arm_variable(name, state, law.memory_s) for name in law.variables]
    size = law.size * unit_law(law.form, law.law_seed, law.variables, scaled(columns, law.span))
    place, _, axis = law.place.partition("-")
    if place == "joint":
        total.joint[:, (law.joint or 1) - 1] += RAD_PER_URAD * size
    elif place == "lean":
        total.tilt[:, (law.joint or 1) - 1, "xy".index(axis)] += RAD_PER_URAD * size
    else:
        part = total.hand if place == "tool" else total.sight
        part[:, "xyz".index(axis)] += MM_PER_UM * size


def _turn(fault: kinds.OnJoint, state: ArmState) -> Array:
    """Rotation of a joint by a fault of its own, (n,) urad."""
    joint = fault.joint - 1
    q, direction, lever = state.q[:, joint], state.direction[:, joint], state.lever[:, joint]
    match fault:
        case kinds.HardeningJoint():
            torque = (state.payload + fault.hand_kg) * lever
            return fault.size_urad * torque / (fault.half_nmm + np.abs(torque))
        case kinds.LoadedFriction():
            return -fault.urad_per_nmm * np.abs((state.payload + fault.hand_kg) * lever) * direction
        case kinds.DamagedTooth():
            apart = (q - fault.angle_rad + 0.5 * fault.turn_rad) % fault.turn_rad - 0.5 * fault.turn_rad
            return fault.size_urad * np.exp(-0.5 * (apart / fault.width_rad) ** 2)
        case kinds.DressPack():
            part = np.clip((q - fault.low_rad) / (fault.high_rad - fault.low_rad), 0.0, 1.0)
            return -fault.size_urad * part * direction
        case kinds.BeltResonance():
            return fault.size_urad * np.cos(2.0 * np.pi * q / fault.period_rad - fault.phase_rad)
        case kinds.RoundingController():
            counts = q / (RAD_PER_URAD * fault.step_urad)
            return fault.step_urad * (np.round(counts) - counts)
        case kinds.CoupledJoints():
            return -fault.size_urad * ((state.q[:, fault.other - 1] - fault.angle_rad) / fault.span_rad) ** 2
        case kinds.WarmJoint():
            warm = _lagging(state.temperature, state, fault.constant_s)
            return fault.urad_per_k * (warm - state.temperature[0])
        case kinds.BusyJoint():
            interval = np.diff(state.time, prepend=0.0)
            speed = state.step[:, joint] / np.maximum(interval, 1e-3)  # mean, rad/s
            speed[0] = 0.0
            return fault.urad_s_per_rad * lag(speed[:, None], interval, fault.constant_s, 0.0)[:, 0]
        case kinds.LossAtReversal():
            return -fault.urad_per_reversal * state.reversals[:, joint]
        case _:
            raise AssertionError(f"no shift is defined for {type(fault).__name__}")


def _lagging(values: Array, state: ArmState, constant_s: float) -> Array:
    """First-order lag behind values (n,), which count with their mean between two rows; the values for no constant."""
    if constant_s == 0.0:
        return values
    between = values - 0.5 * np.diff(values, prepend=values[:1])
    return lag(between[:, None], np.diff(state.time, prepend=0.0), constant_s, float(values[0]))[:, 0]
