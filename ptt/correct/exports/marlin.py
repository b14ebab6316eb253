"""Marlin 2: M665 and M666 of a linear delta, refitted.

Source: Marlin, Marlin/src/module/delta.cpp and gcode/calibrate/M665.cpp, M666.cpp: towers at 210 + X, 330 + Y and
90 + Z degrees, rods of L + A, L + B and L + C, carriages at sqrt(rod_i^2 - |(x, y) - tower_i|^2) + z. Homing backs each
carriage off its end stop by its M666, which must not be above zero, and calls that the height H over the middle.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ptt.correct.exports.delta import Delta, rounded, upper_ends
from ptt.correct.exports.firmware import Firmware, write_delta
from ptt.correct.exports.format import Options, Written
from ptt.correct.exports.left import WorkspaceSample
from ptt.correct.exports.reprapfirmware import SCALE, TOWERS, corrections, words_of

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

DIGITS = 5  # the firmware's single precision resolves 0.00003 mm at 300 mm
LOAD = "send both lines, save them with M500 and keep everything else (M92, the steps per mm); G33 would undo them"


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write M665 and M666; X, Y, Z are sliders 1, 2, 3, end stops at the upper ends of their travel."""
    return write_delta(compensator, out, options, Firmware("Marlin", ";", _lines, LOAD, SCALE, anticlockwise=True))


def _lines(delta: Delta, sample: WorkspaceSample) -> tuple[list[str], Delta]:
    ends = upper_ends(sample)
    plain = rounded(delta, DIGITS)
    rod = round(float(plain.rod.mean()), DIGITS)
    trim, angle = np.round(plain.rod - rod, DIGITS), np.round(corrections(plain.azimuth), DIGITS)
    printed = Delta(plain.radius, TOWERS + angle, rod + trim, delta.shift, plain.tilt)
    stop = ends - delta.shift - printed.stops
    height = np.floor(stop.min() * 10.0**DIGITS) / 10.0**DIGITS  # the lowest: no adjustment may be above zero
    adjust = np.round(height - stop, DIGITS)
    shift = ends - (height - adjust) - printed.stops
    lines = [
        f"M665 L{rod:.{DIGITS}f} R{plain.radius:.{DIGITS}f} H{height:.{DIGITS}f} {words_of('XYZ', angle, DIGITS)}"
        f" {words_of('ABC', trim, DIGITS)}",
        f"M666 {words_of('XYZ', adjust, DIGITS)}",
    ]
    return lines, Delta(plain.radius, printed.azimuth, printed.rod, shift, plain.tilt)
