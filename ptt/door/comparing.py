"""`ptt.compare`: how large the error is, how much of it is noise, where it is and what it depends on."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.door.handed import RowsLike
from ptt.door.model import as_model
from ptt.door.opened import Opened, open_checked
from ptt.door.result import Note, NoteCollector, Result, ignore_note
from ptt.door.words import as_run
from ptt.fitting.chunks import LONG, sample_stretches, take
from ptt.judge.before_after import BeforeAfter, compare_pair, format_pair
from ptt.judge.compare.comparison import Comparison, compare_run
from ptt.judge.compare.text import format_comparison
from ptt.progress import Progress, unwatched
from ptt.run.axes import AXES_TOTAL

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

USAGE = "compare(model, run, after=None)"


@dataclass(frozen=True, eq=False, repr=False)
class Compared(Result):
    """A run compared with a model.

    Attributes:
        result: all figures and residuals.
        opened: run and model.
        notes: what was left out, a line each.
        pair: the run compared with a later one; None where none was given.
    """

    result: Comparison
    opened: Opened
    notes: tuple[str, ...] = ()
    pair: BeforeAfter | None = None

    @property
    def rms_um(self) -> dict[str, float]:
        """Rms error after frame alignment, x, y, z, total, um."""
        figures: dict[str, float] = self.to_dict()["rms_um"]
        return figures

    def _figures(self) -> Mapping[str, Any]:
        aside = {"network_left_aside": self.opened.compensator.network is not None}
        pair = {} if self.pair is None else {"before_after": self.pair.to_dict()}
        return self.result.to_dict() | self.opened.set_up | aside | {"setup": self._findings()} | pair

    def _findings(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = self.opened.check.to_dict()["findings"]
        return found

    def __str__(self) -> str:
        """What the command prints; findings about the set-up come first."""
        first = f"{self.opened.check}\n\n" if self._findings() else ""
        last = "" if self.pair is None else f"\n\n{format_pair(self.pair)}"
        return first + format_comparison(self.result) + last

    def to_frame(self) -> "pd.DataFrame":
        """One row for each axis and the total: rms, mean, 95th percentile, maximum and noise in um."""
        import pandas as pd

        data = self.to_dict()
        titles = [key for key in ("rms_um", "mean_um", "p95_um", "max_um", "noise_um") if key in data]
        axes = AXES_TOTAL
        return pd.DataFrame({key: [data[key].get(axis) for axis in axes] for key in titles}, index=list(axes))

    def plot(self) -> "Figure":
        """Draw the error over the workspace; of two runs both, side by side in one scale."""
        from ptt.show.plots.field import draw_field, draw_pair

        return draw_field(self.result, self.opened.problem) if self.pair is None else draw_pair(self.pair)

    def pictures(self, folder: str | Path, *, progress: Progress = unwatched) -> tuple[Path, ...]:
        """Draw everything there is into a folder: field, course, histogram, dependences, periods.

        Args:
            folder: where to; made if missing.
            progress: told what is being drawn.

        Returns:
            The PNG files.
        """
        from ptt.show.plots.compare import plot_comparison

        drawn = plot_comparison(self.result, self.opened.problem, folder, progress=progress)
        if self.pair is None:
            return drawn
        from ptt.show.plots.common import save
        from ptt.show.plots.field import draw_pair

        both = Path(folder) / "before_after.png"
        save(draw_pair(self.pair), both)
        return (*drawn, both)


def compare(
    model: Any, run: RowsLike, *, after: RowsLike = None, progress: Progress = unwatched, note: Note = ignore_note
) -> Compared:
    """Compare a run with a model: errors per axis, noise floor, where it fails, what it depends on.

    Args:
        model: the model; a network is left aside.
        run: the run.
        after: a later run of the same machine, whose errors against its targets are shown beside those of the run.
        progress: told what is done, how much of how much.
        note: told what is left aside.

    Returns:
        The comparison; mistakes in the set-up are shown first, and do not raise.

    Raises:
        InputError: the run does not fit this machine.
    """
    machine = as_model(model, USAGE)
    tell = NoteCollector(note)
    opened = open_checked(machine, as_run(run, machine, USAGE), anyway=True, note=tell)
    if opened.compensator.network is not None:
        tell("the compensator's network is left aside: only the physics is compared")
    if opened.table.rows > LONG:
        opened = replace(opened, problem=take(opened.problem, sample_stretches(opened.problem)))
        rows = opened.problem.table.rows
        tell(f"comparing {rows} of {opened.table.rows} rows, in stretches of travel spread over the run")
    result = compare_run(opened.model, opened.problem, noise=opened.noise_or_none(tell), progress=progress)
    if result.without_values:
        tell(f"not fitted yet, so left out: {', '.join(result.without_values)}; `ptt fit` fits them")
    pair = None
    if after is not None:
        later = open_checked(machine, as_run(after, machine, USAGE), anyway=True, note=tell)
        pair = compare_pair(opened.table, later.table, opened.model.file)
    return Compared(result, opened, tuple(tell.lines), pair)
