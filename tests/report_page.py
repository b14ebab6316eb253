"""A report's page as it is read, and what the report of a bare drawing holds.

A fixture is imported under its own name (`minimal as minimal`): no line calls it, pytest finds it in the test file.
"""

from dataclasses import replace
from html.parser import HTMLParser

import pytest
from made_runs import empty_run, measure

from ptt.effects.bench import sample_machine
from ptt.run.table import make_table
from ptt.show.report.contents import Contents
from ptt.show.report.gather import gather

VOID = {"meta", "img", "br", "link", "hr", "input"}


class Page(HTMLParser):
    """Tags, addresses and words of a page; tags that do not match are noted."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.faults: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        self.faults += [f"<{tag}> not closed" for tag in self.open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data", "action")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> closes something else")

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in ("script", "style"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def minimal() -> Contents:
    """A bare drawing, nothing that tells the noise, no history, and no file."""
    file = replace(sample_machine("three-ptt"), tracker=sample_machine("three-ptt").tracker)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": None}))
    table = measure(make_table(empty_run(10).target), file, [])
    return gather(table, file)
