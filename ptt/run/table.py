"""Tracker CSV <-> Table: one run or several of targets, joint commands, readings and context, in travel order."""

from collections.abc import Iterator, Sequence
from collections.abc import Mapping as Dictionary
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ptt.errors import TableError
from ptt.files import sha256, write_parts
from ptt.run.readers import Ask, Mapping, Request, Understood, load_mapping, pair_targets, read_any, save_mapping
from ptt.run.readers.assemble import set_columns, table_fields
from ptt.run.readers.export import Export
from ptt.run.readers.joined import join_fields
from ptt.run.readers.order import in_travel_order, refuse_order
from ptt.run.readers.parts import read_parts
from ptt.run.readers.scale import scale_fix, scale_hint
from ptt.run.written import columns_of, text_parts


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
        source: file name, or names joined by ' + '.
        joint_prefix: 'b' (sliders) or 'q' (joint angles).
        extra: title -> (n,) str, columns that mean nothing to the program, as written.
        watched: titles of those that a person wants looked at.
        understood: what was made of the file.
        run_sha256: SHA-256 of the file that each run was read from; empty where there is none.
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

    def place(self, row: int, column: str = "") -> str:
        """Where row number `row` (from 0) stands in its file, for messages: `run.csv row 41, column x_meas`."""
        source = self.run_label[self.run[row]] if " + " in self.source else self.source
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


def read_table(
    path: str | Path,
    joints: int = 3,
    *,
    joint_prefix: str = "b",
    also: Sequence[str | Path] = (),
    targets: str | Path | None = None,
    set_values: Dictionary[str, float | str] | None = None,
    mapping: Mapping | str | Path | None = None,
    purpose: str = "run",
    ask: Ask | None = None,
    judge_scale: bool = True,
    judge_order: bool = True,
) -> Table:
    """Read a tracker CSV, or an export of tracker or robot software.

    Args:
        path: the file.
        joints: number k of joints of the machine.
        joint_prefix: 'b' (sliders, mm) or 'q' (joint angles, rad).
        also: further runs; runs of different files stay different runs.
        targets: file with the targets or commands of an export that holds readings only.
        set_values: column -> one value for all rows, for instance {'payload_kg': 2}; and under 'order' what to do where
            time goes back: 'time' sorts each run by its clock, 'rows' keeps the rows as they stand.
        mapping: saved answers on columns and units; a path that does not exist yet is written with what was understood.
        purpose: 'run' (readings needed), 'targets' (poses wanted) or 'sliders' (commands to send: b1..bk or q1..qk).
        ask: who answers what is ambiguous: (question, choices) -> choice; None makes that an error.
        judge_scale: whether readings that look like another unit than the targets are refused; `ptt.setup` names more.
        judge_order: whether time that goes back is refused where nobody said what to do about it.

    Returns:
        The table; `table.understood` says what was made of the files.

    Raises:
        TableError: whatever cannot be read, with file, row, column and a way out.
    """
    answers = _answers(mapping)
    request = Request(purpose, answers, ask)
    how = joints, joint_prefix, targets, set_values or {}, request, judge_scale, judge_order
    tables = [_table_of(each, read_any(each, request), *how) for each in (path, *also)]
    if isinstance(mapping, str | Path) and not Path(mapping).exists():
        save_mapping(tables[0].understood.mapping, mapping)
    return concat_tables(tables)


def _answers(mapping: Mapping | str | Path | None) -> Mapping:
    if isinstance(mapping, str | Path):
        return load_mapping(mapping) if Path(mapping).exists() else Mapping()
    return mapping or Mapping()


def _table_of(
    path: str | Path,
    export: Export,
    joints: int,
    prefix: str,
    targets: str | Path | None,
    set_values: Dictionary[str, float | str],
    request: Request,
    judge_scale: bool,
    judge_order: bool,
    digest: str = "",
) -> Table:
    if targets is not None:
        wanted = Request("beside", request.mapping.targets or Mapping(), request.ask)
        poses = read_any(targets, wanted)
        table_fields(poses, joints, prefix, "targets")  # so that errors name the right file
        export = pair_targets(export, poses, request)
    values = {name: float(value) for name, value in set_values.items() if name != "order"}
    export, moved = replace(export, columns=set_columns(export, values)), list[str]()
    refuse_order(set_values.get("order"))
    if request.purpose == "run":
        order = set_values.get("order", None if judge_order else "rows")
        export, moved = in_travel_order(export, None if order is None else str(order))
    arrays, warnings = table_fields(export, joints, prefix, request.purpose)
    constants = [f"{name} set to {value:g} in every row" for name, value in values.items()]
    understood = replace(export.understood, lines=(*export.understood.lines, *constants, *moved, *warnings))
    digests = (digest or sha256(path),) * len(arrays["run_label"])
    table = Table(**arrays, joint_prefix=prefix, understood=understood, run_sha256=digests)
    hint = scale_hint(table.target, table.measured) if judge_scale else None
    if hint:
        raise TableError(hint, where=table.source, fix=f"{scale_fix(hint)} or convert them")
    return table


def read_targets_in_parts(
    path: str | Path,
    joints: int = 3,
    *,
    joint_prefix: str = "b",
    set_values: Dictionary[str, float | str] | None = None,
    mapping: Mapping | str | Path | None = None,
    ask: Ask | None = None,
) -> Iterator[Table]:
    """Read a long list of targets some rows at a time; arguments and errors as `read_table`.

    Yields:
        The rows in order. Run codes are those of a part.

    Raises:
        NotInParts: the file says something about itself that only the whole tells.
    """
    answers, digest = _answers(mapping), sha256(path)
    for export, request in read_parts(path, Request("targets", answers, ask)):
        if isinstance(mapping, str | Path) and not Path(mapping).exists():
            save_mapping(export.understood.mapping, mapping)
        yield _table_of(path, export, joints, joint_prefix, None, set_values or {}, request, False, False, digest)


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


def table_to_frame(table: Table) -> pd.DataFrame:
    """Columns of the file format, in its units and order; columns without content are left out."""
    return pd.DataFrame(columns_of(table))


def write_table(table: Table, path: str | Path) -> None:
    """Write a tracker CSV that reads back the same, bit for bit; the file appears whole or not at all.

    Args:
        table: what to write.
        path: where to.

    Raises:
        InputError: the folder cannot be written.
        TableError: a name holds a line break.
    """
    for texts in (table.name, np.asarray(table.run_label), *table.extra.values()):
        broken = [text for text in texts.tolist() if "\n" in text or "\r" in text]
        if broken:
            raise TableError(f"line break in {broken[0]!r}", where=str(path), fix="remove it")
    write_parts(path, text_parts(columns_of(table)))


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
