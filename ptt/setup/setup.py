"""A machine file and a run as the user gave them, and changes of either that undo a mistake."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tomlkit

from ptt.machine import MachineFile, ThreePttSpec
from ptt.run.table import Table
from ptt.setup.names import Mistake


@dataclass(frozen=True, eq=False)
class Setup:
    """Both files: the machine and one run.

    Attributes:
        file: the machine.
        table: the run, n rows.
    """

    file: MachineFile
    table: Table

    @property
    def free(self) -> bool:
        """Whether the tracker frame is fitted."""
        return self.file.tracker.frame != "trusted"

    def with_rows(self, **changes: Any) -> "Setup":
        """A set-up with some columns of the run replaced."""
        return replace(self, table=self.table.replace(**changes))

    def with_drawing(self, **changes: Any) -> "Setup":
        """A set-up with some keys of the drawing replaced; `written` puts them into the file's text."""
        return replace(self, file=replace(self.file, machine=self.file.machine.model_copy(update=changes)))


def written(file: MachineFile, drawn: MachineFile) -> MachineFile:
    """A machine file whose TOML text has the changes of its drawing, comments kept.

    Args:
        file: with a changed drawing and the old text.
        drawn: as it was read.

    Returns:
        The file with its text brought up to date.
    """
    if not file.text:
        return file
    document = tomlkit.parse(file.text)
    for section in ("machine", "tracker"):
        before, after = (getattr(each, section).model_dump(mode="json") for each in (drawn, file))
        if before != after:
            _update(document.setdefault(section, tomlkit.table()), before, after)
    return replace(file, text=tomlkit.dumps(document))


def _update(node: Any, before: dict[str, Any], after: dict[str, Any]) -> None:
    """Write the values that differ into a TOML table, recursively in arrays of tables."""
    for key, value in after.items():
        if value == before.get(key):
            continue
        if isinstance(value, list) and value and isinstance(value[0], dict):
            for place, (old, new) in enumerate(zip(before[key], value, strict=True)):
                _update(node[key][place], old, new)
        else:
            node[key] = value


def drawn(setup: Setup) -> ThreePttSpec:
    """The drawing of a machine that is known to be a 3-PTT."""
    assert isinstance(setup.file.machine, ThreePttSpec)
    return setup.file.machine


Undo = Callable[[Setup], Setup]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One mistake that may have been made, and how to undo it.

    Attributes:
        mistake: its name.
        undone: the undoing in words, to follow 'with': 'z negated'.
        fix: what the user should do.
        undo: function that undoes it.
        cost: penalty of an unlikely mistake, in units of the logarithm of the error ratio.
    """

    mistake: Mistake
    undone: str
    fix: str
    undo: Undo
    cost: float = 0.0


def used_rows(table: Table) -> np.ndarray:
    """Rows of poses, not of base reflectors, (n,) bool."""
    return np.asarray(table.role != "base")
