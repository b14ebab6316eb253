"""RepRapFirmware 3: M665 and M666 of a linear delta, refitted.

Source: RepRapFirmware, src/Movement/Kinematics/LinearDeltaKinematics.cpp: towers at 210 + X, 330 + Y and 90 + Z
degrees, a rod length for each tower in L, carriages at sqrt(L_i^2 - |(x, y) - tower_i|^2) + z + (A x + B y) / 100,
and at their end stops at H + sqrt(L_i^2 - R^2) + end stop correction (M666 X Y Z).
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

DIGITS = 5  # the firmware's single precision resolves 0.00003 mm at 300 mm
LOAD = (
    "replace M665 and M666 in config.g by these lines and keep everything else (M92, the steps per mm); auto"
    " calibration (G32) or an older config-override.g would undo them"
)
SCALE = "divide the steps per mm of X, Y, Z (M92) by"  # of Marlin too
TOWERS = np.array([210.0, 330.0, 90.0])  # deg, of X, Y, Z; so for Marlin too


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write M665 and M666 for config.g; X, Y, Z are sliders 1, 2, 3, end stops at the upper ends of their travel."""
    return write_delta(compensator, out, options, Firmware("RepRapFirmware", ";", _lines, LOAD, SCALE, tilted=True))


def corrections(azimuth: np.ndarray) -> np.ndarray:
    """Tower angles less the nominal ones of the firmware, (3,) deg between -180 and 180."""
    return np.asarray((azimuth - TOWERS + 180.0) % 360.0 - 180.0)


def _lines(delta: Delta, sample: WorkspaceSample) -> tuple[list[str], Delta]:
    ends = upper_ends(sample)
    plain = rounded(delta, DIGITS)
    stop = ends - delta.shift - plain.stops
    height = round(float(stop.mean()), DIGITS)
    adjust = np.round(stop - height, DIGITS)
    angle = np.round(corrections(plain.azimuth), DIGITS)
    tilt = np.round(100.0 * delta.tilt, DIGITS)
    shift = ends - height - adjust - plain.stops
    wide, _ = reach_of(sample)
    rods = ":".join(f"{rod:.{DIGITS}f}" for rod in plain.rod)
    lines = [
        f"M665 L{rods} R{plain.radius:.{DIGITS}f} H{height:.{DIGITS}f} B{wide:g} {words_of('XYZ', angle, DIGITS)}",
        f"M666 {words_of('XYZ', adjust, DIGITS)} {words_of('AB', tilt, DIGITS)}",
    ]
    return lines, Delta(plain.radius, TOWERS + angle, plain.rod, shift, 0.01 * tilt)


def words_of(letters: str, values: np.ndarray, digits: int) -> str:
    """Values as words of a G-code line, each after its letter, without negative zero."""
    rounded_off = [round(float(value), digits) + 0.0 for value in values]
    return " ".join(f"{letter}{value:.{digits}f}" for letter, value in zip(letters, rounded_off, strict=True))
