"""[arm] of a RIG.toml <-> the faults of the virtual arm; tool point and joint limits of its drawing."""

import numpy as np

from ptt.machine import SerialSpec
from ptt.rig.nominal import Array
from ptt.rig.schema import Arm
from ptt.rig.serial_arm import ArmFaults, ArmRig
from ptt.rig.units import PPM, RAD_PER_MRAD, RAD_PER_NRAD, RAD_PER_URAD

NUDGE = 1e-5  # rad, step of the numerical derivative of the tool's place
SLACK = 1e-6  # rad: a limit in degrees, written in radians with six digits, is still within
LINK = (("link_a_mm", 1.0), ("link_alpha_mrad", RAD_PER_MRAD), ("link_d_mm", 1.0), ("link_theta_mrad", RAD_PER_MRAD))


def arm_faults(arm: Arm, spec: SerialSpec) -> ArmFaults:
    """Faults of an arm in the units of the virtual arm.

    Args:
        arm: the section of the file; an empty list stands for zeros.
        spec: the drawing, of k joints.

    Returns:
        The faults.
    """
    joints = len(spec.joint)
    centre = np.asarray(arm.com_mm) if arm.com_mm else np.zeros((joints, 3))
    return ArmFaults(
        link=np.stack([unit * _full(getattr(arm, key), joints) for key, unit in LINK], axis=1),
        gap=RAD_PER_MRAD * _full(arm.backlash_mrad, joints),
        compliance=RAD_PER_NRAD * _full(arm.compliance_nrad_per_nmm, joints),
        growth=PPM * arm.growth_um_per_m_k,
        wobble=_wobble(arm, joints),
        mass=np.column_stack([arm.mass_kg, centre]) if arm.mass_kg else None,
        beta=RAD_PER_MRAD * _full(arm.link_beta_mrad, joints),
        scale=RAD_PER_URAD * _full(arm.scale_urad_per_rad, joints),
        added=RAD_PER_MRAD * _full(arm.added_mrad, joints),
        windup=_windup(arm, joints),
        offset_growth=None if arm.offset_growth_um_per_m_k is None else PPM * arm.offset_growth_um_per_m_k,
    )


def slipped(arm: Arm, joints: int, rows: int) -> Array:
    """Zero points lost for good from a row on, (n, k) rad: a second homing, a hit joint, a belt that jumped a tooth."""
    after = np.arange(rows) >= (rows if arm.slip_row is None else arm.slip_row)
    return np.outer(after, RAD_PER_MRAD * _full(arm.slip_mrad, joints))


def tool_on_drawing(spec: SerialSpec, q: Array) -> Array:
    """Tool point of the drawing at joint commands (n, k) rad, (n, 3) mm in the base frame."""
    sound = ArmRig(spec, ArmFaults.none(len(spec.joint)), np.zeros(3), np.eye(4), 0.0)
    return sound.tool(sound.settle(q, np.zeros(len(q)), np.full(len(q), spec.reference_temp_c))[1])


def tool_jacobian(spec: SerialSpec, q: Array) -> Array:
    """Jacobian dp/dq of the drawing's tool point, by central differences.

    Args:
        spec: the drawing.
        q: (n, k) rad.

    Returns:
        (n, 3, k) mm/rad, base frame.
    """
    steps = NUDGE * np.eye(q.shape[1])
    sides = [tool_on_drawing(spec, q + step) - tool_on_drawing(spec, q - step) for step in steps]
    return np.stack(sides, axis=-1) / (2.0 * NUDGE)


def joint_limits(spec: SerialSpec) -> Array:
    """Lowest and highest value of each joint by the drawing, (2, k) rad; infinite where it states none."""
    ends = [(-np.inf, np.inf) if joint.limits_deg is None else np.radians(joint.limits_deg) for joint in spec.joint]
    return np.array(ends).T


def within_limits(spec: SerialSpec, q: Array) -> Array:
    """Whether joints (n, k) rad lie within the drawing's limits, (n, k) bool."""
    low, high = joint_limits(spec)
    return np.asarray((q >= low - SLACK) & (q <= high + SLACK))


def _wobble(arm: Arm, joints: int) -> Array:
    """Cosine and sine coefficients of size x cos(harmonic q - phase), (k, m, 2) rad, harmonics 1 to m."""
    own = {arm.turn_harmonic: (arm.turn_urad, arm.turn_phase_rad)} if any(arm.turn_urad) else {}
    rings = np.array(arm.ring_urad).reshape(joints, -1) if arm.ring_urad else np.zeros((joints, 0))
    phases = np.array(arm.ring_phase_rad).reshape(rings.shape) if arm.ring_phase_rad else np.zeros_like(rings)
    wobble = np.zeros((joints, max([rings.shape[1], *own]), 2))
    wobble[:, : rings.shape[1]] += RAD_PER_URAD * rings[..., None] * np.stack([np.cos(phases), np.sin(phases)], axis=-1)
    for harmonic, (sizes, angles) in own.items():
        size, phase = _full(sizes, joints), _full(angles, joints)
        wobble[:, harmonic - 1] += RAD_PER_URAD * size[:, None] * np.stack([np.cos(phase), np.sin(phase)], axis=1)
    return wobble


def _windup(arm: Arm, joints: int) -> Array | None:
    """Size and length of each joint's wind-up, (k, 2) rad; None without any."""
    if not any(arm.windup_urad):
        return None
    length = arm.windup_length_mrad or (1.0,) * joints
    return np.column_stack([RAD_PER_URAD * np.asarray(arm.windup_urad), RAD_PER_MRAD * np.asarray(length)])


def _full(values: tuple[float, ...], joints: int) -> Array:
    """Values of all joints, (k,); an empty list stands for zeros."""
    return np.asarray(values, dtype=float) if values else np.zeros(joints)
