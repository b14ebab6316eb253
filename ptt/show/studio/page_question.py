"""A question about a file, with its answers as buttons."""

from collections.abc import Callable, Sequence
from functools import partial

from nicegui import ui

from ptt.run.readers.order import AS_ROWS, BY_TIME
from ptt.show.card.words import pretty
from ptt.show.studio.later import ANYWAY
from ptt.show.studio.parts import tools
from ptt.show.studio.results import ORDER
from ptt.show.studio.units import unit_in_words

WORDS = {
    (ORDER, BY_TIME): "sort each run by its clock",
    (ORDER, AS_ROWS): "keep the rows as they stand",
    (ANYWAY, ANYWAY): "take it all the same",
}


def show_question(about: str, question: str, choices: Sequence[str], answer: Callable[[str], object]) -> None:
    """Show a question.

    Args:
        about: what it is about, as in `QuestionError`.
        question: the question, with the file's name.
        choices: the possible answers.
        answer: called with the answer that is chosen.
    """
    with ui.element("div").classes("st-tie").props("role=alert"):
        ui.label(pretty(question)).classes("st-head")
        with tools():
            for choice in choices:
                words = WORDS.get((about, choice), unit_in_words(choice))
                pick = ui.button(words, on_click=partial(answer, choice))
                pick.props("no-caps dense outline").props["aria-label"] = f"answer {choice}"
