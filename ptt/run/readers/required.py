"""Requirements on a table: columns, cells and possible numbers; errors name file, row and column."""

import re
from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from ptt.errors import TableError, shown
from ptt.run.readers.columns import dimension_of, file_title, greatest, least
from ptt.run.readers.export import Export

SHOWN_TITLES = 12  # listed in a message
SETTABLE = {
    "payload_kg": "payload",
    "temp_c": "temp",
    "feed_mm_s": "feed",
    "x_std": "x_std",
    "y_std": "y_std",
    "z_std": "z_std",
}
CONTEXT = {"time_s": "time", "payload_kg": "payload", "temp_c": "temp", "feed_mm_s": "feed"}


def require_number(name: str, value: float) -> None:
    """Refuse an impossible value that is set for all rows.

    Args:
        name: as in 'payload_kg'.
        value: of it.

    Raises:
        TableError: not finite, or beyond any machine.
    """
    if not np.isfinite(value):
        raise TableError(f"{name} = {value} is not a finite number", where="--set", fix="give a number")
    if abs(value) > greatest({**CONTEXT, **SETTABLE}[name]):
        raise TableError(f"{name} = {value:g} is beyond any machine", where="--set", fix="correct it")
    if value < (low := least({**CONTEXT, **SETTABLE}[name])):
        raise TableError(f"{name} = {value:g} is less than there can be ({low:g})", where="--set", fix="correct it")


def require_columns(
    export: Export, target: np.ndarray | None, command: np.ndarray | None, prefix: str, joints: int, purpose: str
) -> None:
    """Require commands to send, readings of a run, and targets or commands; arguments as `table_fields`."""
    if purpose == "sliders" and command is None:
        refuse_missing(export, [f"{prefix}{i + 1}" for i in range(joints)], "they are the commands to send")
    if purpose == "run":
        missing = [f"{axis}_meas" for axis in "xyz" if f"{axis}_meas" not in export.columns]
        if missing:
            refuse_missing(export, missing, "they are the tracker's readings")
    if command is None and purpose == "run":
        _refuse_foreign(export, prefix, joints)
    if target is None and command is None:
        _refuse_foreign(export, prefix, joints)
        other = f"{file_title(f'{prefix}1_cmd')} to {file_title(f'{prefix}{joints}_cmd')}"
        where = f"neither they nor {other} are there; readings alone are paired with --targets T.csv"
        refuse_missing(export, ["x_cmd", "y_cmd", "z_cmd"], where)


def refuse_scale_log(export: Export) -> None:
    """Refuse the log of a linear scale, naming the command that reads it.

    Args:
        export: what was read as a run.

    Raises:
        TableError: it is such a log.
    """
    titles = {title.strip().lower() for title in export.extra}
    readings = {f"{axis}_meas" for axis in "xyz"} & export.columns.keys()
    if not readings and "scale_mm" in titles and titles & {"command_turns", "motor_mm"}:
        what = "a log of a linear scale, not of a tracker: it has a column scale_mm"
        raise TableError(what, where=export.source, fix="`ptt backlash` reads it")


def _refuse_foreign(export: Export, prefix: str, joints: int) -> None:
    """An arm's run with the machine file of a 3-PTT, or the reverse: no column would help.

    Three joints beside targets may be the sliders of a controller that calls them axes.
    """
    foreign = foreign_to(export, prefix)
    axes = prefix == "b" and len(foreign) == joints and "x_cmd" in export.columns
    if foreign and not axes:
        refuse_other_machine(foreign, prefix, joints, export.source)


def refuse_other_machine(commands: Sequence[str], prefix: str, joints: int, source: str) -> NoReturn:
    """Say that rows are of another machine.

    Args:
        commands: titles of their columns of joints.
        prefix: letter of the machine's own joints.
        joints: how many there are.
        source: what the rows were read from.
    """
    own = "an arm, whose joints are" if prefix == "q" else "a 3-PTT, whose sliders are"
    raise TableError(
        f"run and machine do not belong together: the commands are {', '.join(commands)}, and the machine is {own} "
        f"{prefix}1 to {prefix}{joints}",
        where=source,
        fix="use the machine file that belongs to this run",
    )


def refuse_missing(export: Export, names: list[str], why: str) -> None:
    """Raise an error with the missing columns, why they are needed, and the titles that were not understood."""
    ignored = export.understood.ignored
    more = ", ..." if len(ignored) > SHOWN_TITLES else ""
    kept = f"; columns not understood: {', '.join(map(shown, ignored[:SHOWN_TITLES]))}{more}" if ignored else ""
    word = "columns are" if len(names) > 1 else "column is"
    titles = ", ".join(file_title(name) if dimension_of(name) else name for name in names)
    raise TableError(
        f"{word} missing: {titles} ({why}{kept})",
        where=export.source,
        fix="add the column, or say with --map FILE.toml which one it is",
    )


def require_cells(
    export: Export, target: np.ndarray | None, command: np.ndarray | None, is_base: np.ndarray, prefix: str
) -> None:
    """Each row needs its joint commands where the file has such columns, else its target; base points need neither."""
    block = command if command is not None else target
    if block is None:
        return
    empty = np.argwhere(np.isnan(block) & ~is_base[:, None])
    if empty.size:
        row, column = (int(index) for index in empty[0])
        sent = command is not None
        raise TableError(
            "empty command" if sent else "empty target",
            where=place(export, row, f"{prefix}{column + 1}_cmd" if sent else f"{'xyz'[column]}_cmd"),
            fix=f"fill in {'what was sent' if sent else 'where the tool should be'}, or remove the whole row",
        )


def place(export: Export, row: int, quantity: str) -> str:
    """`run.csv row 41, column x_meas`, by the title that the file has."""
    return f"{export.source} row {export.line[row]}, column {title_of(export, quantity)}"


def title_of(export: Export, quantity: str) -> str:
    """What a file calls a quantity; the program's own title where it has none.

    Args:
        export: the columns.
        quantity: as in 'x_meas'.

    Returns:
        The title, as a message shows it.
    """
    titles = export.understood.mapping.columns
    return shown(next((title for title, each in titles.items() if each == quantity), file_title(quantity)))


def joints_told(*exports: Export) -> tuple[int, str]:
    """Number of joints and their letter ('b' or 'q') as the columns imply, where no machine file states them."""
    angles = max((foreign_to(export, "b") for export in exports), key=len)
    return (len(angles), "q") if angles else (3, "b")


def foreign_to(export: Export, prefix: str) -> list[str]:
    """Titles of joint commands of the other kind of machine."""
    other = "q" if prefix == "b" else "b"
    return [file_title(name) for name in export.columns if re.fullmatch(rf"{other}[1-9]\d*_cmd", name)]
