"""`ptt report`: one HTML file that says everything, to be mailed and printed."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import (
    Also,
    Anyway,
    Effects,
    Json,
    Map,
    ModelPath,
    Reading,
    Run,
    Set,
    Targets,
    open_model,
    open_run,
    progress,
    show,
)

if TYPE_CHECKING:
    from ptt.commands.common import Opened
    from ptt.correct.training.compensator import Compensator
    from ptt.show.report.contents import Contents
    from ptt.show.report.source import Source

Out = Annotated[Path, typer.Option("--out", metavar="R.html", help="The HTML file to write.")]
Interactive = Annotated[bool, typer.Option("--interactive", help="Embed pictures to turn and point at (plotly).")]
Trained = Annotated[
    Path | None, typer.Option("--compensator", metavar="DIR", help="Folder that train.py wrote for this model.")
]


def report(
    run: Run,
    model: ModelPath,
    out: Out,
    compensator: Trained = None,
    interactive: Interactive = False,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Write one HTML page that needs nothing else: data, error, verdict, ladder, parameters, before and after."""
    from ptt.show.report.html import write_report

    reading = Reading(also, targets, set_, map_, effects, json, anyway)
    opened = open_run(run, model, reading)
    machine = _with_network(opened, compensator)
    with progress() as tell:
        contents = write_report(
            out,
            opened.table,
            machine,
            _source(run, model, compensator, reading),
            known=opened.library,
            problem=opened.problem,
            interactive=interactive,
            progress=tell,
        )
    data = {"out": str(out), "bytes": out.stat().st_size, **contents.to_dict()}
    show(data, _text(contents, out), json)


def _with_network(opened: "Opened", folder: Path | None) -> "Compensator":
    if folder is None:
        return opened.compensator
    from ptt.show.report.contents import with_network

    return with_network(opened.compensator, open_model(folder, opened.library), str(folder))


def _source(run: Path, model: Path, compensator: Path | None, reading: Reading) -> "Source":
    from ptt.show.report.source import source_of

    trained = compensator or (model if model.is_dir() else None)
    given = {
        "model": [model],
        "compensator": [] if trained is None else [trained],
        "run": [run],
        "also": reading.also or (),
        "targets": [] if reading.targets is None else [reading.targets],
        "map": [] if reading.map_ is None else [reading.map_],
        "effects": reading.effects or (),
    }
    return source_of(given, reading.set_ or ())


def _text(contents: "Contents", out: Path) -> str:
    found = contents.given.diagnosis
    verdict = f"no verdict: {contents.given.why_not}" if found is None else f"verdict: {found.verdict}"
    lines = [f"{out}: {out.stat().st_size / 1e6:.1f} MB, {contents.facts.rows} rows", verdict]
    if found is not None:
        lines.append(found.words)
    return "\n".join([*lines, *(f"without {what}: {why}" for what, why in contents.why_not.items())])
