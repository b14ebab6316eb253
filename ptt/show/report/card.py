"""The result card at the top of a report: bar, findings and a picture of the machine, as plain values for the page."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.effects.phrases import smaller_ones
from ptt.show.card.bar import MOST_FINDINGS, bar_html
from ptt.show.card.ghost import ghosts_of, machine_lines
from ptt.show.card.picture import draw_scene
from ptt.show.card.result import card_of_diagnosis
from ptt.show.card.scene import usual_times
from ptt.show.card.words import how_sure, length
from ptt.show.plots.common import png
from ptt.show.report.contents import Contents, ModelLook

DPI = 130


@dataclass(frozen=True)
class TopCard:
    """The contents of the card.

    Attributes:
        card: the result card as plain values.
        bar: the bar as HTML.
        sure: probability of the verdict in words.
        picture: PNG of the machine; None where there is nothing to draw.
        caption: of the picture.
        more: number of findings beyond those that are shown.
    """

    card: dict[str, Any]
    bar: str
    sure: str
    picture: bytes | None
    caption: str
    more: int

    @property
    def findings(self) -> list[dict[str, Any]]:
        """The first `MOST_FINDINGS`, which are shown."""
        return list(self.card["findings"][:MOST_FINDINGS])

    @property
    def more_words(self) -> str:
        """Sentence on where the findings are that are not shown."""
        return f"{smaller_ones(self.more)} {'is' if self.more == 1 else 'are'} listed below"


def top_card(contents: Contents, say: Callable[[str], str]) -> TopCard | None:
    """The card of the model's diagnosis, or of the drawing's where nothing is missing from the model.

    Args:
        contents: contents of the report.
        say: translates words.

    Returns:
        The card; None where there is no diagnosis.
    """
    look = _leading(contents)
    if look is None or look.diagnosis is None:
        return None
    found = look.diagnosis
    card = card_of_diagnosis(found, contents.problem).to_dict()
    for one in card["findings"]:
        one["sure"] = how_sure(one["probability"])
        one["fall"] = f"{length(one['before_um'])} \N{RIGHTWARDS ARROW} {length(one['after_um'])}"
    picture, caption = _picture(look, card, contents)
    more = max(0, len(card["findings"]) - MOST_FINDINGS)
    return TopCard(card, bar_html(card, say), how_sure(card["probability"]), picture, caption, more)


def _leading(contents: Contents) -> ModelLook | None:
    """The model, where its diagnosis finds something, else the drawing, whose findings led to the model."""
    given, drawing = contents.given, contents.drawing
    if given.diagnosis is not None and (contents.bare or given.diagnosis.suggested or drawing.diagnosis is None):
        return given
    return drawing if drawing.diagnosis is not None else None


def _picture(look: ModelLook, card: dict[str, Any], contents: Contents) -> tuple[bytes | None, str]:
    found, problem = look.diagnosis, contents.problem
    rows = np.flatnonzero(problem.used)
    if found is None or not len(rows):
        return None, ""
    keys = tuple(step[0] for step in found.suggested)
    ghosts = ghosts_of(found.model, problem, keys[:1])
    middle = ghosts["rows"][len(ghosts["rows"]) // 2]
    lines = machine_lines(problem).at(int(middle))
    shift = ghosts["shift"].get(keys[0]) if keys else None
    times = 1.0 if shift is None else usual_times(lines, shift)
    figure = draw_scene(lines, shift, card["findings"][0]["values"] if keys else [], times)
    figure.set_dpi(DPI)
    if shift is None:
        return png(figure), "The machine at the middle of the run."
    return png(figure), f"The machine as drawn; in orange {keys[0]}, {times:,.0f} times as large as it is."
