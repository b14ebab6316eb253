"""SINUMERIK: encoder compensation of each axis, $AA_ENC_COMP, behind the kinematics that the controller has already.

Source: SINUMERIK 840D sl, Function Manual Extended Functions, K3 Compensations, 'Leadscrew error and measuring system
error compensation': a table of values at even steps from MIN to MAX, linear between them, constant beyond the ends; a
value is added to the actual position, so a positive one moves the axis in the negative direction. One table for both
directions.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch

from ptt.correct.exports.axis_tables import (
    FINEST,
    AxisTables,
    DriveErrors,
    by_direction,
    cut_tables,
    drive_errors,
    smooth_basis,
    table_entries,
    tabled,
)
from ptt.correct.exports.delta import tool_by_slider
from ptt.correct.exports.firmware import MEASURE, judged, what_to_do
from ptt.correct.exports.format import Options, Written
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import cannot_hold, network_note
from ptt.correct.exports.left import WorkspaceSample, error_left, holdings, sample_workspace
from ptt.correct.exports.whole import write_all
from ptt.correct.terms import split_terms
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.workspace import translation_rank
from ptt.model.chain import predict
from ptt.run.viewing import build_view

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

Array = np.ndarray

DIGITS = 6
LOAD = f"load it with MD32700 $MA_ENC_COMP_ENABLE[0] = 0, then set that to 1; {MEASURE}"
SHAPE = "each axis is corrected by its own position alone"


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write a compensation table for each axis: AX1, AX2, ... are sliders or joints 1, 2, ..., in mm or degrees."""
    sample = sample_workspace(compensator, options)
    arm = compensator.model.file.machine.kind == "serial"
    unit = np.degrees(1.0) if arm else 1.0
    step = None if options.step is None else options.step / unit
    drives = drive_errors(sample)
    smooth, tangent = _curves(sample, drives)
    at = table_entries(drives, step, FINEST + 1)
    tables = _rounded(cut_tables(drives, at, smooth, np.zeros(at.shape[1])), unit)
    ahead = np.ones_like(sample.nominal)
    left = error_left(sample, sample.nominal + tables.added(sample.nominal, ahead))
    hints = {"backlash": _backlash(sample, unit)}
    why = cannot_hold(sample, tangent, SHAPE, hints=hints, tabled=tabled(sample, drives, at))
    holds, cannot = holdings(sample, why)
    told = [*head_lines(compensator, options), *judged(left, holds, [item.effect for item in cannot])]
    notes = (
        f"this file needs MD38000 $MA_MM_ENC_COMP_MAX_POINTS of {len(at)} or more",
        *what_to_do(LOAD, left, arm=arm),
    )
    written = write_all({out: "\n".join(_lines(tables, unit, [*told, *notes])) + "\n"})
    return Written(written, holds, cannot, left, (*notes, *network_note(sample)))


def _curves(sample: WorkspaceSample, drives: DriveErrors) -> tuple[Array, Array]:
    """Smooth part of each axis' correction (F, k), and the derivative of the tool by its coefficients (n, 3, P).

    For sliders the curves minimise the error of the tool. Joints of an arm can compensate each other, so there each
    curve is fitted to its joint's own correction.
    """
    jacobian = tool_by_slider(sample)
    count = jacobian.shape[2]
    basis, along = smooth_basis(sample.nominal, drives)
    arm = sample.compensator.model.file.machine.kind == "serial"
    rest = _asked_of_joints(sample, drives) if arm else sample.static + drives.at_rows(sample.static) - sample.nominal
    weight = np.broadcast_to(np.eye(count), (len(rest), count, count)) if arm else jacobian
    columns = np.einsum("ncl,nlp->ncp", weight, basis).reshape(-1, basis.shape[2])
    wanted = np.einsum("ncl,nl->nc", weight, rest).ravel()
    found = np.linalg.lstsq(columns, wanted, rcond=None)[0]
    return along(found), np.einsum("ncl,nlp->ncp", jacobian, basis)


def _asked_of_joints(sample: WorkspaceSample, drives: DriveErrors) -> Array:
    """Least-norm joint corrections of an arm for the error that remains once drive errors are corrected, (n, k) rad."""
    model = sample.compensator.model
    undone = sample.nominal - drives.at_rows(sample.nominal)
    view = build_view(model.file, sample.table.replace(command=undone))
    missed = torch.as_tensor(sample.targets) - predict(split_terms(model)[0], view).p
    return np.asarray(least_move(view.jacobian, missed, translation_rank(view.mechanism)).numpy())


def _rounded(tables: AxisTables, unit: float) -> AxisTables:
    """Tables rounded as printed, in mm or rad."""
    at, add = (np.round(each * unit, DIGITS) / unit for each in (tables.at, tables.forward))
    return AxisTables(at, add, add)


def _backlash(sample: WorkspaceSample, unit: float) -> str:
    gaps = ", ".join(f"{round(2.0 * unit * half, DIGITS) + 0.0:.{DIGITS}f}" for half in by_direction(sample))
    arm = sample.compensator.model.file.machine.kind == "serial"
    name, instead = ("deg", "predict") if arm else ("mm", "program")
    return (
        f"MD32450 $MA_BACKLASH of the axes takes {gaps} {name}, instead of what `ptt {instead}` does at a reversal: "
        'once it is set, write [controller] compensates = ["backlash"] in the machine file'
    )


def _lines(tables: AxisTables, unit: float, told: list[str]) -> list[str]:
    lines = ["%_N_AX_EEC_INI", *(f"; {line}" for line in told), "CHANDATA(1)"]
    for axis in range(tables.at.shape[1]):
        at, add = unit * tables.at[:, axis], unit * tables.forward[:, axis]
        name = f"AX{axis + 1}"
        lines += [f"$AA_ENC_COMP[0,{n},{name}]={0.0 - value:.{DIGITS}f}" for n, value in enumerate(add)]
        lines += [
            f"$AA_ENC_COMP_STEP[0,{name}]={(at[-1] - at[0]) / (len(at) - 1):.{DIGITS}f}",
            f"$AA_ENC_COMP_MIN[0,{name}]={at[0]:.{DIGITS}f}",
            f"$AA_ENC_COMP_MAX[0,{name}]={at[-1]:.{DIGITS}f}",
            f"$AA_ENC_COMP_IS_MODULO[0,{name}]=0",
        ]
    return [*lines, "M17"]
