"""`ptt.add`, `ptt.remove`, `ptt.fit`: change a model, refit everything, show what that does to the error."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ptt.diagnosis.telling.other_setups import by_mount
from ptt.diagnosis.telling.words import SET_RIGHT, sentences
from ptt.door.handed import RowsLike
from ptt.door.model import EffectLike, Model, as_model, model_of
from ptt.door.opened import Opened, open_checked
from ptt.door.result import Note, NoteCollector, Result, ignore_note
from ptt.door.words import as_run
from ptt.effects import Library
from ptt.errors import ModelError
from ptt.fitting.drawn_sizes import unnamed_sizes
from ptt.fitting.report_words import format_fit
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb, descend
from ptt.judge.ladder.ladder import Ladder, LadderStep
from ptt.judge.ladder.text import format_ladder, left_over
from ptt.plan.elsewhere import Elsewhere, elsewhere
from ptt.progress import Progress, unwatched

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Verb = Literal["add", "remove", "fit"]
STALE = "the RBF of the compensator is dropped: it had learned what the old model left over; train it again"

# Share of the drawing's error beyond which more of it is unexplained than explained, so that values stand in for it
MOST_LEFT = 0.5
STAND_IN = (
    "Commands are best with these values, which also make up for a part of what is not explained yet. To set the "
    "machine right, take sizes that `ptt diagnose` states: these stand beside the unexplained part."
)
EITHER = (
    "Set it right, or let the commands of `ptt predict` correct it, not both: measure a mended machine again before "
    "commands are sent."
)


@dataclass(frozen=True, eq=False, repr=False)
class Changed(Result):
    """A model after effects were added, removed or refitted.

    Attributes:
        ladder: the error after each step, and the fit.
        opened: run and model as given.
        verb: 'add', 'remove' or 'fit'.
        library: effects by name, those that were added included.
        notes: what was found on the way, a line each.
        asked: keys of the effects that were named.
    """

    ladder: Ladder
    opened: Opened
    verb: Verb
    library: Library
    notes: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()

    @cached_property
    def model(self) -> Model:
        """The model after the last step, with its history; equal to what is read back after `model.save`."""
        return model_of(record(self.ladder, self.verb, self.opened.files), self.library)

    @property
    def steps(self) -> tuple[LadderStep, ...]:
        """The steps, the model as given first."""
        return self.ladder.steps

    @cached_property
    def elsewhere(self) -> Elsewhere | None:
        """Expected error of the model's commands at the poses of the run, and over the workspace."""
        return elsewhere(self.ladder.steps[-1].fitted, self.opened.problem)

    def _figures(self) -> Mapping[str, Any]:
        far = {"elsewhere_um": self.elsewhere and self.elsewhere.to_dict()}
        return self.ladder.to_dict() | far | self.opened.set_up

    def __str__(self) -> str:
        """The ladder, the effects in words, and the fit."""
        last, drawn = self.ladder.steps[-1].fitted, self.ladder.report.rms_um["aligned"]["total"]
        more = bool(left_over(self.ladder)) and self.ladder.steps[-1].rms_um["total"] > MOST_LEFT * drawn
        told = sentences(
            last.model.terms,
            self.opened.problem,
            last.noise,
            last.scatter**0.5,
            last.unnamed_covariance,
            cured=not more,
            brief={term.effect.key for term in last.model.terms if term.effect.of_drawing} - {*self.asked},
        )
        if told and more:
            told.append(STAND_IN)
        if self.elsewhere and (far := self.elsewhere.words(self.ladder.steps[-1].rms_um["total"])):
            told.append(far)
        if any(SET_RIGHT in line for line in told):
            told.append(EITHER)
        words = "".join(f"{line}\n" for line in told) + "\n" if told else ""
        return f"{format_ladder(self.ladder)}\n\n{words}{format_fit(self.ladder.report)}"

    def to_frame(self) -> "pd.DataFrame":
        """One row for each step: training and held-out error in um, x, y, z, total."""
        import pandas as pd

        rows = []
        for step in self.ladder.steps:
            held = {f"heldout_{axis}": value for axis, value in step.heldout_rms_um.items()}
            rows.append({"step": step.effect, "kind": step.kind, **step.rms_um, **held})
        return pd.DataFrame(rows)

    def plot(self) -> "Figure":
        """Draw the ladder of errors."""
        from ptt.show.plots.ladder import draw_ladder

        return draw_ladder(self.ladder)

    def save(self, path: str | Path) -> None:
        """Write the model after the last step."""
        self.model.save(path)


def add(
    model: Any,
    run: RowsLike,
    *effects: EffectLike,
    sizes: bool = False,
    anyway: bool = False,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Changed:
    """Add effects to a model one after the other, refit everything jointly, and show the error fall.

    Args:
        model: the model as given.
        run: the run.
        *effects: names, with [label] where there is one, or effects, as ptt.effects.ColumnBend().
        sizes: whether to add, after these, all other sizes of the drawing that the run can test.
        anyway: whether to go on although the set-up looks mistaken.
        progress: told what is done, how much of how much.
        note: told what was found on the way.

    Returns:
        The ladder; `.model` is the fitted model.

    Raises:
        ModelError: an effect is not known, is there already, does not fit the machine, or cannot be tested on this run.
        SetupError: a mistake in the set-up, unless `anyway`.
    """
    usage = "add(model, run, effect, ...)"
    machine, tell = as_model(model, usage), NoteCollector(note)
    opened = open_checked(machine, as_run(run, machine, usage), anyway=anyway, note=tell)
    new = [machine.make(effect) for effect in _named(effects, usage)]
    machine, asked = machine.knowing(new), tuple(effect.key for effect in new)
    if sizes:
        new += unnamed_sizes([*opened.model.keys, *(effect.key for effect in new)], opened.problem)
    if mount := by_mount(opened.model, opened.problem):
        tell(mount)
    ladder = climb(opened.model, opened.noisy(progress), new, progress=progress)
    return _finish(ladder, opened, "add", machine, tell.lines, asked)


def remove(
    model: Any,
    run: RowsLike,
    *effects: EffectLike,
    anyway: bool = False,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Changed:
    """Take effects out of a model, refit the others jointly, and show what that does to the error.

    Args:
        model: the model as given.
        run: the run.
        *effects: names, with [label] where there is one, or effects.
        anyway: whether to go on although the set-up looks mistaken.
        progress: told what is done, how much of how much.
        note: told what was found on the way.

    Returns:
        The ladder; `.model` is the model without them.

    Raises:
        ModelError: an effect is not there.
        SetupError: a mistake in the set-up, unless `anyway`.
    """
    usage = "remove(model, run, effect, ...)"
    machine, tell = as_model(model, usage), NoteCollector(note)
    opened = open_checked(machine, as_run(run, machine, usage), anyway=anyway, note=tell)
    keys = [each if isinstance(each, str) else machine.make(each).key for each in _named(effects, usage)]
    ladder = descend(opened.model, opened.noisy(progress), keys, progress=progress)
    return _finish(ladder, opened, "remove", machine, tell.lines)


def fit(
    model: Any, run: RowsLike, *, anyway: bool = False, progress: Progress = unwatched, note: Note = ignore_note
) -> Changed:
    """Refit the effects of a model to a run, and say what the run can and cannot tell of them.

    Args:
        model: the model as given.
        run: the run.
        anyway: whether to go on although the set-up looks mistaken.
        progress: told what is done, how much of how much.
        note: told what was found on the way.

    Returns:
        The ladder; `.model` is the refitted model.

    Raises:
        SetupError: a mistake in the set-up, unless `anyway`.
    """
    usage = "fit(model, run)"
    machine, tell = as_model(model, usage), NoteCollector(note)
    opened = open_checked(machine, as_run(run, machine, usage), anyway=anyway, note=tell)
    ladder = climb(opened.model, opened.noisy(progress), [], progress=progress)
    return _finish(ladder, opened, "fit", machine, tell.lines)


def _named(effects: tuple[EffectLike, ...], usage: str) -> tuple[EffectLike, ...]:
    """The effects; a list of them is taken as well."""
    if len(effects) == 1 and isinstance(effects[0], list | tuple):
        return tuple(effects[0])
    if not effects:
        raise ModelError(f"{usage}: no effect named", fix="`ptt effects` lists them")
    return effects


def _finish(
    ladder: Ladder, opened: Opened, verb: Verb, machine: Model, said: list[str], asked: tuple[str, ...] = ()
) -> Changed:
    if opened.compensator.network is not None:
        ladder = replace(ladder, notes=(*ladder.notes, STALE))
    return Changed(ladder, opened, verb, machine.library, tuple(said), asked)
