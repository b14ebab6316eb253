"""Drives: play, wind-up and friction of the transmission, errors of screw and encoder."""

import numpy as np
from scipy.interpolate import CubicSpline

from ptt.rig.nominal import Array
from ptt.rig.schema import Drive
from ptt.rig.units import MM_PER_UM, PPM

SLIPS = np.array([0.25, 0.5, 0.75, 1.0])  # stretches at which the four Maxwell-slip elements slip, of the full length


def play(path: Array, gap: Array) -> Array:
    """Backlash: the nut rests until the screw has crossed what is left of the gap.

    Source: the play operator, y = min(max(y_before, x - gap/2), x + gap/2): behind by gap/2 once the gap is taken up.

    Args:
        path: (m, k) mm or rad, of the screw or motor, in travel order.
        gap: (k,) or (m, k) mm or rad, not negative.

    Returns:
        (m, k) mm or rad, of the nut or joint; it starts in the middle of the gap.
    """
    half = np.broadcast_to(np.asarray(gap) / 2.0, path.shape)
    low, high = path - half, path + half
    if not half.any():
        return path.copy()
    out = np.empty_like(path)
    for leg in range(path.shape[1]):
        held = float(path[0, leg])
        column = out[:, leg]
        for number, (least, most) in enumerate(zip(low[:, leg].tolist(), high[:, leg].tolist(), strict=True)):
            held = least if held < least else most if held > most else held
            column[number] = held
    return out


def windup(path: Array, size: Array, length: Array) -> Array:
    """Elastic wind-up: a lag that changes sign gradually after a reversal.

    Source: Dahl, A Solid Friction Model, 1968: ds/dx = (size sign(dx) - s) / length, integrated exactly between points.

    Args:
        path: (m, k) mm or rad, in travel order.
        size: (k,) mm or rad, lag far from a reversal.
        length: (k,) mm or rad, travel over which it approaches that.

    Returns:
        (m, k) mm or rad, shift of the slider or joint: -size after a long way up; 0 at the first point.
    """
    if not np.any(size):
        return np.zeros_like(path)
    step = np.diff(path, axis=0, prepend=path[:1])
    keep = np.exp(-np.abs(step) / length)
    goal = np.sign(step) * size
    state = np.zeros_like(path)
    held = np.zeros(path.shape[1])
    for number in range(len(path)):
        held = goal[number] + (held - goal[number]) * keep[number]
        state[number] = held
    return -state


def friction(path: Array, size: Array, length: Array) -> Array:
    """Friction hysteresis of many contacts that slip one after another.

    Source: Maxwell-slip (Iwan) model: parallel springs, each of which slips at a stretch of its own.

    Args:
        path: (m, k) mm in travel order.
        size: (k,) mm, lag when all elements slip.
        length: (k,) mm, stretch at which the last element slips.

    Returns:
        (m, k) mm, shift of the slider: -size after a long way up; 0 at the first point.
    """
    if not np.any(size):
        return np.zeros_like(path)
    lag = np.zeros_like(path)
    for slip in SLIPS:
        stretch = slip * np.asarray(length)
        # The stretch of an element, the stop operator, is the path less its play of twice the limit.
        lag += (path - play(path, 2.0 * stretch)) / stretch
    return -np.asarray(size) * lag / len(SLIPS)


def screw_error(faults: Drive, nut: Array, screw: Array, home: Array, span: tuple[float, float], lead: float) -> Array:
    """Errors of screw and encoder: homing, scale, curve, map, once and twice per turn.

    The curve is a sum of Legendre polynomials of degree 2 and 3 over the span, the map a cubic spline that stays as it
    is at its ends beyond them, as a controller's table does: a cubic would go off by millimetres there.

    Args:
        faults: sizes per slider.
        nut: (n, 3) mm, height of the nut.
        screw: (n, 3) mm, turns of the screw times its lead.
        home: (3,) mm, heights at which the error of scale is zero.
        span: mm, heights over which the curve is stated.
        lead: mm per turn; infinite without a screw.

    Returns:
        (n, 3) mm, added to the height of the nut.
    """
    part = (2.0 * nut - span[0] - span[1]) / (span[1] - span[0])
    error = np.asarray(faults.homing_mm) + PPM * np.asarray(faults.scale_um_per_m) * (nut - home)
    error = error + MM_PER_UM * np.asarray(faults.curve_parabola_um) * (1.5 * part**2 - 0.5)
    error = error + MM_PER_UM * np.asarray(faults.curve_cubic_um) * (2.5 * part**3 - 1.5 * part)
    for leg, values in enumerate(faults.map_um):
        within = np.clip(nut[:, leg], faults.map_height_mm[0], faults.map_height_mm[-1])
        error[:, leg] += MM_PER_UM * CubicSpline(faults.map_height_mm, values)(within)
    turn = 2.0 * np.pi * screw / lead
    error = error + MM_PER_UM * np.asarray(faults.turn_um) * np.cos(turn - np.asarray(faults.turn_phase_rad))
    return error + MM_PER_UM * np.asarray(faults.turn2_um) * np.cos(2.0 * turn - np.asarray(faults.turn2_phase_rad))
