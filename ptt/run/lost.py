"""Readings of a tracker that has lost its beam and repeats zeros or its last position."""

from dataclasses import replace

import numpy as np
import pandas as pd

from ptt.run.noise import step_of
from ptt.run.table import Table

SEVERAL = 3  # rows with one reading from which it is taken for a lost beam; fewer are left to outlier tests
# Poses that are further apart cannot have one reading, in steps of the last digit: noise of less than a step lets a
# machine that hangs in its play read the same for a while, yet play is no hundred steps of a tracker that coarse.
APART_STEPS = 100.0
APART_MM = 0.1, 5.0  # least, whatever the digits; and most, larger than any machine's error
LEVER = 100.0  # mm from a joint of an arm to its tool, as a rule
INCH = 25.4  # mm


def without_lost(table: Table) -> Table:
    """Leave out readings equal on all three axes, to the last digit, at poses far apart.

    Noise alone keeps a tracker from reading one place twice to the last digit; where digits are few, rows of one pose
    may agree, but rows of poses apart do not. Zeros, which stand for no reading in many exports, need no rule of their
    own.

    Args:
        table: n rows in travel order.

    Returns:
        The table with those cells empty, and a line that says so among what was understood of it.
    """
    lost = _lost(table)
    if not lost.any():
        return table
    first, last = table.line[np.flatnonzero(lost)[[0, -1]]]
    zero = bool((table.measured[lost] == 0.0).all())
    what = "read exactly 0, 0, 0" if zero else "repeat a reading of other poses to the last digit"
    line = (
        f"{int(lost.sum())} rows between {first} and {last} {what} while the machine went elsewhere: treated as "
        "no reading, as from a tracker that has lost its beam; leave their cells empty"
    )
    understood = replace(table.understood, lines=(*table.understood.lines, line))
    return table.replace(measured=np.where(lost[:, None], np.nan, table.measured), understood=understood)


def _lost(table: Table) -> np.ndarray:
    """Rows (n,) whose reading several rows of poses apart have in common."""
    own = pd.DataFrame(table.measured, columns=["x", "y", "z"]).assign(run=table.run)
    read = np.flatnonzero(np.isfinite(table.measured).all(axis=1) & (table.role != "base"))
    rows = read[own.iloc[read].duplicated(keep=False).to_numpy()]
    lost = np.zeros(table.rows, dtype=bool)
    if not len(rows):
        return lost
    step = max(step_of(table.measured[read]), INCH * step_of(table.measured[read] / INCH))
    apart_mm = float(np.clip(APART_STEPS * step, *APART_MM))
    alike = own.iloc[rows].groupby(["run", "x", "y", "z"]).ngroup().to_numpy()
    many = np.bincount(alike)[alike] >= SEVERAL
    apart, wanted = _reach(table.target[rows], alike) > apart_mm, np.isfinite(table.target[rows]).all(axis=1)
    if table.command is not None:  # an arm may go elsewhere with its joints alone
        arm = table.joint_prefix == "q"
        told = _reach(table.command[rows], alike, without_widest=arm) > (apart_mm / LEVER if arm else apart_mm)
        apart = np.where(wanted, apart, told)
    lost[rows] = many & apart
    return lost


def _reach(places: np.ndarray, group: np.ndarray, *, without_widest: bool = False) -> np.ndarray:
    """Diagonal (n,) of the bounding box of the places (n, k) of each row's group, zero where none is known.

    A joint that turns alone may have the reflector on its axis: `without_widest` leaves out the widest side.
    """
    together = pd.DataFrame(places).groupby(group)
    sides = (together.transform("max") - together.transform("min")).fillna(0.0).to_numpy()
    return np.asarray(np.linalg.norm(np.sort(sides, axis=1)[:, : -1 if without_widest else None], axis=1))
