"""A report as one HTML file: no scripts, no addresses, pictures inside; to be mailed, read and printed."""

from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ptt.correct.training.compensator import Compensator
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects.registry import Library
from ptt.files import write_text
from ptt.machine import MachineFile
from ptt.progress import Progress
from ptt.run.problem import Problem
from ptt.run.table import Table
from ptt.show.card.words import length, together, value_in_words
from ptt.show.plots.common import in_micro
from ptt.show.report.card import top_card
from ptt.show.report.contents import Contents
from ptt.show.report.gather import gather
from ptt.show.report.interactive import interactive_parts
from ptt.show.report.pictures import data_uri, draw_pictures
from ptt.show.report.sections import sections_of
from ptt.show.report.source import MadeOf
from ptt.show.report.words import Say, words_of

BAR = files("ptt.show.card").joinpath("style.css").read_text(encoding="utf-8")


def write_report(
    out: str | Path,
    table: Table,
    machine: MachineFile | Compensator,
    source: MadeOf | None = None,
    *,
    known: Library | None = None,
    problem: Problem | None = None,
    after: Table | None = None,
    drawing: Diagnosis | None = None,
    given: Diagnosis | None = None,
    interactive: bool = False,
    language: str = "en",
    progress: Progress | None = None,
) -> Contents:
    """Work a report out and write it; the file appears whole or not at all.

    Args:
        out: HTML file to write.
        table: the rows, n of them.
        machine: machine with its model, or a compensator with its network.
        source: files and options; None where there are no files to name.
        known: effects by name; None for the library.
        problem: the same table seen through the machine; None builds it.
        after: a later run of the same machine, to be held beside this one.
        drawing: what is missing from the drawing, where that is known; None works it out.
        given: the same of the model.
        interactive: embed plotly and two pictures to turn and point at.
        language: 'en', or one that has a file of words.
        progress: told what is done, how much of how much.

    Returns:
        What was written.

    Raises:
        InputError: run and machine cannot be brought together, plotly is missing, or the file cannot be written.
    """
    say = words_of(language)  # a language that is not there is said before anything is worked out
    contents = gather(
        table,
        machine,
        source,
        known=known,
        problem=problem,
        after=after,
        found_drawing=drawing,
        found_given=given,
        progress=progress,
    )
    write_text(out, render(contents, interactive=interactive, language=language, say=say))
    return contents


def render(contents: Contents, *, interactive: bool = False, language: str = "en", say: Say = str) -> str:
    """A report as HTML.

    Args:
        contents: what it says.
        interactive: embed plotly and two pictures to turn and point at.
        language: of the page.
        say: translates words into it.

    Returns:
        The whole page.

    Raises:
        InputError: plotly is missing.
    """
    moving = interactive_parts(contents) if interactive else {}
    sections = sections_of(contents)
    # Marked: the signs of a picture are no words, and stay as they are.
    pictures = {name: Markup(data_uri(picture)) for name, picture in draw_pictures(contents, sections).items()}
    top = top_card(contents, say)
    environment = Environment(
        loader=PackageLoader("ptt.show.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, finalize=lambda said: in_micro(together(said)) if type(said) is str else said,
    )  # fmt: skip
    return environment.get_template("report.html").render(
        contents=contents,
        say=say,
        language=language,
        length=length,
        top=top,
        top_bar=Markup(top.bar) if top else "",  # escaped where it is made
        top_picture=Markup(data_uri(top.picture)) if top and top.picture else "",
        value_in_words=value_in_words,
        sections=sections,
        pictures=pictures,
        style=Markup(f"{BAR}{environment.loader.get_source(environment, 'report.css')[0]}"),  # type: ignore[union-attr]
        moving={name: Markup(text) for name, text in moving.items()},
        run=contents.problem.table.source,
        version=dict(contents.versions)["ptt"],
    )
