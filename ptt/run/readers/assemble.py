"""From the columns of a file to the arrays of a table, with checks of columns and values."""

import re
from collections.abc import Mapping as Dictionary
from typing import Any

import numpy as np

from ptt.errors import TableError, shown
from ptt.run.beside import rows_beside
from ptt.run.from_columns import number_runs
from ptt.run.readers.columns import file_title, split_joint
from ptt.run.readers.export import Export
from ptt.run.readers.required import (
    CONTEXT,
    SETTABLE,
    foreign_to,
    place,
    refuse_missing,
    require_cells,
    require_columns,
    require_number,
    title_of,
)

UNIT = 0.01  # tolerance of a quaternion's length, for values rounded to two or three decimals
ROLES = ("pose", "base", "datum")


def table_fields(export: Export, joints: int, prefix: str, purpose: str) -> tuple[dict[str, Any], list[str]]:
    """Arrays of a table, checked.

    Args:
        export: the columns.
        joints: number k of joints of the machine.
        prefix: 'b' (sliders) or 'q' (joint angles).
        purpose: 'run', 'targets' or 'sliders'.

    Returns:
        Field name -> array (n,), (n, 3), (n, 4), (n, k) or None; and warnings.

    Raises:
        TableError: a column is missing or a value is not allowed.
    """
    columns = export.columns
    role = roles_of(export)
    target, command = _block(export, ["x_cmd", "y_cmd", "z_cmd"]), _commands(export, joints, prefix)
    require_columns(export, target, command, prefix, joints, purpose)
    require_cells(export, target, command, role == "base", prefix)
    labels, run = runs_of(export, role == "base")
    if purpose == "run":
        _require_labels(export, run, labels)
    fields: dict[str, Any] = {
        "target": _nan(export.n) if target is None else target,
        "command": command,
        "measured": _filled(export, [f"{axis}_meas" for axis in "xyz"], _nan(export.n)),
        "name": columns.get("name", np.full(export.n, "")),
        "role": role,
        "run": run,
        "run_label": labels,
        "repeat": columns.get("repeat", np.full(export.n, np.nan)),
        **{field: columns.get(quantity) for field, quantity in CONTEXT.items()},
        "direction": _directions(export, joints),
        "torque": _filled(export, [f"tau{i + 1}" for i in range(joints)], None),
        "std": _stds(export),
        "orientation_measured": _quaternions(export, "meas"),
        "orientation_command": _quaternions(export, "cmd"),
        "line": export.line,
        "source": export.source,
        "extra": export.extra | _unheld(export, joints, prefix),
    }
    warnings = [*_warnings(export, prefix), *_without_scatter(export, fields["std"])]
    return fields, [*warnings, *(_of_a_run(export, run, labels) if purpose == "run" else [])]


def set_columns(export: Export, values: Dictionary[str, float]) -> dict[str, np.ndarray]:
    """Columns with some set to one value for all rows.

    Args:
        export: the columns.
        values: 'payload_kg', 'temp_c', 'feed_mm_s' or 'x_std', 'y_std', 'z_std' -> value.

    Returns:
        All columns.

    Raises:
        TableError: a name that cannot be set, or a value that is not finite or beyond any machine.
    """
    unknown = [name for name in values if name not in SETTABLE]
    if unknown:
        settable = ", ".join((*SETTABLE, "order"))
        raise TableError(f"'{shown(unknown[0])}' cannot be set", where="--set", fix=f"settable: {settable}")
    for name, value in values.items():
        require_number(name, value)
    return export.columns | {SETTABLE[name]: np.full(export.n, float(value)) for name, value in values.items()}


def _nan(n: int) -> np.ndarray:
    return np.full((n, 3), np.nan)


def _block(export: Export, names: list[str]) -> np.ndarray | None:
    """Columns (n, len(names)); None where none is there, an error where only some are."""
    missing = [name for name in names if name not in export.columns]
    if len(missing) == len(names):
        return None
    if missing:
        refuse_missing(export, missing, f"the other{'s' if len(names) > 2 else ''} of {', '.join(names)} are there")
    return np.column_stack([export.columns[name] for name in names])


def _filled(export: Export, names: list[str], none: np.ndarray | None) -> np.ndarray | None:
    """Columns (n, len(names)), NaN for absent ones; `none` where all are absent."""
    if not any(name in export.columns for name in names):
        return none
    return np.column_stack([export.columns.get(name, np.full(export.n, np.nan)) for name in names])


def _commands(export: Export, joints: int, prefix: str) -> np.ndarray | None:
    numbers = [joint[1] for joint in map(split_joint, export.columns) if joint and joint[0] == prefix]
    if numbers and max(numbers) > joints:
        raise TableError(
            f"column {file_title(f'{prefix}{max(numbers)}_cmd')} for a machine of {joints} joints",
            where=export.source,
            fix="use the machine file that belongs to this run",
        )
    return _block(export, [f"{prefix}{i + 1}_cmd" for i in range(joints)])


def roles_of(export: Export) -> np.ndarray:
    """Role of each row, (n,) str: 'pose' where none is stated.

    Args:
        export: n rows.

    Raises:
        TableError: a role that is none of `ROLES`.
    """
    role = export.columns.get("role")
    if role is None:
        return np.full(export.n, "pose")
    role = np.where(role == "", "pose", np.char.lower(role))
    wrong = np.flatnonzero(~np.isin(role, ROLES))
    if wrong.size:
        raise TableError(
            f"unknown role '{shown(str(role[wrong[0]]))}'",
            where=place(export, int(wrong[0]), "role"),
            fix=f"use one of {', '.join(ROLES)}",
        )
    return role


def runs_of(export: Export, is_base: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """Runs of the rows, where a base reflector without run has the run around it.

    Args:
        export: n rows.
        is_base: rows of base reflectors, (n,) bool.

    Returns:
        Labels in order of appearance, and run codes, (n,) int.
    """
    run = export.columns.get("run")
    return number_runs(None if run is None else run[rows_beside((run != "") | ~is_base)], export.n)


def _require_labels(export: Export, run: np.ndarray, labels: tuple[str, ...]) -> None:
    """Refuse rows without a run where others have one: they would form a run of their own."""
    empty = np.flatnonzero((np.array(labels) == "")[run])
    if len(labels) > 1 and empty.size:
        raise TableError(
            "no run, although other rows have one",
            where=place(export, int(empty[0]), "run"),
            fix="fill in the run in every row, or in none",
        )


def _taking_turns(run: np.ndarray, labels: tuple[str, ...]) -> list[str]:
    """A note on a run that resumes after rows of another: the travel to its next row is unknown."""
    starts = np.flatnonzero(np.diff(run, prepend=-1))
    again = starts[starts > np.unique(run, return_index=True)[1][run[starts]]] if len(run) else starts
    if not len(again):
        return []
    where, times = labels[run[again[0]]], f"{len(again)} time{'' if len(again) == 1 else 's'}"
    return [f"run '{where}' resumes after rows of another run; travel begins anew there, {times} in all"]


def _of_a_run(export: Export, run: np.ndarray, labels: tuple[str, ...]) -> list[str]:
    return [*_half_read(export), *_between_runs(export, run, labels), *_taking_turns(run, labels)]


def _between_runs(export: Export, run: np.ndarray, labels: tuple[str, ...]) -> list[str]:
    """A note on base reflectors without run that were read between two runs."""
    named = export.columns.get("run", np.zeros(export.n, dtype=str)) != ""
    following = run[::-1][rows_beside(named[::-1])][::-1]
    rows = np.flatnonzero(~named & (following != run))
    if not len(rows):
        return []
    where = f"row {export.line[rows[0]]}" + (f" and {len(rows) - 1} more" if len(rows) > 1 else "")
    return [f"{where} of base reflectors between two runs: taken as of '{labels[run[rows[0]]]}', the one before"]


def _half_read(export: Export) -> list[str]:
    """A warning on rows with incomplete readings, which are not used."""
    empty = np.isnan(np.column_stack([export.columns[f"{axis}_meas"] for axis in "xyz"]))
    rows = np.flatnonzero(empty.any(axis=1) & ~empty.all(axis=1))
    if not len(rows):
        return []
    titles = " or ".join(f"{axis}_meas" for axis, some in zip("xyz", empty[rows].any(axis=0), strict=True) if some)
    which = (
        f"{len(rows)} rows, first row {export.line[rows[0]]}, have"
        if len(rows) > 1
        else (f"row {export.line[rows[0]]} has")
    )
    return [f"warning: {which} no {titles} although the other axes are filled: treated as no reading"]


def _directions(export: Export, joints: int) -> np.ndarray | None:
    names = [f"dir{i + 1}" for i in range(joints)]
    block = _filled(export, names, None)
    if block is None:
        return None
    block = np.where(block == 0.0, np.nan, block)
    wrong = np.argwhere(~np.isnan(block) & (np.abs(block) != 1.0))
    if wrong.size:
        row, column = (int(index) for index in wrong[0])
        raise TableError(
            f"not a direction ({block[row, column]:g})",
            where=place(export, row, names[column]),
            fix="use +1, -1, or 0 or an empty cell where it is unknown",
        )
    return block


def _stds(export: Export) -> np.ndarray | None:
    names = [f"{axis}_std" for axis in "xyz"]
    block = _filled(export, names, None)
    # Below 1e-9 mm it is no scatter of a reading, and its square may vanish.
    wrong = np.argwhere((block < 0.0) | ((block > 0.0) & (block < 1e-9))) if block is not None else np.empty(0)
    if block is not None and wrong.size:
        row, column = (int(index) for index in wrong[0])
        raise TableError(
            f"{'negative' if block[row, column] < 0.0 else 'vanishing'} standard deviation ({block[row, column]:g})",
            where=place(export, row, names[column]),
            fix="mark it with an empty cell",
        )
    return block


def _without_scatter(export: Export, std: np.ndarray | None) -> list[str]:
    """A warning on standard deviations of zero: no reading is exact, so they are treated as unknown."""
    rows, axes = (np.empty(0, dtype=int),) * 2 if std is None else np.nonzero(std == 0.0)
    if not len(rows):
        return []
    count = len(np.unique(rows))
    where, title = f"{count} row{'' if count == 1 else 's'}", title_of(export, f"{'xyz'[axes[0]]}_std")
    return [f"warning: {title} is 0 in {where}, first row {export.line[rows[0]]}: no scatter is known there; left out"]


def _quaternions(export: Export, of: str) -> np.ndarray | None:
    """Quaternions as written, (n, 4), of unit length but for rounding; they are normalised where they are used."""
    names = [f"q{axis}_{of}" for axis in "xyzw"]
    block = _block(export, names)
    length = np.ones(1) if block is None else np.linalg.norm(block, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1.0) > UNIT)
    if wrong.size:
        row = int(wrong[0])
        more = f", {wrong.size - 1} more rows as well" if wrong.size > 1 else ""
        raise TableError(
            f"the quaternion {', '.join(names)} has length {length[row]:.4g}, not 1{more}",
            where=place(export, row, names[0]),
            fix="write qx, qy, qz, qw of a unit quaternion, or leave the cells empty",
        )
    return block


def _unheld(export: Export, joints: int, prefix: str) -> dict[str, np.ndarray]:
    """Columns of joints that this machine does not have, as text, so that they are kept."""
    other = "q" if prefix == "b" else "b"
    found = {name: re.fullmatch(rf"{other}[1-9]\d*_cmd|(?:dir|tau)([1-9]\d*)", name) for name in export.columns}
    names = [name for name, match in found.items() if match and not (match[1] and int(match[1]) <= joints)]
    values = {file_title(name): export.columns[name] for name in names}
    return {title: np.where(np.isnan(each), "", each.astype(str)) for title, each in values.items()}


def _warnings(export: Export, prefix: str) -> list[str]:
    foreign = foreign_to(export, prefix)
    return [f"not used: {', '.join(foreign)} (this machine's joints are {prefix}1..)"] if foreign else []
