"""`ptt.export`: the model in a form that a controller runs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from ptt.correct.exports.format import ErrorLeft, Format, Options, Written, said_held
from ptt.correct.exports.held import untold_note
from ptt.correct.exports.registry import find_format, writer
from ptt.correct.training.compensator import load_compensator
from ptt.door.given import require_number
from ptt.door.handed import RowsLike
from ptt.door.model import Model, as_model
from ptt.door.outputs import refuse_readings
from ptt.door.result import Result
from ptt.door.words import as_run
from ptt.errors import InputError
from ptt.machine import format_machine
from ptt.model.entries import write_model
from ptt.progress import Progress, unwatched
from ptt.run.table import Table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LEAST_STEP = 1e-6  # mm or degrees: no controller resolves less
USAGE = "export(model, format, out)"
FREE = (
    "the model was fitted together with the tracker's frame, so no reading shows a shift or turn common to all "
    "positions: the machine may stay off by that much in its base frame"
)


@dataclass(frozen=True, eq=False, repr=False)
class Exported(Result):
    """The result of an export.

    Attributes:
        result: the files, the effects that they hold and cannot hold, and the remaining error.
        format: its name.
        model: the file or folder of the model, as it was named.
    """

    result: Written
    format: str
    model: str

    def _figures(self) -> Mapping[str, Any]:
        return {"format": self.format, "model": self.model, **self.result.to_dict()}

    def __str__(self) -> str:
        """What the command prints."""
        return _text(self.to_dict())

    def to_frame(self) -> "pd.DataFrame":
        """What the machine would miss by, um: with the drawing, with this format, with the whole model."""
        import pandas as pd

        return pd.DataFrame([self.to_dict()["error_um"]], index=[self.format])

    def plot(self) -> "Figure":
        """Draw the error that is left with the drawing, with this format, with the whole model."""
        from ptt.show.plots.exported import draw_error_left

        return draw_error_left(self.result.error_um, self.format)


def export(
    model: Any,
    to: str,
    out: str | Path,
    *,
    step: float | None = None,
    run: RowsLike = None,
    progress: Progress = unwatched,
) -> Exported:
    """Write a model for a controller.

    Args:
        model: the model, or what `train` handed back.
        to: the format: c, onnx, klipper, linuxcnc, reprapfirmware, marlin, siemens, urdf or table.
        out: file or folder to write.
        step: distance of table entries, mm, or degrees of an arm's joint; None takes the format's own.
        run: a run; errors are judged at its loads and speeds.
        progress: told what is done, how much of how much.

    Returns:
        What was written, what the format holds, what it cannot hold, and what error that leaves.

    Raises:
        InputError: an unknown format, one for other machines, an invalid step, or a file that cannot be written.
    """
    machine = as_model(model, USAGE)
    named = _unchanged(machine)
    chosen = find_format(to)
    table = None if run is None else as_run(run, machine, USAGE).table
    if named is not None:
        return export_as(machine, chosen, Path(out), named, step=step, table=table, progress=progress)
    with TemporaryDirectory(prefix="ptt_") as folder:  # the head of the files names the model that `save` would write
        kept = Path(folder) / ("model.toml" if machine.compensator.network is None else "compensator")
        machine.save(kept)
        return export_as(machine, chosen, Path(out), kept, step=step, table=table, called=kept.name, progress=progress)


def _unchanged(model: Model) -> Path | None:
    """Path that a model was read from, if the file still holds the same model; else None."""
    if model.path is None or not model.path.exists():
        return None
    try:
        there = load_compensator(model.path, model.library)
    except InputError:
        return None
    same = format_machine(write_model(there.model)) == format_machine(write_model(model.physics))
    return model.path if same and there.notes == model.compensator.notes else None


def export_as(
    model: Model,
    chosen: Format,
    out: Path,
    path: Path,
    *,
    step: float | None = None,
    table: Table | None = None,
    called: str | None = None,
    progress: Progress,
) -> Exported:
    """Export as the command line does.

    Args:
        model: the model.
        chosen: the format.
        out: file or folder to write.
        path: file or folder that the model is kept in.
        step: distance of table entries, mm or deg.
        table: rows at whose loads and speeds errors are judged.
        called: what the model's file is called; None: by its path.
        progress: told what is done, how much of how much.
    """
    require_number(step, LEAST_STEP, "step")
    write = writer(chosen, model.file.machine.kind)
    _refuse_own(out, path)
    result = write(model.compensator, out, Options(path, step, table, progress=progress))
    result = replace(result, notes=(*result.notes, *untold_note(model.physics, table)))
    if model.file.tracker.frame in ("fitted", "fitted-per-run") and model.physics.terms:
        result = replace(result, notes=(*result.notes, FREE))
    return Exported(result, chosen.name, called or str(path))


def _refuse_own(out: Path, model: Path) -> None:
    """Refuse to write over the model that is exported, or over readings."""
    refuse_readings(out)
    kept = [model, *(model.iterdir() if model.is_dir() else ())]
    if any(out.exists() and out.resolve() == each.resolve() for each in kept):
        raise InputError("is the model itself; nothing was written", where=str(out), fix="name another file")


def _text(data: dict[str, Any]) -> str:
    left = ErrorLeft.told(data["error_um"])
    lines = [f"{data['format']}: {', '.join(data['written'])}"]
    cannot = [each["effect"] for each in data["cannot_hold"]]
    lines.append(f"  holds: {said_held(data['holds'], cannot, left, network=data['network'])}")
    lines += [f"  cannot hold {item['effect']}: {item['why']}" for item in data["cannot_hold"]]
    lines.append(
        f"  over the workspace the machine would miss by {left.drawing:.1f} um rms with the drawing's commands, "
        f"{left.format:.1f} um with this file, {left.model:.1f} um with the whole model"
    )
    return "\n".join(lines + [f"  {line}" for line in data["notes"]])
