"""`ptt.train`: fit the effects, and let a Gaussian RBF network learn what they leave."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ptt.correct.training.compensator import compensator_of, require_folder
from ptt.correct.training.protocols import PROTOCOLS
from ptt.correct.training.train import Training
from ptt.correct.training.train import train as train_model
from ptt.door.given import require_word
from ptt.door.handed import RowsLike
from ptt.door.model import Model, as_model
from ptt.door.opened import Opened, open_checked
from ptt.door.result import Note, NoteCollector, Result, ignore_note
from ptt.door.words import as_run
from ptt.effects import Library
from ptt.progress import Progress, unwatched
from ptt.record import plain
from ptt.run.axes import AXES_TOTAL
from ptt.run.noise import GUESSED
from ptt.run.taken import frames_said

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

USAGE = "train(model, run)"
STAGES = (("given", "as given"), ("physics", "after physics"), ("rbf", "after the network"))


@dataclass(frozen=True, eq=False, repr=False)
class Trained(Result):
    """A compensator: physics, and the network that learned the rest.

    Attributes:
        training: what was trained, and how well it holds out.
        opened: run and model.
        library: effects by name.
        notes: what was found on the way, a line each.
    """

    training: Training
    opened: Opened
    library: Library
    notes: tuple[str, ...] = ()
    _written: list[str] = field(default_factory=list)

    @cached_property
    def model(self) -> Model:
        """Physics and network, as they would be read from the folder."""
        return Model(compensator_of(self.training, list(self.opened.files)), self.library)

    def save(self, folder: str | Path) -> None:
        """Write the compensator folder, whole or not at all.

        Args:
            folder: made where it does not exist; a compensator that is there is replaced.

        Raises:
            InputError: the folder holds other files too, or cannot be written.
        """
        require_folder(folder)
        self.model.save(folder)
        self._written[:] = [str(folder)]

    def _figures(self) -> Mapping[str, Any]:
        training, chosen = self.training, self.training.rbf.chosen
        return {
            "out": self._written[0] if self._written else None,
            "effects": list(training.physics.model.keys),
            "rows": len(training.physics.residual),
            "status": training.physics.status,
            "outliers": int(training.physics.outliers.sum()),
            "rms_um": training.rms_um,
            "heldout_rms_um": training.heldout_um,
            "protocol": training.protocol,
            "noise_um": training.physics.noise.to_dict(),
            "rbf": {
                "centres": chosen.centres,
                "spread": chosen.spread,
                "learned": dict(zip("xyz", training.rbf.learned.tolist(), strict=True)),
                "share": training.rbf_share,
                "inputs": training.space,
                "heldout_by_inputs_um": training.spaces_um,
            },
            **self.opened.set_up,
        }

    def __str__(self) -> str:
        """What the command prints."""
        return _text(self.to_dict())

    def to_frame(self) -> "pd.DataFrame":
        """Errors in um, training and held out, as given, after physics, after the network."""
        import pandas as pd

        rows = []
        for stage, words in STAGES:
            held = {f"heldout_{axis}": self.training.heldout_um[stage][axis] for axis in AXES_TOTAL}
            rows.append({"stage": words, **{axis: self.training.rms_um[stage][axis] for axis in AXES_TOTAL}, **held})
        return pd.DataFrame(rows)

    def plot(self) -> "Figure":
        """Draw the errors as given, after physics, after the network."""
        from ptt.show.plots.ladder import draw_rungs

        rungs = [(words, self.training.rms_um[stage], self.training.heldout_um[stage]) for stage, words in STAGES]
        return draw_rungs(rungs, plain(self.training.physics.noise.to_dict()))


def train(
    model: Any,
    run: RowsLike,
    *,
    hold_out: Literal["blocks", "random"] = "blocks",
    anyway: bool = False,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Trained:
    """Fit the effects of a model and train the network on what they leave.

    Args:
        model: the machine, with the effects to fit.
        run: the run.
        hold_out: which rows are judged on: whole parts of the path, or poses at random between measured ones.
        anyway: whether to go on although the set-up looks mistaken.
        progress: told what is done, how much of how much.
        note: told what was found on the way.

    Returns:
        The compensator; `.save(folder)` writes it.

    Raises:
        SetupError: a mistake in the set-up, unless `anyway`.
        TableError: too few poses to hold any out.
    """
    require_word(hold_out, PROTOCOLS, "hold_out")
    machine = as_model(model, USAGE)
    tell = NoteCollector(note)
    opened = open_checked(machine, as_run(run, machine, USAGE), anyway=anyway, note=tell)
    protocol = PROTOCOLS[hold_out](opened.problem)
    training = train_model(opened.model, opened.as_noisy(tell), protocol=protocol, progress=progress)
    return Trained(training, opened, machine.library, tuple(tell.lines))


def _text(data: dict[str, Any]) -> str:
    effects = ", ".join(data["effects"]) or "none: the drawing as it is"
    lines = [f"effects: {effects} ({data['status']}, {data['outliers']} outliers left out)"]
    learned = [axis for axis, flag in data["rbf"]["learned"].items() if flag]
    words = f"{data['rbf']['centres']} nodes, for {', '.join(learned)}" if learned else "nothing left that it can learn"
    if learned and len(data["rbf"]["heldout_by_inputs_um"]) > 1:
        words += f", over the {'joints' if data['rbf']['inputs'] == 'joints' else 'tool positions'}"
    lines += [f"network: {words}", f"  {'rms um':<34}{'x':>9}{'y':>9}{'z':>9}{'total':>9}"]
    for key, title in (("rms_um", "training rows"), ("heldout_rms_um", "held out")):
        for stage, name in STAGES:
            row = data[key][stage]
            lines.append(f"  {title + ', ' + name:<34}" + "".join(f"{row[axis]:9.1f}" for axis in AXES_TOTAL))
    noise = data["noise_um"]
    told = "unknown" if noise["source"] == GUESSED else "".join(f"{noise[axis]:9.1f}" for axis in AXES_TOTAL)
    lines.append(f"  {'noise floor':<34}{told}")
    lines += [f"  held out: {data['protocol']}", *frames_said(data["frame_taken"])]
    return "\n".join([*lines, f"written to {data['out']}"] if data["out"] else lines)
