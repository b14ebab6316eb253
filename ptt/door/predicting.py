"""`ptt.predict`: the commands that put the real tool on its targets."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ptt.correct.commands import without
from ptt.correct.compensate import LIMIT_MM, Commands, Reversal, compensate
from ptt.correct.context import Beyond, beyond_context, beyond_lines, missing_context, require_context
from ptt.correct.terms import left_to_controller
from ptt.door.given import require_number, require_word
from ptt.door.handed import RowsLike
from ptt.door.model import Model, as_model
from ptt.door.opened import check_rows
from ptt.door.outputs import refuse_readings
from ptt.door.result import Note, NoteCollector, Result, ignore_note
from ptt.door.sliders import frame_figures, sliders_columns, summary_of, text_of_figures
from ptt.door.tally import Tally, tally
from ptt.door.words import as_targets
from ptt.effects.late import has_begun, starts_of
from ptt.effects.phrases import SIGNIFICANT, figure
from ptt.errors import InputError, TableError
from ptt.files import write_parts
from ptt.fitting.kept import why_not_kept
from ptt.progress import Progress, unwatched
from ptt.run.table import Table
from ptt.run.target_frame import RunFrame, target_frames
from ptt.run.wanted import placed, placed_rows, standing, with_places
from ptt.run.written import text_parts

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

USAGE = "predict(model, targets)"
BARE = "the model has no effects: these are the drawing's own commands; `ptt diagnose` says what is missing"

REVERSALS = ("software", "none")


@dataclass(frozen=True, eq=False, repr=False)
class Predicted(Result):
    """Corrected commands, n rows in the order of the targets.

    Attributes:
        commands: what to send, and what not and why.
        table: the targets.
        network: whether a network took part.
        frames: the frames that the targets were stated in.
        limit_mm: largest correction that is sent.
        notes: what was found on the way, a line each.
        warnings: what a person should know before these are sent.
    """

    commands: Commands
    table: Table
    network: bool
    frames: tuple[RunFrame, ...]
    limit_mm: float
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    _written: list[str] = field(default_factory=list)

    @property
    def b(self) -> np.ndarray:
        """Slider heights to send, everything included, (n, 3) mm; NaN where nothing is to be sent."""
        if self.table.joint_prefix != "b":
            raise InputError("an arm has no sliders", where="predict(...).b", fix="its joint values are in .q, rad")
        return self.commands.q

    @property
    def q(self) -> np.ndarray:
        """Joint values to send, everything included, (n, k) mm or rad; NaN where nothing is to be sent."""
        return self.commands.q

    @property
    def status(self) -> np.ndarray:
        """Status of each row, (n,); those with 'ok' and 'uncertain' are sent."""
        return self.commands.status

    @property
    def sent(self) -> np.ndarray:
        """Rows with a command to send, (n,) bool."""
        return self.commands.sent

    def to_frame(self) -> "pd.DataFrame":
        """Columns of the input, then what to send, as `ptt predict` writes them."""
        import pandas as pd

        return pd.DataFrame(sliders_columns(self.table, self.commands))

    def to_csv(self, path: str | Path) -> None:
        """Write the commands, whole or not at all.

        Args:
            path: CSV; a file with readings is never replaced, but for earlier commands beside the targets' own.

        Raises:
            InputError: it holds readings, or cannot be written.
        """
        refuse_readings(Path(path), [self.table.measured])
        write_parts(path, text_parts(sliders_columns(self.table, self.commands)))
        self._written[:] = [str(path)]

    def _figures(self) -> Mapping[str, Any]:
        out = self._written[0] if self._written else None
        return summary_of(tally(self.table, self.commands), out, self.network, self.limit_mm) | frame_figures(
            self.frames
        )

    def __str__(self) -> str:
        """What the command prints."""
        return text_of_figures(self.to_dict())

    def plot(self) -> "Figure":
        """Draw the correction of each command against the drawing's, over the targets and in their order."""
        from ptt.show.plots.corrections import draw_corrections

        return draw_corrections(self.table.target, self.commands)


def predict(
    model: Any,
    targets: RowsLike,
    *,
    reversal: Reversal | None = None,
    limit_mm: float = LIMIT_MM,
    anyway: bool = False,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Predicted:
    """Compute the commands that put the real tool on its targets: physics and network are inverted, never the tracker.

    Args:
        model: the model, or what `train` handed back.
        targets: from `read_targets`; a path, a data frame, or an array (n, 3) in mm.
        reversal: 'software' puts reversal compensation into the commands, 'none' leaves it out; None: software.
        limit_mm: largest correction that is sent, mm of tool; inf for none.
        anyway: whether to go on although the set-up looks mistaken.
        progress: told what is done, how much of how much.
        note: told what was found on the way.

    Returns:
        The commands; rows that cannot be sent have a status, no command, and the nearest command that works.

    Raises:
        SetupError: a mistake in the set-up, unless `anyway`.
        TableError: a row without target, or without the load or warmth that an effect depends on.
    """
    require_options(reversal, limit_mm)
    machine, tell = as_model(model, USAGE), NoteCollector(note)
    rows = as_targets(targets, machine, USAGE)
    check_rows(machine.file, rows, anyway=anyway, note=tell)
    table = with_places(machine.file, rows.table)
    frames, asked = target_frames(machine.file, table), standing(table)
    require_context(machine.physics, asked)
    told = placed(machine.file, table)
    note_places(placed_rows(rows.table, told), tell)
    note_frames(frames, tell)
    note_beginnings(machine, tell)
    commands = without(_invert(machine, asked, reversal, limit_mm, progress), table.role == "base")
    network = machine.compensator.network is not None
    warnings = warnings_of(machine, asked, tally(table, commands))
    return Predicted(commands, told, network, tuple(frames), limit_mm, tuple(tell.lines), warnings)


def require_options(reversal: str | None, limit_mm: float) -> None:
    """Refuse an unknown word for reversal compensation, and a negative limit."""
    require_word(reversal, REVERSALS, "reversal")
    require_number(limit_mm, 0.0, "limit_mm", unlimited=True)


def note_places(rows: int, note: Note) -> None:
    """Note how many targets were computed by the drawing from joint commands."""
    if rows:
        count = "1 row has" if rows == 1 else f"{rows} rows have"
        note(f"{count} joint commands and no x_cmd, y_cmd, z_cmd: the target is where the drawing puts the tool there")


def note_frames(frames: Iterable[RunFrame], note: Note) -> None:
    """Note the frames of targets that are not in the base frame."""
    for frame in frames:
        if frame.source not in ("base", "unknown"):
            note(f"targets are taken to be in {frame.words}")


def note_beginnings(machine: Model, note: Note) -> None:
    """Note growth whose body was not at rest as its run began: how warm it is at the first target is not known."""
    for term in machine.physics.terms:
        if not has_begun(term.effect, term.theta):
            continue
        most = int(starts_of(term.theta).abs().argmax())
        kelvin, error = (
            float(starts_of(term.theta)[most]),
            np.nan if term.std is None else float(starts_of(term.std)[most]),
        )
        if abs(kelvin) > SIGNIFICANT * np.nan_to_num(error):
            note(
                f"{term.effect.key} follows the temperature late: what grows is taken to be as warm as temp_c at the "
                f"first target; it was {figure(abs(kelvin))} K {'warmer' if kelvin > 0.0 else 'cooler'} as the "
                "measured run began, and sigma_um allows for as much"
            )


def warnings_of(
    machine: Model, table: Table, counted: Tally, parts: Sequence[Sequence[Beyond]] | None = None
) -> tuple[str, ...]:
    """What a person should know before commands are sent.

    Args:
        machine: the model.
        table: the targets, or some of them.
        counted: figures of all commands.
        parts: loads, temperatures and speeds beyond the model's run, for each part of the targets; None: the table
            holds all targets.
    """
    network = machine.compensator.network is not None
    bare = [] if machine.physics.terms or network else [BARE]
    unsure = [line] if (line := why_not_kept(machine.physics)) else []
    parts = [beyond_context(machine.physics, table)] if parts is None else parts
    rows = sum(counted.status.values())
    context = [*missing_context(machine.physics, table), *beyond_lines(parts, table.source, rows)]
    left = [term.effect.key for term in machine.physics.terms if not term.effect.reverses]
    left = [key for key in left_to_controller(machine.physics) if key in left]  # the others are in `reversal_note`
    unsure += [f"left to the controller, as the machine file says: {', '.join(left)}"] if left else []
    return (*bare, *unsure, *context, *counted.warnings(table.source, network=network))


def _invert(machine: Model, table: Table, reversal: Reversal | None, limit_mm: float, progress: Progress) -> Commands:
    compensator, network = machine.compensator, machine.compensator.network
    if network is not None and compensator.space == "joints":
        _require_posture(table)
    correction, inside = compensator.network_parts()
    return compensate(
        compensator.model,
        table,
        correction=correction,
        inside=inside,
        reversal=reversal,
        limit=limit_mm,
        network=compensator.error,
        progress=progress,
    )


def _require_posture(table: Table) -> None:
    """Refuse targets without the nominal joint commands that a network over joints is asked at."""
    if table.command is None or not np.isfinite(table.command).all():
        raise TableError(
            "the compensator's network was trained on joint commands and these targets have none",
            where=table.source,
            fix="add q1_cmd_rad, q2_cmd_rad, ... of the nominal posture",
        )
