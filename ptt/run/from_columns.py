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
EXTRA = "extra:"  # before titles that mean nothing: `time_s` may be a column that the user said to ignore


def columns_to_table(
    columns: Columns, file: str, run: str, prefix: str | None = None, joints: int | None = None
) -> Table:
    """The table of a run from its columns.

    Args:
        columns: title -> (n,), as in a tracker CSV, and 'line' where they are not all lines of it; NaN in empty cells.
            Texts of the user's own have `EXTRA` before their titles.
        file: name of the run's file, for messages.
        run: SHA-256 of that file.
        prefix: 'b' (sliders) or 'q' (joint angles); None to infer it from the columns.
        joints: number k of joints of the machine; None to infer it from the columns.

    Returns:
        The table, without other columns that have no meaning for the program.
    """
    prefix = prefix or ("q" if "q1_cmd_rad" in columns else "b")
    angle = "_rad" if prefix == "q" else ""
    rows = len(next(iter(columns.values())))
    labels, codes = number_runs(columns.get("run"), rows)
    target = _stack(columns, [f"{axis}_cmd" for axis in AXES])
    fields: dict[str, Any] = {
        "run": codes,
        "run_label": labels,
        "run_sha256": (run,) * len(labels),
        "direction": _of_joints(columns, "dir{}", joints),
        "torque": _of_joints(columns, "tau{}", joints),
        "std": _stack(columns, [f"{axis}_std" for axis in AXES]),
        "orientation_measured": _stack(columns, [f"{axis}_meas" for axis in QUATERNION]),
        "orientation_command": _stack(columns, [f"{axis}_cmd" for axis in QUATERNION]),
        "source": file,
        "joint_prefix": prefix,
        "extra": {t.removeprefix(EXTRA): each.astype(str) for t, each in columns.items() if t.startswith(EXTRA)},
        **{name: columns[name] for name in PLAIN if name in columns},
    }
    return make_table(
        np.full((rows, 3), np.nan) if target is None else target,
        _of_joints(columns, f"{prefix}{{}}_cmd{angle}", joints),
        _stack(columns, [f"{axis}_meas" for axis in AXES]),
        **fields,
    )


def _of_joints(columns: Columns, title: str, joints: int | None) -> np.ndarray | None:
    """A quantity of each joint, (n, k): of the joints that the columns name where k is None."""
    names = [title.format(joint + 1) for joint in range(joints or MOST_JOINTS)]
    return _stack(columns, names if joints else [name for name in names if name in columns])


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
