"""Faults that no effect of the library describes: splices, damaged guides, rollers, hoses, nuts that open when warm."""

from collections.abc import Sequence

import numpy as np

from ptt.rig.nominal import Array
from ptt.rig.schema import Bump, GuideDamage, Hose, Odd, Periodic, Splice, WarmBacklash

MICRO = 1e-3  # mm per um


def odd_shift(odd: Sequence[Odd], slider: Array) -> Array:
    """What the odd faults do to each slider.

    Args:
        odd: the faults.
        slider: (n, 3) mm, heights.

    Returns:
        (n, 3, 3) mm: along the rail, radial, tangential.
    """
    shift = np.zeros((*slider.shape, 3))
    for fault in odd:
        if isinstance(fault, Hose | WarmBacklash):
            continue
        height = slider[:, fault.leg - 1]
        way = ("along", "radial", "tangential").index(getattr(fault, "direction", "along"))
        shift[:, fault.leg - 1, way] += MICRO * _profile(fault, height)
    return shift


def warm_gap(odd: Sequence[Odd], screw: Array) -> Array:
    """What warmth adds to the gaps of the nuts.

    Args:
        odd: the faults.
        screw: (n, 3) degrees Celsius.

    Returns:
        (n, 3) mm.
    """
    gap = np.zeros_like(screw)
    for fault in odd:
        if isinstance(fault, WarmBacklash):
            above = np.maximum(screw[:, fault.leg - 1] - fault.opens_at_c, 0.0)
            gap[:, fault.leg - 1] += MICRO * fault.gap_um_per_k * above
    return gap


def hose_force(hose: Hose, position: Array) -> Array:
    """Force of a hose on the platform.

    Args:
        hose: the fault.
        position: (n, 3) mm, platform centre.

    Returns:
        (n, 3) N, towards the anchor.
    """
    way = np.asarray(hose.anchor_mm) - position
    length = np.linalg.norm(way, axis=1, keepdims=True)
    tension = hose.pull_n + hose.stiffness_n_per_mm * np.maximum(length - hose.free_length_mm, 0.0)
    return tension * way / np.maximum(length, 1e-9)


def _profile(fault: Splice | GuideDamage | Periodic | Bump, height: Array) -> Array:
    """Size of a fault over the height of its slider, in um."""
    match fault:
        case Splice():
            return np.where(height > fault.height_mm, fault.step_um, 0.0)
        case Periodic():
            return fault.size_um * np.cos(2.0 * np.pi * height / fault.period_mm - fault.phase_rad)
        case Bump():
            return fault.size_um * np.exp(-0.5 * ((height - fault.height_mm) / fault.width_mm) ** 2)
        case GuideDamage():
            part = np.clip((height - fault.height_mm) / fault.width_mm, -0.5, 0.5)
            return fault.size_um * 0.5 * (1.0 + np.cos(2.0 * np.pi * part))
