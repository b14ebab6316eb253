"""Computing and writing the report on a run and a model that were opened as for any other verb."""

from pathlib import Path

from ptt.correct.training.compensator import Compensator, load_compensator
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.door.opened import Opened
from ptt.door.options import ReadOptions
from ptt.files import write_text
from ptt.progress import Progress, unwatched
from ptt.run.table import Table
from ptt.show.report.contents import Contents
from ptt.show.report.gather import gather, with_network
from ptt.show.report.html import render
from ptt.show.report.source import MadeOf, source_of
from ptt.show.report.words import words_of


def report_run(
    opened: Opened,
    out: Path,
    *,
    run: Path,
    model: Path,
    compensator: Path | None = None,
    after: tuple[Path, Table] | None = None,
    reading: ReadOptions,
    drawing: Diagnosis | None = None,
    given: Diagnosis | None = None,
    interactive: bool = False,
    language: str = "en",
    progress: Progress = unwatched,
) -> Contents:
    """Compute a report and write it, whole or not at all.

    Args:
        opened: run and model.
        out: HTML file to write.
        run: path of the run as the user named it.
        model: path of the machine file or compensator folder as the user named it.
        compensator: folder of a network that was trained on this model; None for none.
        after: path and table of a later run of the same machine to compare with; None for none.
        reading: how the run was read.
        drawing: diagnosis of the bare drawing, if it is known already; None to make it.
        given: diagnosis of the model, if it is known already; None to make it.
        interactive: whether two interactive pictures are added.
        language: 'en', or one that has a file of words.
        progress: told what is done, how much of how much.

    Returns:
        The contents of the report.

    Raises:
        InputError: the network belongs to another model, there are no words for the language, plotly is missing, or
            the file cannot be written.
    """
    machine = _with_network(opened, compensator)
    source = _source(run, model, compensator, None if after is None else after[0], reading)
    say = words_of(language)  # before the long computation, as it raises for an unknown language
    contents = gather(
        opened.table,
        machine,
        source,
        known=opened.library,
        problem=opened.problem,
        after=None if after is None else after[1],
        found_drawing=drawing,
        found_given=given,
        unexplained=opened.check.unexplained,
        progress=progress,
    )
    write_text(out, render(contents, interactive=interactive, language=language, say=say))
    return contents


def _with_network(opened: Opened, folder: Path | None) -> Compensator:
    if folder is None:
        return opened.compensator
    return with_network(opened.compensator, load_compensator(folder, opened.library), str(folder))


def _source(run: Path, model: Path, compensator: Path | None, after: Path | None, reading: ReadOptions) -> MadeOf:
    trained = compensator or (model if model.is_dir() else None)
    given = {
        "model": [model],
        "compensator": [] if trained is None else [trained],
        "run": [run],
        "also": reading.also or (),
        "after": [] if after is None else [after],
        "targets": [] if reading.targets is None else [reading.targets],
        "map": [] if reading.map_ is None else [reading.map_],
        "effects": reading.effects or (),
    }
    return source_of(given, reading.set_ or ())
