"""A table from the columns of a tracker CSV that are numbers and texts already: the inverse of `ptt.run.written`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ptt.run.axes import AXES
from ptt.run.table import Table, make_table
from ptt.run.written import QUATERNION

Columns = Mapping[str, np.ndarray]
PLAIN = ("repeat", "time_s", "payload_kg", "temp_c", "feed_mm_s", "line", "name", "role")  # as a table has them
MOST_JOINTS = 32  # columns of joints are looked for up to this number


def columns_to_table(columns: Columns, file: str, run: str) -> Table:
    """The table of a run from its columns.

    Args:
        columns: title -> (n,), as in a tracker CSV, and 'line' where they are not all lines of it; NaN in empty cells.
        file: name of the run's file, for messages.
        run: SHA-256 of that file.

    Returns:
        The table, without columns that have no meaning for the program.
    """
    prefix = "q" if "q1_cmd_rad" in columns else "b"
    angle = "_rad" if prefix == "q" else ""
    joints = range(1, MOST_JOINTS + 1)
    rows = len(next(iter(columns.values())))
    labels, codes = number_runs(columns.get("run"), rows)
    target = _stack(columns, [f"{axis}_cmd" for axis in AXES])
    fields: dict[str, Any] = {
        "run": codes,
        "run_label": labels,
        "run_sha256": (run,) * len(labels),
        "direction": _stack(columns, [name for i in joints if (name := f"dir{i}") in columns]),
        "torque": _stack(columns, [name for i in joints if (name := f"tau{i}") in columns]),
        "std": _stack(columns, [f"{axis}_std" for axis in AXES]),
        "orientation_measured": _stack(columns, [f"{axis}_meas" for axis in QUATERNION]),
        "orientation_command": _stack(columns, [f"{axis}_cmd" for axis in QUATERNION]),
        "source": file,
        "joint_prefix": prefix,
        **{name: columns[name] for name in PLAIN if name in columns},
    }
    return make_table(
        np.full((rows, 3), np.nan) if target is None else target,
        _stack(columns, [name for i in joints if (name := f"{prefix}{i}_cmd{angle}") in columns]),
        _stack(columns, [f"{axis}_meas" for axis in AXES]),
        **fields,
    )


def _stack(columns: Columns, names: list[str]) -> np.ndarray | None:
    """Columns side by side, (n, k), NaN for those that are missing; None where all are."""
    there = [name for name in names if name in columns]
    if not there:
        return None
    empty = np.full(len(columns[there[0]]), np.nan)
    return np.stack([columns.get(name, empty) for name in names], axis=1)


def number_runs(names: np.ndarray | None, rows: int) -> tuple[tuple[str, ...], np.ndarray]:
    """Number the runs of rows.

    Args:
        names: label of each row's run, (n,); None where all are of one.
        rows: n.

    Returns:
        Labels in order of appearance, and the code of each row, (n,) int.
    """
    if names is None:
        return ("",), np.zeros(rows, dtype=np.int64)
    labels, first, codes = np.unique(names, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return tuple(str(label) for label in labels[order]), np.argsort(order)[codes.reshape(-1)]
