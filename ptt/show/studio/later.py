"""Runs that were measured later: how each is read, and what its date was taken from."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import date

from ptt.run.dates import date_in_name
from ptt.show.studio.results import ORDER, Source

ANYWAY, DATE = "anyway", "date"
ABOUT = ("columns", ORDER, ANYWAY)  # what a question may be about
Said = tuple[str, str, str, str]  # file, what it is about, question, answer


def later_source(source: Source, run: str, said: Sequence[Said]) -> Source:
    """How a later run is read: as the first one, with what was answered of it alone.

    Args:
        source: the first run.
        run: the later one.
        said: of all later runs.

    Returns:
        Its source; what was said of the order of the first one's rows holds for those rows only.
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
    """The date that a file's name holds, else today, as '2026-03-15'."""
    return (date_in_name(name) or date.today()).isoformat()


def whence(run: str, when: str, said: bool) -> str:
    """What the date of a run was taken from, in words.

    Args:
        run: its file.
        when: its date.
        said: whether a person said it.

    Returns:
        Words to stand beside the date.
    """
    named = date_in_name(run)
    if said:
        return "date as you said"
    if named is not None and named.isoformat() == when:
        return "date from its name"
    return "date it was added here; enter the day it was measured"


def before_first(first: tuple[str, str], later: Sequence[tuple[str, str]]) -> str:
    """A warning where runs that were dropped as later ones have a date before that of the first; '' where none has.

    Args:
        first: the run that is open, and its date.
        later: the others.
    """
    early = [run for run, when in later if when < first[1]]
    if not early:
        return ""
    were = f"{' and '.join(early)} {'was' if len(early) == 1 else 'were'}"
    return (
        f"By these dates {were} measured before {first[0]}, which counts as the first: set the dates right, or load "
        "the earliest run first."
    )
