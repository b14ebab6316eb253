"""Faults of an arm that no effect of the library describes: shifts of joints, axes, tool, base and readings."""

from collections.abc import Sequence

import numpy as np

from ptt.rig import arm_odd_schema as kinds
from ptt.rig.nominal import Array
from ptt.rig.odd_law import random_law, variable
from ptt.rig.odd_schema import Odd
from ptt.rig.odd_state import ArmState, heat_of_work, memory_of_warmth
from ptt.rig.serial_arm import ArmShifts
from ptt.rig.units import GRAVITY, MM_PER_UM, RAD_PER_NRAD, RAD_PER_URAD


def shift_arm(odd: Sequence[Odd], state: ArmState) -> ArmShifts:
    """Sum of the shifts by odd faults.

    Args:
        odd: the faults.
        state: the run.

    Returns:
        The shifts.
    """
    total = ArmShifts.none(*state.joint.shape)
    for fault in odd:
        match fault:
            case kinds.SlippingTool():
                late = variable("time", state) >= fault.share
                total.hand[:] += np.outer(late, MM_PER_UM * np.asarray(fault.shift_um))
            case kinds.RockingBase():
                force = np.outer(GRAVITY * (state.payload + fault.moving_kg), state.down)
                total.base[:] += RAD_PER_NRAD * fault.nrad_per_nmm * np.cross(state.tool, force)
            case kinds.WobblingAxis():
                phase = fault.times * state.joint[:, fault.joint - 1] - fault.phase_rad
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


def _add_law(total: ArmShifts, law: kinds.ArmLaw, state: ArmState) -> None:
    """Add the values of a random law where it acts."""
    size = law.size * random_law(law, state)
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
    q, direction, lever = state.joint[:, joint], state.direction[:, joint], state.lever[:, joint]
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
            return -fault.size_urad * ((state.joint[:, fault.other - 1] - fault.angle_rad) / fault.span_rad) ** 2
        case kinds.WarmJoint():
            warm = memory_of_warmth(state, fault.constant_s) if fault.constant_s else state.temperature
            return fault.urad_per_k * (warm - state.temperature[0])
        case kinds.BusyJoint():
            return fault.urad_s_per_rad * heat_of_work(state, joint, fault.constant_s)
        case kinds.LossAtReversal():
            return -fault.urad_per_reversal * state.reversals[:, joint]
        case _:
            raise AssertionError(f"no shift is defined for {type(fault).__name__}")
