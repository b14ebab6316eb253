"""Errors for rows at poses that the machine cannot have, with file, row and columns."""

import numpy as np

from ptt.errors import PosesError, WorkspaceError, shown
from ptt.run.readers.columns import file_title
from ptt.run.table import Table

ROWS_SHOWN = 5  # named in a message


def require_targets(table: Table, lost: np.ndarray) -> None:
    """Refuse targets that no joint values reach.

    Args:
        table: n rows.
        lost: those rows, (n,) bool.

    Raises:
        WorkspaceError: there is one.
    """
    fix = "check the units and the machine file, or take these targets out"
    _refuse(table, lost, "no joint values reach the target", ["x_cmd", "y_cmd", "z_cmd"], fix)


def require_closed(table: Table, lost: np.ndarray) -> None:
    """Refuse joint commands at which the mechanism cannot be assembled.

    Args:
        table: n rows with commands.
        lost: those rows, (n,) bool.

    Raises:
        WorkspaceError: there is one.
    """
    columns = [f"{table.joint_prefix}{joint + 1}_cmd" for joint in range(table.joints)]
    fix = "check the units, the slider zeros and the link lengths"
    _refuse(table, lost, "the links do not meet at these joint values", columns, fix)


def require_held(table: Table, lost: np.ndarray, machine: str) -> None:
    """Refuse poses at a direct singularity of the drawing: joint values do not determine the tool position there.

    Args:
        table: n rows.
        lost: rows whose target does not follow from its own joint values, (n,) bool.
        machine: name of the machine file.

    Raises:
        PosesError: there is one.
    """
    rows = np.flatnonzero(lost)
    if not len(rows):
        return
    more = f" and {len(rows) - 1} more" if len(rows) > 1 else ""
    raise PosesError(
        f"{table.place(int(rows[0]))}{more}: {machine} puts the machine in a direct singularity there: its links are "
        "parallel or in one plane, so that locked sliders do not hold the tool; are base_radius_mm, platform_radius_mm "
        "and slider_azimuth_deg right? (`ptt dexterity` says more)"
    )


def _refuse(table: Table, lost: np.ndarray, what: str, quantities: list[str], fix: str) -> None:
    rows = np.flatnonzero(lost)
    if not len(rows):
        return
    told = {quantity: title for title, quantity in table.understood.mapping.columns.items()}
    columns = ", ".join(shown(told.get(each, file_title(each))) for each in quantities)
    others = table.line[rows[1:][table.run[rows[1:]] == table.run[rows[0]]]][: ROWS_SHOWN - 1]  # of the same file
    more = ", ..." if len(rows) > 1 + len(others) else ""
    also = f", also row{'s' if len(others) > 1 else ''} {', '.join(map(str, others))}{more}" if len(others) else ""
    where = f"{table.place(int(rows[0]))}, columns {columns}"
    raise WorkspaceError(f"{what} ({len(rows)} of {table.rows} rows{also})", rows.tolist(), where=where, fix=fix)
