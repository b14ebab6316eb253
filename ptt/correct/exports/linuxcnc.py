"""LinuxCNC: lineardeltakins refitted, and a compensation file for each joint that takes what radius and length leave.

Source: LinuxCNC, src/emc/kinematics/lineardeltakins-common.h: towers at 90, 210 and 330 degrees at distance R, rods of
length L, joint_i = z + sqrt(L^2 - |(x, y) - tower_i|^2). src/emc/motion/control.c and usrmotintf.cc: a line of a type 0
file is nominal, forward, reverse; the motor goes to position + (nominal - forward) on the way up and to position +
(nominal - reverse) on the way down, straight between lines; 256 lines at most; a line that is no triplet ends the file.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from ptt.correct.exports.axis_tables import (
    AxisTables,
    DriveErrors,
    by_direction,
    cut_tables,
    drive_errors,
    smooth_basis,
    table_entries,
    tabled,
)
from ptt.correct.exports.delta import Delta, drawn_delta, require_anticlockwise, require_upright, tool_by_slider
from ptt.correct.exports.firmware import MEASURE, judged, refuse_worse, what_to_do
from ptt.correct.exports.format import Options, Written
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import cannot_hold, network_note
from ptt.correct.exports.left import WorkspaceSample, error_left, holdings, left_of_drawing, sample_workspace
from ptt.correct.exports.whole import write_all

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

Array = np.ndarray

TOWERS = np.array([90.0, 210.0, 330.0])  # deg, of joints 0, 1, 2
MOST_ENTRIES = 256  # EMCMOT_COMP_SIZE
DIGITS = 6
LOAD = (
    "copy the INI lines into the machine's own INI, load the HAL file after lineardeltakins, put the .comp files"
    " beside the INI and keep everything else (SCALE, limits)"
)
SHAPE = "all towers stand upright, evenly around, at one radius with rods of one length"
BACKLASH = "LinuxCNC ignores BACKLASH where a joint has a COMP_FILE: what it compensated so far is now in neither"


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters of lineardeltakins and the compensation tables.

    Attributes:
        radius: R, mm.
        rod: L, mm.
        turn: deg, rotation of the controller's x and y against the base frame.
        height: mm, slider height less joint position.
        tables: compensation by joint position.
    """

    radius: float
    rod: float
    turn: float
    height: float
    tables: AxisTables

    def joints(self, p: Array) -> Array:
        """Joint positions of tool positions in the base frame, (n, 3) mm, before compensation."""
        return _joints(self.radius, self.rod, self.turn, p)

    def sliders(self, sample: WorkspaceSample) -> Array:
        """Slider heights that the controller sends for the places of a sample, (n, 3) mm."""
        joints = self.joints(sample.targets)
        return joints + self.tables.added(joints, sample.direction) + self.height


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write an INI and a HAL snippet and three compensation files; joints 0, 1, 2 are sliders 1, 2, 3.

    Args:
        compensator: the model.
        out: the INI file, or a folder.
        options: what the user said.

    Returns:
        What was written, and what it leaves.
    """
    sample = sample_workspace(compensator, options)
    fit, tangent, drives = fit_tables(sample, options.step)
    file = compensator.model.file
    left = error_left(sample, fit.sliders(sample))
    refuse_worse(left, "LinuxCNC's lineardeltakins", file.source)
    shape = left_of_drawing(sample, options, lambda bare: fit_tables(bare, options.step)[0].sliders(bare))
    at = fit.tables.at + fit.height
    why = cannot_hold(sample, tangent, SHAPE, known=("direction",), tabled=tabled(sample, drives, at))
    holds, cannot = holdings(sample, why)
    told = [*head_lines(compensator, options), *judged(left, holds, [item.effect for item in cannot])]
    ini = out.with_suffix(".ini") if out.suffix == ".hal" else out
    ini = ini if out.suffix and not out.is_dir() else out / "lineardelta.ini"
    first, *instead = what_to_do(f"{LOAD}; {MEASURE}", left, shape=shape)
    notes = (first, *_notes(compensator, fit), *instead)
    written = write_all(_texts(ini, fit, told, notes))
    return Written(written, holds, cannot, left, (*notes, *network_note(sample)))


def fit_tables(sample: WorkspaceSample, step: float | None) -> tuple[Fit, Array, DriveErrors]:
    """Fit R, L and tables for the least error of the tool over the workspace.

    Tables are the inverse of the drive errors along each slider plus smooth curves; for given R and L the best curves
    follow from linear least squares (variable projection).

    Args:
        sample: places and commands.
        step: distance of table entries, mm; None for as close as needed.

    Returns:
        The fit, the derivative of the tool by its smooth parameters (n, 3, P), and the drive errors along each slider.
    """
    spec = require_upright(sample)
    start, drives = drawn_delta(spec), drive_errors(sample)
    require_anticlockwise(start, "LinuxCNC's lineardeltakins", sample.compensator.model.file.source)
    turn, height = _turn(start), spec.joint_height_mm
    jacobian = tool_by_slider(sample)
    basis, along = smooth_basis(sample.nominal, drives)
    columns = np.einsum("ncl,nlp->ncp", jacobian, basis).reshape(-1, basis.shape[2])
    inverse = np.linalg.pinv(columns)
    come = sample.static + drives.at_rows(sample.static)  # wanted actual slider heights

    def lacks(values: Array) -> Array:
        joints = _joints(start.radius + values[0], start.rod[0] + values[1], turn, sample.targets) + height
        rest = np.nan_to_num(come - joints, nan=1e3)
        return np.asarray(np.einsum("ncl,nl->nc", jacobian, rest).ravel())

    def miss(values: Array) -> Array:
        wanted = lacks(values)
        return np.asarray(wanted - columns @ (inverse @ wanted))

    found = least_squares(miss, np.zeros(2), method="lm", xtol=1e-14, ftol=1e-14).x
    radius, rod = (round(float(value), DIGITS) for value in (start.radius + found[0], start.rod[0] + found[1]))
    found = np.array([radius - start.radius, rod - start.rod[0]])
    at = np.round(table_entries(drives, step, MOST_ENTRIES) - height, DIGITS)
    tables = cut_tables(drives, at + height, along(inverse @ lacks(found)), by_direction(sample))
    tables = AxisTables(at, np.round(tables.forward, DIGITS), np.round(tables.reverse, DIGITS))
    slope = np.stack([(lacks(found + each) - lacks(found - each)) / 2e-3 for each in 1e-3 * np.eye(2)], axis=-1)
    ways = (jacobian * sample.direction[:, None, :]).reshape(-1, 3)  # the difference of a table between both directions
    tangent = np.concatenate([columns, slope, ways], axis=1)
    return Fit(radius, rod, turn, height, tables), tangent.reshape(len(jacobian), 3, -1), drives


def _turn(start: Delta) -> float:
    """Angle from the base frame to one in which the towers are where the kinematics has them, deg."""
    off = np.radians(TOWERS - start.azimuth)
    return float(np.degrees(np.arctan2(np.sin(off).mean(), np.cos(off).mean())))


def _joints(radius: float, rod: float, turn: float, p: Array) -> Array:
    """Lineardeltakins for tool positions in the base frame."""
    delta = Delta(radius, TOWERS - turn, np.full(3, rod), np.zeros(3), np.zeros(2))
    return delta.sliders(p)


def _notes(compensator: "Compensator", fit: Fit) -> tuple[str, ...]:
    notes = []
    if abs(fit.turn) > 1e-6:
        notes.append(
            "lineardeltakins has its towers at 90, 210 and 330 deg: turn every work offset by"
            f" {fit.turn:.6f} deg, as in G10 L2 P1 R{fit.turn:.6f}"
        )
    if fit.height:
        notes.append(f"a joint's position is its slider's height less {fit.height:g} mm")
    if "backlash" in compensator.model.file.controller.compensates:
        notes.append(BACKLASH)
    return tuple(notes)


def _texts(ini: Path, fit: Fit, told: list[str], notes: tuple[str, ...]) -> dict[Path, str]:
    """Every file; heads stand at the end of compensation files, where LinuxCNC has stopped reading."""
    head = [f"# {line}" for line in (*told, *notes)]
    hal = [*head, f"setp lineardeltakins.R {fit.radius:.{DIGITS}f}", f"setp lineardeltakins.L {fit.rod:.{DIGITS}f}"]
    lines = [*head, "[HAL]", f"HALFILE = {ini.stem}.hal", "", "[KINS]", "KINEMATICS = lineardeltakins", "JOINTS = 3"]
    texts = {}
    for joint in range(3):
        path = ini.with_name(f"{ini.stem}_joint_{joint}.comp")
        lines += ["", f"[JOINT_{joint}]", f"COMP_FILE = {path.name}", "COMP_FILE_TYPE = 0"]
        texts[path] = "\n".join([*_triplets(fit.tables, joint), *head]) + "\n"
    return {ini: "\n".join(lines) + "\n", ini.with_suffix(".hal"): "\n".join(hal) + "\n", **texts}


def _triplets(tables: AxisTables, joint: int) -> list[str]:
    at, forward, reverse = (each[:, joint] for each in (tables.at, tables.forward, tables.reverse))
    rows = zip(at, at - forward, at - reverse, strict=True)
    return [" ".join(f"{value:.{DIGITS}f}" for value in row) for row in rows]
