"""Conversion of the arguments of a verb to runs and targets, with errors that name the way out."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from ptt.door.model import Model, kind_of
from ptt.door.run import AnyRows, Rows, Run, Targets, read, read_targets
from ptt.errors import InputError
from ptt.run.readers.columns import file_title
from ptt.run.readers.required import refuse_other_machine


def as_run(given: Any, model: Model, usage: str) -> Run:
    """A run from a run, the path of one, or a data frame.

    Args:
        given: what was handed over.
        model: the machine.
        usage: how the verb is called.

    Raises:
        InputError: it is something else, or was read for another machine.
    """
    if isinstance(given, Run):
        return read_for(given, model)
    if isinstance(given, Model | Targets) or not _readable(given):
        raise InputError(f"{usage}: got {kind_of(given)} where the run belongs", fix="ptt.read reads one from a file")
    return read(given, model)


def as_targets(given: Any, model: Model, usage: str) -> Targets:
    """Targets from targets, the path of some, a data frame, or an array (n, 3) in mm; else as `as_run`."""
    if isinstance(given, Targets):
        return read_for(given, model)
    if isinstance(given, Rows | Model):
        raise InputError(f"{usage}: got {kind_of(given)} where targets belong", fix="ptt.read_targets reads them")
    return read_targets(given, model)


def read_for(rows: AnyRows, model: Model) -> AnyRows:
    """Rows that were read before, checked for a machine; targets without joint values fit any.

    Args:
        rows: a run or targets.
        model: the machine.

    Raises:
        TableError: they hold joint values of a machine with other joints.
    """
    table, spec = rows.table, model.file.machine
    if table.command is not None and (table.joint_prefix, table.command.shape[1]) != (spec.letter, spec.joints):
        names = [file_title(f"{table.joint_prefix}{joint}_cmd") for joint in range(1, table.command.shape[1] + 1)]
        refuse_other_machine(names, spec.letter, spec.joints, table.source)
    for stem, values in (("dir", table.direction), ("tau", table.torque)):
        if values is not None and values.shape[1] != spec.joints:
            names = [f"{stem}{joint}" for joint in range(1, values.shape[1] + 1)]
            refuse_other_machine(names, spec.letter, spec.joints, table.source)
    if table.joint_prefix == spec.letter:
        return rows
    return replace(rows, table=table.replace(joint_prefix=spec.letter))


def _readable(given: Any) -> bool:
    return isinstance(given, str | Path) or hasattr(given, "columns") or hasattr(given, "to_frame")
