"""The page of the effects says what the classes say."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def test_the_page_of_the_effects_is_that_of_the_classes():
    """A change of a card without `make docs` fails here."""
    written = runpy.run_path(str(DOCS / "make" / "effects.py"))["book"]()
    assert (DOCS / "effects.md").read_text(encoding="utf-8") == written
