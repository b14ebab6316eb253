"""What a verb is handed, made into what it needs, or refused in words."""

from pathlib import Path
from typing import Any

from ptt.door.model import Model, kind_of
from ptt.door.run import Rows, Run, Targets, read, read_targets
from ptt.errors import InputError


def as_run(given: Any, model: Model, usage: str) -> Run:
    """A run from a run, the path of one, or a data frame.

    Args:
        given: what was handed over.
        model: the machine.
        usage: how the verb is called.

    Raises:
        InputError: it is something else.
    """
    if isinstance(given, Run):
        return given
    if isinstance(given, Model | Targets) or not _readable(given):
        raise InputError(f"{usage}: got {kind_of(given)} where the run belongs", fix="ptt.read reads one from a file")
    return read(given, model)


def as_targets(given: Any, model: Model, usage: str) -> Targets:
    """Targets from targets, the path of some, a data frame, or an array (n, 3) in mm.

    Args:
        given: what was handed over.
        model: the machine.
        usage: how the verb is called.

    Raises:
        InputError: it is something else.
    """
    if isinstance(given, Targets):
        return given
    if isinstance(given, Rows | Model):
        raise InputError(f"{usage}: got {kind_of(given)} where targets belong", fix="ptt.read_targets reads them")
    return read_targets(given, model)


def _readable(given: Any) -> bool:
    return isinstance(given, str | Path) or hasattr(given, "columns") or hasattr(given, "to_frame")
