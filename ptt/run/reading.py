"""A table of a tracker CSV, or of an export of tracker or robot software: whole, or targets some rows at a time."""

from collections.abc import Iterator, Sequence
from collections.abc import Mapping as Dictionary
from dataclasses import replace
from pathlib import Path

import numpy as np

from ptt.errors import TableError
from ptt.files import sha256
from ptt.run.copies import SAID
from ptt.run.pasted import ONCE, PASTED, TAKEN
from ptt.run.readers import Ask, Mapping, Request, load_mapping, pair_targets, read_any, save_mapping
from ptt.run.readers.assemble import set_columns, table_fields
from ptt.run.readers.export import Export
from ptt.run.readers.likely import Ends, has_commands, with_likely
from ptt.run.readers.mapping import answers_on_targets, of_targets, without_absent
from ptt.run.readers.order import in_travel_order, refuse_order
from ptt.run.readers.parts import read_parts
from ptt.run.readers.required import joints_told, refuse_scale_log
from ptt.run.readers.scale import scale_fix, scale_hint
from ptt.run.table import Table, concat_tables


def read_table(
    path: str | Path,
    joints: int | None = 3,
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
    ends: Ends | None = None,
) -> Table:
    """Read a tracker CSV, or an export of tracker or robot software.

    Args:
        path: the file.
        joints: number k of joints of the machine; None to infer it from the columns.
        joint_prefix: 'b' (sliders, mm) or 'q' (joint angles, rad).
        also: further runs; runs of different files stay different runs, and none may be there twice.
        targets: file with the targets or commands of an export that holds readings only.
        set_values: column -> one value for all rows, for instance {'payload_kg': 2}; and under 'order' what to do where
            time goes back: 'time' sorts each run by its clock, 'rows' keeps the rows as they stand.
        mapping: saved answers on columns and units; a path that does not exist is written with the interpretation.
        purpose: 'run' (readings needed), 'targets' (poses wanted) or 'sliders' (commands to send: b1..bk or q1..qk).
        ask: who answers what is ambiguous: (question, choices) -> choice; None makes that an error.
        judge_scale: whether readings that look like another unit than the targets are refused; `ptt.setup` names more.
        judge_order: whether time that goes back is refused where nobody said what to do about it.
        ends: least and greatest command of each joint, mm or rad: which columns that are not understood may hold them.

    Returns:
        The table; `table.understood` says how the files were interpreted.

    Raises:
        TableError: anything that cannot be read, with file, row, column and a fix.
    """
    answers = _answers(mapping)
    request = Request(purpose, answers, ask, joints, joint_prefix)
    how = joints, joint_prefix, targets, set_values or {}, request, judge_scale, judge_order, ends
    tables = _with_copies_told([_table_of(each, read_any(each, request), *how) for each in (path, *also)])
    table = concat_tables([_kept(tables[0], mapping), *tables[1:]])
    require_pose(table)
    return table


def require_pose(table: Table) -> None:
    """Refuse a table with base reflectors only, which has no information on the machine.

    Args:
        table: of all files that are read together.

    Raises:
        TableError: there is no other row.
    """
    if (table.role == "base").all():
        what = f"all {table.rows} rows are of base reflectors (role 'base'), and none of the machine"
        fix = "write pose or nothing in column role for readings of the tool"
        raise TableError(what, where=table.source, fix=fix)


def _kept(table: Table, mapping: Mapping | str | Path | None) -> Table:
    """Write a table's interpretation to the mapping file if that does not exist, with a remark on it."""
    if not isinstance(mapping, str | Path) or Path(mapping).exists():
        return table
    save_mapping(table.understood.mapping, mapping)
    line = f"{mapping}: did not exist; written with the columns and units as understood"
    return table.replace(understood=replace(table.understood, lines=(*table.understood.lines, line)))


def _with_copies_told(tables: Sequence[Table]) -> list[Table]:
    """The tables, with a warning on each that appears twice: copies count as repeats without new information."""
    told = list[Table]()
    for table in tables:
        twin = next((one for one in told if table.run_sha256 == one.run_sha256 or same_rows(one, table)), None)
        if twin is not None:
            again = table.rows >= PASTED and all(same_rows(tables[0], each) for each in tables)
            line = f"warning: {table.source} holds the same rows as {twin.source}: {ONCE if again else TAKEN}"
            table = table.replace(understood=replace(table.understood, lines=(*table.understood.lines, line)))
        told.append(table)
    return told


def same_rows(one: Table, other: Table) -> bool:
    """Whether two runs are equal to the last digit in all that was commanded, read and recorded."""
    pairs = [(getattr(one, name), getattr(other, name)) for name in SAID]
    return (
        one.rows == other.rows
        and np.array_equal(one.role, other.role)
        and all(
            first is second if first is None or second is None else np.array_equal(first, second, equal_nan=True)
            for first, second in pairs
        )
    )


def _answers(mapping: Mapping | str | Path | None) -> Mapping:
    if isinstance(mapping, str | Path):
        return load_mapping(mapping) if Path(mapping).exists() else Mapping()
    return mapping or Mapping()


def _table_of(
    path: str | Path,
    export: Export,
    joints: int | None,
    prefix: str,
    targets: str | Path | None,
    set_values: Dictionary[str, float | str],
    request: Request,
    judge_scale: bool,
    judge_order: bool,
    ends: Ends | None = None,
    digest: str = "",
) -> Table:
    poses, wanted = None, request
    if targets is not None:
        answers = answers_on_targets(request.mapping, export.understood.mapping.columns)
        wanted = replace(request, purpose="beside", mapping=answers)
        poses = _read_targets(targets, wanted)
    if joints is None:
        joints, prefix = joints_told(*(each for each in (export, poses) if each is not None))
    if request.joints and request.purpose != "targets" and not (has_commands(export) or has_commands(poses)):
        export = with_likely(path, export, request, ends)
        if targets is not None and poses is not None and not has_commands(export):
            poses = with_likely(targets, poses, wanted, ends)
    if poses is not None:
        table_fields(poses, joints, prefix, "targets")  # so that errors name the right file
        export = pair_targets(*_without_complaints(export, poses, request.mapping), request)
    values = {name: float(value) for name, value in set_values.items() if name != "order"}
    export, moved = replace(export, columns=set_columns(export, values)), list[str]()
    refuse_order(set_values.get("order"))
    if request.purpose == "run":
        refuse_scale_log(export)
        order = set_values.get("order")
        export, moved = in_travel_order(export, None if order is None else str(order), refuse=judge_order)
    arrays, warnings = table_fields(export, joints, prefix, request.purpose)
    constants = [f"{name} set to {value:g} in every row" for name, value in values.items()]
    understood = replace(export.understood, lines=(*export.understood.lines, *constants, *moved, *warnings))
    digests = (digest or sha256(path),) * len(arrays["run_label"])
    table = Table(**arrays, joint_prefix=prefix, understood=understood, run_sha256=digests)
    hint = scale_hint(table.target, table.measured) if judge_scale else None
    if hint:
        raise TableError(hint, where=table.source, fix=f"{scale_fix(hint)} or convert them")
    return table


def _read_targets(path: str | Path, request: Request) -> Export:
    try:
        return read_any(path, request)
    except TableError as error:
        raise of_targets(error) from error


def _without_complaints(export: Export, poses: Export, mapping: Mapping) -> tuple[Export, Export]:
    """Both files, without remarks on answers that belong to the other one."""
    own = mapping.targets or Mapping()
    others = {*mapping.columns, *mapping.units} - {*own.columns, *own.units}
    of_readings = without_absent(export.understood, poses.understood.mapping.columns)
    of_poses = without_absent(poses.understood, others)
    return replace(export, understood=of_readings), replace(poses, understood=of_poses)


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
        NotInParts: the file can be interpreted only as a whole.
    """
    answers, digest = _answers(mapping), sha256(path)
    for export, request in read_parts(path, Request("targets", answers, ask, joints, joint_prefix)):
        table = _table_of(
            path, export, joints, joint_prefix, None, set_values or {}, request, False, False, digest=digest
        )
        yield _kept(table, mapping)
