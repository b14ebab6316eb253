"""Rows of one or several runs: targets, joint commands, readings and context, in travel order."""

from collections.abc import Mapping as Dictionary
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from ptt.run.readers import Understood
from ptt.run.readers.joined import join_fields
from ptt.run.readers.scale import scale_hint


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of one or several runs; n rows, k joints. Never cut a table: hide readings with a mask.

    Attributes:
        target: (n, 3) mm, wanted tool position, NaN where the file gives only joint commands.
        command: (n, k) mm or rad, joint commands that were sent, or None.
        measured: (n, 3) mm, readings, NaN where not observed (each coordinate for itself).
        name: (n,) str, '' where none.
        role: (n,) str, 'pose', 'base' or 'datum'. Base rows have no target and no command (NaN).
        run: (n,) int, codes from 0 in order of appearance.
        run_label: label of each code, as in the file.
        repeat: (n,) float, NaN where none.
        time_s: (n,) s or None.
        payload_kg: (n,) kg or None.
        temp_c: (n,) deg C or None.
        feed_mm_s: (n,) mm/s or None.
        direction: (n, k), +1 or -1, NaN where unknown, or None.
        torque: (n, k) N or N m, or None.
        std: (n, 3) mm or None.
        orientation_measured: (n, 4) quaternion x, y, z, w, or None.
        orientation_command: (n, 4) quaternion x, y, z, w, or None.
        line: (n,) int, line numbers in the file.
        source: file name, or names joined by ' + ', for people: one name may hold ' + ' too.
        joint_prefix: 'b' (sliders) or 'q' (joint angles).
        extra: title -> (n,) str, columns that mean nothing to the program, as written.
        watched: titles of those that a person wants looked at.
        understood: what was made of the file.
        run_sha256: SHA-256 of the file that each run was read from; empty where there is none.
        files: names of the files where the rows are of several; empty where all are of one, which `source` names.
        run_file: index in `files` of the file that each run was read from; empty as they are.
    """

    target: np.ndarray
    command: np.ndarray | None
    measured: np.ndarray
    name: np.ndarray
    role: np.ndarray
    run: np.ndarray
    run_label: tuple[str, ...]
    repeat: np.ndarray
    time_s: np.ndarray | None
    payload_kg: np.ndarray | None
    temp_c: np.ndarray | None
    feed_mm_s: np.ndarray | None
    direction: np.ndarray | None
    torque: np.ndarray | None
    std: np.ndarray | None
    orientation_measured: np.ndarray | None
    orientation_command: np.ndarray | None
    line: np.ndarray
    source: str
    joint_prefix: str = "b"
    extra: Dictionary[str, np.ndarray] = field(default_factory=dict)
    watched: tuple[str, ...] = ()
    understood: Understood = field(default_factory=Understood)
    run_sha256: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    run_file: tuple[int, ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.line)

    @property
    def joints(self) -> int:
        """Number k of joint commands a row has, 0 where the table has none."""
        return 0 if self.command is None else self.command.shape[1]

    @property
    def observed(self) -> np.ndarray:
        """(n,) bool, rows with at least one measured coordinate."""
        return np.asarray(~np.isnan(self.measured).all(axis=1))

    @property
    def of_several_files(self) -> bool:
        """Whether the rows were read from several files, which the labels of their runs name."""
        return len(self.files) > 1

    def file_of(self, run: int) -> str:
        """Name of the file that the run of this code was read from."""
        return self.files[self.run_file[run]] if self.run_file else self.source

    def place(self, row: int, column: str = "") -> str:
        """Where row number `row` (from 0) stands in its file, for messages: `run.csv row 41, column x_meas`."""
        source = self.run_label[self.run[row]] if self.of_several_files else self.source
        return f"{source} row {self.line[row]}" + (f", column {column}" if column else "")

    def replace(self, **changes: Any) -> "Table":
        """A copy with some fields changed."""
        return replace(self, **changes)


def make_table(target: Any, command: Any = None, measured: Any = None, **columns: Any) -> Table:
    """A table from arrays, every other field at its default.

    Args:
        target: (n, 3) mm, or None where only joint commands are given.
        command: (n, k) mm or rad, or None.
        measured: (n, 3) mm, or None for a list of targets.
        **columns: any other field of `Table`; a number stands for all rows of `time_s`, `payload_kg`, `temp_c`,
            `feed_mm_s` and `repeat`.

    Returns:
        The table: run 0, role 'pose', no names, line numbers as a written file has them.
    """
    n = len(target if target is not None else command)
    blank: dict[str, Any] = {
        "target": np.full((n, 3), np.nan) if target is None else np.asarray(target, dtype=np.float64),
        "command": None if command is None else np.asarray(command, dtype=np.float64),
        "measured": np.full((n, 3), np.nan) if measured is None else np.asarray(measured, dtype=np.float64),
        "name": np.full(n, ""),
        "role": np.full(n, "pose"),
        "run": np.zeros(n, dtype=np.int64),
        "repeat": np.full(n, np.nan),
        **dict.fromkeys(("time_s", "payload_kg", "temp_c", "feed_mm_s", "direction", "torque", "std")),
        **dict.fromkeys(("orientation_measured", "orientation_command")),
        "line": np.arange(n) + 2,
        "source": "table",
    }
    for key in ("time_s", "payload_kg", "temp_c", "feed_mm_s", "repeat"):
        if columns.get(key) is not None:
            columns[key] = np.broadcast_to(np.asarray(columns[key], dtype=np.float64), (n,)).copy()
    runs = np.unique(columns.get("run", blank["run"]))
    labels = ("",) if len(runs) == 1 else tuple(str(code) for code in range(int(runs.max()) + 1))
    return Table(**{**blank, "run_label": labels, **columns})


def unit_hint(table: Table, size_mm: float) -> str | None:
    """Whether positions look like another unit than mm.

    Args:
        table: the table.
        size_mm: size of the machine's workspace or of its largest link, mm.

    Returns:
        What they look like, as a sentence, or None. A hint only: a small path is no mistake.
    """
    return scale_hint(table.target, table.measured, size_mm)


def take_rows(table: Table, rows: np.ndarray) -> Table:
    """Some rows of a table, in the order given.

    Args:
        table: the table.
        rows: (m,) int, or (n,) bool.

    Returns:
        The table of those rows; they keep their line numbers.
    """
    columns = {
        each.name: value[rows]
        for each in fields(table)
        if isinstance(value := getattr(table, each.name), np.ndarray) and len(value) == table.rows
    }
    return table.replace(**columns, extra={title: values[rows] for title, values in table.extra.items()})


def concat_tables(tables: Sequence[Table]) -> Table:
    """All rows of several tables; runs of different tables stay different runs, labelled 'file:run'.

    Args:
        tables: at least one; a single one is returned as it is.

    Returns:
        One table; columns that only some have are NaN elsewhere.

    Raises:
        TableError: tables of different machines, or joint commands in some only.
    """
    if len(tables) == 1:
        return tables[0]
    return Table(**join_fields([{each.name: getattr(table, each.name) for each in fields(table)} for table in tables]))
