"""Later runs of the same machine: how each is read, and where its date comes from."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import date

from ptt.run.dates import date_in_name
from ptt.show.studio.results import ORDER, Source

ANYWAY, DATE = "anyway", "date"
ABOUT = ("columns", ORDER, ANYWAY)  # what a question may be about
LaterAnswer = tuple[str, str, str, str]  # name of the run's file, what it is about (or DATE), question, answer


def later_source(source: Source, run: str, said: Sequence[LaterAnswer]) -> Source:
    """Source of a later run: read as the first one (but for the order of its rows), with the answers about itself.

    Args:
        source: source of the first run.
        run: name of the later run's file.
        said: answers on all later runs.

    Returns:
        The source.
    """
    found = replace(
        source, run=run, also=(), set_=tuple(pair for pair in source.set_ if not pair.startswith(f"{ORDER}="))
    )
    for name, about, question, answer in said:
        if name == run and about == ANYWAY:
            found = replace(found, anyway=True)
        elif name == run and about in ABOUT:
            found = found.answered(about, question, answer)
    return found


def date_in(name: str) -> str:
    """The date in a file's name, else that of today, as '2026-03-15'."""
    return (date_in_name(name) or date.today()).isoformat()


def date_origin(run: str, when: str, said: bool) -> str:
    """Where the date of a run comes from, in words to stand beside the date.

    Args:
        run: name of its file.
        when: its date.
        said: whether a person entered it.
    """
    named = date_in_name(run)
    if said:
        return "date as you said"
    if named is not None and named.isoformat() == when:
        return "date from its name"
    return "date it was added here; enter the day it was measured"


def before_first(first: tuple[str, str], later: Sequence[tuple[str, str]]) -> str:
    """A warning where later runs have a date before that of the first; '' where none has.

    Args:
        first: name and date of the run that is open.
        later: name and date of the others.
    """
    early = [run for run, when in later if when < first[1]]
    if not early:
        return ""
    were = f"{' and '.join(early)} {'was' if len(early) == 1 else 'were'}"
    return (
        f"By these dates {were} measured before {first[0]}, which counts as the first: set the dates right, or load "
        "the earliest run first."
    )
