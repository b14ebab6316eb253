"""`ptt.recheck`: has a machine changed since it was solved?"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ptt.again.recheck import recheck as recheck_run
from ptt.again.result import Recheck
from ptt.door.handed import RowsLike
from ptt.door.model import as_model
from ptt.door.next_command import given_in
from ptt.door.opened import Opened, open_checked
from ptt.door.result import Note, NoteCollector, Result, ignore_note
from ptt.door.words import as_run
from ptt.progress import Progress, unwatched
from ptt.run.named import named_rows

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

USAGE = "recheck(model, run)"


@dataclass(frozen=True, eq=False, repr=False)
class Rechecked(Result):
    """The recheck of a solved model on a new run.

    Attributes:
        result: the recheck.
        opened: run and model.
        notes: what was left out, a line each.
    """

    result: Recheck
    opened: Opened
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """'same', 'changed' or 'new'."""
        return self.result.verdict

    @property
    def changed(self) -> tuple[dict[str, Any], ...]:
        """Values that have changed: effect, parameter, unit, before, now, std, z, words."""
        return tuple(item.to_dict() for item in self.result.changed)

    @property
    def words(self) -> str:
        """The verdict for a machinist."""
        return self.result.words

    def _figures(self) -> Mapping[str, Any]:
        return self.result.to_dict() | self.opened.set_up

    def __str__(self) -> str:
        """What the command prints."""
        rows, table = self.result.outlier_rows, self.opened.problem.table
        left = f"\nleft out as gross errors: {named_rows(table, np.array(rows))}" if rows else ""
        names = [] if self.result.new is None else self.result.new.to_add
        after = f"\nnext: {given_in(self.opened).add(names)}" if names and not self.result.other_machine else ""
        return f"{self.result}{left}{after}"

    def to_frame(self) -> "pd.DataFrame":
        """One row for each value: before, now, std, z."""
        import pandas as pd

        return pd.DataFrame([value.to_dict() for value in self.result.parameters])

    def plot(self) -> "Figure":
        """Draw how far each value has moved, in standard errors."""
        from ptt.show.plots.recheck import draw_moved

        return draw_moved(self.result)


def recheck(
    model: Any,
    run: RowsLike,
    *,
    anyway: bool = False,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Rechecked:
    """Compare a new run with a solved model: is the machine the same, what has changed, what is new?

    Args:
        model: solved; a network is left aside.
        run: the new run.
        anyway: whether to go on although the set-up looks mistaken.
        progress: told what is done, how much of how much.
        note: told what is left aside.

    Returns:
        What has changed.

    Raises:
        InputError: the run does not fit this machine, or the model has no fitted effect.
        SetupError: a mistake in the set-up.
    """
    machine = as_model(model, USAGE)
    rows = as_run(run, machine, USAGE)
    tell = NoteCollector(note)
    opened = open_checked(machine, rows, anyway=anyway, note=tell)
    if opened.compensator.network is not None:
        tell("the compensator's network is left aside: only the physics is compared with the run")
    result = recheck_run(opened.model, opened.problem, opened.library, progress=lambda what: progress(what, 0, 0))
    return Rechecked(result.with_unexplained(opened.check.unexplained), opened, tuple(tell.lines))
