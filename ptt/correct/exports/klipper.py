"""Klipper: radius, arms, angles and end stops of a delta, refitted.

Source: Klipper, klippy/kinematics/delta.py and klippy/chelper/kin_delta.c: a carriage is at
z + sqrt(arm_i^2 - |(x, y) - tower_i|^2), and at its end stop where that is
position_endstop_i + sqrt(arm_i^2 - radius^2).
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ptt.correct.exports.delta import Delta, rounded, upper_ends
from ptt.correct.exports.firmware import Firmware, reach_of, write_delta
from ptt.correct.exports.format import Options, Written
from ptt.correct.exports.left import WorkspaceSample

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

DIGITS = 6
LOAD = (
    "replace the figures in printer.cfg by these and keep everything else (rotation_distance, pins, speeds);"
    " DELTA_CALIBRATE would undo them"
)
SCALE = "multiply rotation_distance of steppers a, b, c by"


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write a piece of printer.cfg; a, b, c are sliders 1, 2, 3, end stops at the upper ends of their travel."""
    return write_delta(compensator, out, options, Firmware("Klipper", "#", _lines, LOAD, SCALE, anticlockwise=True))


def _lines(delta: Delta, sample: WorkspaceSample) -> tuple[list[str], Delta]:
    ends = upper_ends(sample)
    plain = rounded(delta, DIGITS)
    stop = np.round(ends - delta.shift - plain.stops, DIGITS)
    printed = Delta(plain.radius, plain.azimuth, plain.rod, ends - stop - plain.stops, plain.tilt)
    wide, low = reach_of(sample)
    lines = ["[printer]", "kinematics: delta", f"delta_radius: {plain.radius:.{DIGITS}f}"]
    lines += [f"print_radius: {wide:g}", f"minimum_z_position: {low:g}"]
    for tower in range(3):
        lines += ["", f"[stepper_{'abc'[tower]}]", f"arm_length: {plain.rod[tower]:.{DIGITS}f}"]
        lines += [f"angle: {plain.azimuth[tower]:.{DIGITS}f}", f"position_endstop: {stop[tower]:.{DIGITS}f}"]
    return lines, printed
