"""The log of a linear scale beside a slider's motor, read from CSV.

One row per sample, taken at a constant rate while the motor turns a slider forward by u turns and then back by u turns
at one speed. Columns:

- `slider`: its number or name
- `command_turns` (motor turns; needs the screw lead) or `motor_mm` (turns x lead)
- `scale_mm`, or `scale_counts` (needs the scale's resolution)
- optional `payload_kg`; `cycle` (one forward-and-back pass each; a cycle of a single row is one reading at the stroke's
  end and serves the repeatability alone)
- optional `phase`: S1 forward, S2 dead travel after the reversal, S3 moving back, where somebody has marked the rows
  already; without it the dead travel is found. With `phase` and a number of turns the command column may be missing.

Other columns, such as `time_s`, are ignored.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ptt.errors import TableError, shown
from ptt.run.readers.plain import numbers_of, read_plain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ScaleLog:
    """Samples of a linear scale beside the motor, in the order of travel.

    Attributes:
        slider: (n,) str.
        payload: (n,) kg, NaN where the log gives none.
        cycle: (n,) number of the pass.
        command: (n,) mm, motor turns x lead.
        scale: (n,) mm.
        phase: (n,) str 'S1', 'S2', 'S3', or None where the dead travel is to be found.
        resolution_mm: one count of the scale.
        resolution_source: 'given' or 'smallest step in the log'.
        source: the file's name.
    """

    slider: NDArray[np.str_]
    payload: Array
    cycle: Array
    command: Array
    scale: Array
    phase: NDArray[np.str_] | None
    resolution_mm: float
    resolution_source: str
    source: str


def read_scale_log(
    path: Path | str,
    lead_mm: float | None = None,
    turns: float | None = None,
    resolution_mm: float | None = None,
) -> ScaleLog:
    """Read a scale log; the columns are described at the top of this module.

    Args:
        path: CSV file.
        lead_mm: screw lead, needed with `command_turns` or `turns`.
        turns: motor turns u each way, needed where the log has `phase` and no command.
        resolution_mm: one count of the scale; without it the smallest step between the log's readings.

    Returns:
        The log.

    Raises:
        TableError: a missing file or column, a cell that is not a number, or a size that is none.
    """
    source = str(path)
    resolution_um = None if resolution_mm is None else 1e3 * resolution_mm
    for option, given in (("--lead", lead_mm), ("--turns", turns), ("--resolution-um", resolution_um)):
        if given is not None and not 0.0 < given < np.inf:
            raise TableError(f"{given:g} is not a size", where=option, fix="give a number above zero")
    table = read_plain(path)
    if "slider" not in table:
        raise TableError("no column slider", where=source, fix="add one with the slider's number")
    phase = _phase(table, source)
    scale, resolution, how = _scale(table, resolution_mm, source)
    payload = _numbers(table, "payload_kg", source) if "payload_kg" in table else np.full(len(table), np.nan)
    cycle = _numbers(table, "cycle", source) if "cycle" in table else np.ones(len(table))
    return ScaleLog(
        slider=table["slider"].str.strip().to_numpy(dtype=str),
        payload=payload,
        cycle=cycle,
        command=_command(table, lead_mm, turns, source),
        scale=scale,
        phase=phase,
        resolution_mm=resolution,
        resolution_source=how,
        source=source,
    )


def _numbers(table: pd.DataFrame, column: str, source: str) -> Array:
    """One column as (n,) float64, counts and turns bounded as numbers."""
    dimension = {"payload_kg": "mass", "scale_mm": "length", "motor_mm": "length"}.get(column, "number")
    return numbers_of(table, column, source, dimension)


def _scale(table: pd.DataFrame, resolution_mm: float | None, source: str) -> tuple[Array, float, str]:
    """Scale readings (n,) mm, one count in mm, and where that figure is from."""
    if "scale_mm" in table:
        scale = _numbers(table, "scale_mm", source)
    elif "scale_counts" in table and resolution_mm is not None:
        return _numbers(table, "scale_counts", source) * resolution_mm, resolution_mm, "given"
    else:
        if "scale_counts" in table:
            raise TableError("counts of unknown size", where=source, fix="give the scale's resolution")
        raise TableError("no column scale_mm or scale_counts", where=source, fix="add the scale's readings")
    if resolution_mm is not None:
        return scale, resolution_mm, "given"
    steps = np.diff(np.unique(np.round(scale, 9)))
    if not len(steps):
        raise TableError("the scale never moves", where=source, fix="log a pass forward and back")
    return scale, round(float(np.min(steps)), 9), "smallest step in the log"


def _phase(table: pd.DataFrame, source: str) -> NDArray[np.str_] | None:
    """The marks S1, S2, S3 (n,), or None."""
    if "phase" not in table:
        return None
    phase = table["phase"].str.strip().str.upper().to_numpy(dtype=str)
    bad = np.flatnonzero(~np.isin(phase, ["S1", "S2", "S3"]))
    if len(bad):
        where = f"{source} row {table.index[bad[0]]}, column phase"
        fix = "use S1 (forward), S2 (standing), S3 (back)"
        raise TableError(f"unknown phase '{shown(str(phase[bad[0]]))}'", where=where, fix=fix)
    return phase


def _command(table: pd.DataFrame, lead_mm: float | None, turns: float | None, source: str) -> Array:
    """Motor travel (n,) mm from the log, else laid evenly over the marked phases."""
    if "motor_mm" in table:
        return _numbers(table, "motor_mm", source)
    by_phase = "command_turns" not in table
    if by_phase and ("phase" not in table or turns is None):
        fix = "add one, or mark the rows' phase and give the number of turns"
        raise TableError("no column command_turns or motor_mm", where=source, fix=fix)
    if lead_mm is None:
        raise TableError(
            "motor turns need the screw lead", where=source, fix="add `--lead 5` (mm) or `--model machine.toml`"
        )
    if not by_phase:
        return _numbers(table, "command_turns", source) * lead_mm
    assert turns is not None
    return _even_travel(table, turns * lead_mm)


def _even_travel(table: pd.DataFrame, travel_mm: float) -> Array:
    """Constant speed: 0 to u p over the rows of S1, and back to 0 over those of S2 and S3, pass by pass."""
    keys = [name for name in ("slider", "payload_kg", "cycle") if name in table]
    forward = (table["phase"].str.strip().str.upper() == "S1").rename("forward")
    groups = table.groupby([*keys, forward], sort=False)
    share = (groups.cumcount() + 1.0) / groups["slider"].transform("size")
    share = share.where(forward, 1.0 - share)
    return np.array(share * travel_mm, dtype=np.float64)
