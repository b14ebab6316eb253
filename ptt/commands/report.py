"""`ptt report`: one HTML file that says everything, to be mailed and printed."""

from dataclasses import replace
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
    ReadOptions,
    Run,
    Set,
    Targets,
    asker,
    note,
    progress,
    show,
)

if TYPE_CHECKING:
    from ptt.show.report.contents import Contents

Out = Annotated[Path, typer.Option("--out", metavar="R.html", help="The HTML file to write.")]
Interactive = Annotated[bool, typer.Option("--interactive", help="Embed interactive pictures (plotly).")]
After = Annotated[
    Path | None, typer.Option("--after", metavar="AFTER.csv", help="A later run, to compare with this one.")
]
Language = Annotated[str, typer.Option("--language", metavar="LANG", help="Language of the page: en, zh.")]
Trained = Annotated[
    Path | None,
    typer.Option("--compensator", metavar="DIR", help="Compensator folder that train.py wrote for this model."),
]


def report(
    run: Run,
    model: ModelPath,
    out: Out,
    compensator: Trained = None,
    after: After = None,
    interactive: Interactive = False,
    language: Language = "en",
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Write one self-contained HTML page: data, error, verdict, ladder, parameters, before and after."""
    from ptt.door.opened import open_run
    from ptt.show.report.of_run import report_run

    reading = ReadOptions(also, targets, set_, map_, effects, json, anyway)
    opened, later = open_run(run, model, reading, ask=asker(reading), note=note), None
    if after is not None:
        alone = replace(reading, also=None)
        later = after, open_run(after, model, alone, ask=asker(alone), note=note).table
    with progress() as tell:
        contents = report_run(
            opened, out, run=run, model=model, compensator=compensator, after=later, reading=reading,
            interactive=interactive, language=language, progress=tell,
        )  # fmt: skip
    data = {"out": str(out), "bytes": out.stat().st_size, **contents.to_dict()}
    show(data, _text(contents, out), json)


def _text(contents: "Contents", out: Path) -> str:
    found = contents.given.diagnosis
    verdict = f"no verdict: {contents.given.why_not}" if found is None else f"verdict: {found.verdict}"
    lines = [f"{out}: {out.stat().st_size / 1e6:.1f} MB, {contents.facts.rows} rows", verdict]
    if found is not None:
        lines.append(found.words)
    return "\n".join([*lines, *(f"without {what}: {why}" for what, why in contents.why_not.items())])
