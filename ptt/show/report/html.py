"""A report as one HTML file without external resources, and without scripts unless it is interactive."""

from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ptt.show.card.words import length, together, value_in_words
from ptt.show.plots.common import in_micro
from ptt.show.report.card import top_card
from ptt.show.report.contents import Contents
from ptt.show.report.interactive import interactive_parts
from ptt.show.report.pictures import data_uri, draw_pictures
from ptt.show.report.sections import sections_of
from ptt.show.report.words import Say

CARD_STYLE = files("ptt.show.card").joinpath("style.css").read_text(encoding="utf-8")


def render(contents: Contents, *, interactive: bool = False, language: str = "en", say: Say = str) -> str:
    """A report as HTML.

    Args:
        contents: its contents.
        interactive: whether plotly and two interactive pictures are embedded.
        language: of the page.
        say: translates words into that language.

    Returns:
        The whole page.

    Raises:
        InputError: plotly is missing.
    """
    moving = interactive_parts(contents) if interactive else {}
    sections = sections_of(contents)
    # Markup: `finalize` below must not change the characters of an encoded picture.
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
        style=Markup(f"{CARD_STYLE}{environment.loader.get_source(environment, 'report.css')[0]}"),  # type: ignore[union-attr]
        moving={name: Markup(text) for name, text in moving.items()},
        run=contents.problem.table.source,
        version=dict(contents.versions)["ptt"],
    )
