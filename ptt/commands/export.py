"""`ptt export`: the model in a form that a controller runs."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ptt.commands.common import (
    Effects,
    Json,
    Map,
    ModelPath,
    Reading,
    Set,
    note,
    open_library,
    open_model,
    read_rows,
    refuse_readings,
    show,
)


def export(
    model: ModelPath,
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help="Format: c, onnx, klipper, ..., table.")],
    out: Annotated[Path, typer.Option("--out", metavar="PATH", help="File or folder to write.")],
    step: Annotated[
        float | None, typer.Option("--step", metavar="MM", min=1e-6, help="Distance of table entries.")
    ] = None,
    run: Annotated[
        Path | None, typer.Option("--run", metavar="RUN.csv", help="Judge at the loads and speeds of this run.")
    ] = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Write the model for a controller: what the format holds, what it cannot hold, and what error that leaves."""
    from ptt.correct.exports.format import Options
    from ptt.correct.exports.registry import find_format, writer

    chosen = find_format(to)
    reading = Reading(set_=set_, map_=map_, effects=effects, json=json)
    compensator = open_model(model, open_library(reading))
    file = compensator.model.file
    write = writer(chosen, file.machine.kind)
    _refuse_own(out, model)
    table = None if run is None else read_rows(run, file, reading, checked=True)
    if step is not None and not chosen.stepped:
        note(f"--step says nothing to format {chosen.name}")
    result = write(compensator, out, Options(model, step, table))
    data = {"format": chosen.name, "model": str(model), **result.to_dict()}
    show(data, _text(data), json)


def _refuse_own(out: Path, model: Path) -> None:
    """Refuse to write over the model that is exported, or over readings."""
    from ptt.errors import InputError

    refuse_readings(out)
    kept = [model, *(model.iterdir() if model.is_dir() else ())]
    if any(out.exists() and out.resolve() == each.resolve() for each in kept):
        raise InputError("is the model itself; nothing was written", where=str(out), fix="name another file")


def _text(data: dict[str, Any]) -> str:
    left = data["error_um"]
    lines = [f"{data['format']}: {', '.join(data['written'])}"]
    lines.append(f"  holds: {', '.join(data['holds']) or 'the drawing alone: the model has no effects'}")
    lines += [f"  cannot hold {item['effect']}: {item['why']}" for item in data["cannot_hold"]]
    lines.append(
        f"  over the workspace the machine would miss by {left['drawing']:.1f} um with the drawing, "
        f"{left['format']:.1f} um with this, {left['model']:.1f} um with the whole model (rms)"
    )
    return "\n".join(lines + [f"  {line}" for line in data["notes"]])
