"""Faults of an arm that no effect of the library describes: what each adds to joints, axes, tool, base and sight."""

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
    """A run of an arm as it happens.

    Attributes:
        q: (n, k) rad, commands.
        direction: (n, k), of arrival, +1 or -1.
        step: (n, k) rad, way of each joint since the row before.
        reversals: (n, k), how often each joint has turned back.
        lever: (n, k) N mm per kg at the tool, torque of gravity about each joint.
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
    """What the odd faults add.

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
                _obey(total, fault, state)
            case kinds.OnJoint():
                total.joint[:, fault.joint - 1] += RAD_PER_URAD * _turn(fault, state)
            case _:
                raise AssertionError(f"nobody says what {type(fault).__name__} does to an arm")
    return total


def arm_variable(name: str, state: ArmState, memory_s: float = 1200.0) -> Array:
    """A variable of a run.

    Args:
        name: q1.., direction1.., x, y, z, payload, temperature, memory (of the temperature) or time.
        state: the run.
        memory_s: how long warmth is remembered.

    Returns:
        (n,), time as a share of the run.
    """
    if name == "memory":
        return _remembered(state.temperature, state, memory_s)
    if name == "time":
        return state.time / max(float(state.time[-1]), 1e-9)
    if name in ("x", "y", "z"):
        return state.tool[:, "xyz".index(name)]
    if name in ("payload", "temperature"):
        return np.asarray(getattr(state, name))
    columns = {"q": state.q, "direction": state.direction}
    return np.asarray(columns[name[:-1]][:, int(name[-1]) - 1])


def _obey(total: ArmShifts, law: kinds.ArmLaw, state: ArmState) -> None:
    """Add what a random law says where it acts."""
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
    """By how much a fault of one joint turns it, (n,) urad."""
    joint = fault.joint - 1
    q, way, lever = state.q[:, joint], state.direction[:, joint], state.lever[:, joint]
    match fault:
        case kinds.HardeningJoint():
            torque = (state.payload + fault.hand_kg) * lever
            return fault.size_urad * torque / (fault.half_nmm + np.abs(torque))
        case kinds.LoadedFriction():
            return -fault.urad_per_nmm * np.abs((state.payload + fault.hand_kg) * lever) * way
        case kinds.DamagedTooth():
            apart = (q - fault.angle_rad + 0.5 * fault.turn_rad) % fault.turn_rad - 0.5 * fault.turn_rad
            return fault.size_urad * np.exp(-0.5 * (apart / fault.width_rad) ** 2)
        case kinds.DressPack():
            part = np.clip((q - fault.low_rad) / (fault.high_rad - fault.low_rad), 0.0, 1.0)
            return -fault.size_urad * part * way
        case kinds.BeltResonance():
            return fault.size_urad * np.cos(2.0 * np.pi * q / fault.period_rad - fault.phase_rad)
        case kinds.RoundingController():
            counts = q / (RAD_PER_URAD * fault.step_urad)
            return fault.step_urad * (np.round(counts) - counts)
        case kinds.CoupledJoints():
            return -fault.size_urad * ((state.q[:, fault.other - 1] - fault.angle_rad) / fault.span_rad) ** 2
        case kinds.WarmJoint():
            warm = _remembered(state.temperature, state, fault.constant_s)
            return fault.urad_per_k * (warm - state.temperature[0])
        case kinds.BusyJoint():
            spent = np.diff(state.time, prepend=0.0)
            work = state.step[:, joint] / np.maximum(spent, 1e-3)
            work[0] = 0.0
            return fault.urad_s_per_rad * lag(work[:, None], spent, fault.constant_s, 0.0)[:, 0]
        case kinds.LossAtReversal():
            return -fault.urad_per_reversal * state.reversals[:, joint]
        case _:
            raise AssertionError(f"nobody says what {type(fault).__name__} does")


def _remembered(values: Array, state: ArmState, constant_s: float) -> Array:
    """First-order lag behind a cause that counts with its mean between two rows; at once where the constant is zero."""
    if constant_s == 0.0:
        return values
    between = values - 0.5 * np.diff(values, prepend=values[:1])
    return lag(between[:, None], np.diff(state.time, prepend=0.0), constant_s, float(values[0]))[:, 0]
