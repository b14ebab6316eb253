"""What a verb says: its result on standard output, notes and progress on standard error."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import typer

from ptt.door.result import plain
from ptt.errors import HostError
from ptt.progress import Progress, StagePace, unwatched

_waiting: list[str] = []


def show(data: Mapping[str, Any], text: str, json: bool) -> None:
    """Print a result: one JSON object, or text.

    Args:
        data: the result as a dictionary; numbers that are not finite become null.
        text: the result for a person.
        json: which of them.
    """
    if json:
        from json import dumps

        text = dumps(plain(data), allow_nan=False)
    tell_notes()
    say(text)


def say(text: str) -> None:
    """Print on standard output.

    Args:
        text: a result.

    Raises:
        HostError: standard output is closed or full; silence would look like success.
    """
    if sys.stdout is None:
        raise HostError("standard output is closed: the result could not be printed")
    try:
        typer.echo(text)
        sys.stdout.flush()
    except UnicodeEncodeError:  # a terminal without these characters, or a lone surrogate in a name
        typer.echo(text.encode("ascii", "backslashreplace").decode())
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise HostError(f"standard output cannot be written ({why}): the result there is incomplete") from None


def say_aside(text: str) -> None:
    """Print on standard error, if it is open."""
    with suppress(OSError, ValueError):
        if sys.stderr is not None:
            clean = text.encode("utf-8", "replace").decode()
            typer.echo(clean, err=True)


def note(text: str) -> None:
    """Print a note on standard error.

    At once on a terminal. Elsewhere with the result, so that an error is the only line.
    """
    if sys.stderr is not None and sys.stderr.isatty():
        say_aside(text)
    else:
        _waiting.append(text)


def tell_notes(keep: bool = True) -> None:
    """Print the waiting notes, or with `keep` false drop them."""
    for text in _waiting if keep else ():
        say_aside(text)
    _waiting.clear()


@contextmanager
def progress() -> Iterator[Progress]:
    """A bar on standard error where a person is watching.

    Yields:
        tell(what, done, of): what is being done, how much of how much.
    """
    if not sys.stderr.isatty():  # nobody watches, so no bar has to be loaded
        yield unwatched
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    columns = TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.fields[pace]}")
    pace = StagePace()
    with Bar(*columns, TimeElapsedColumn(), console=console, transient=True) as bar:
        task = bar.add_task("reading", total=None, pace="")

        def tell(what: str, done: int, of: int) -> None:
            bar.update(task, description=what, completed=done, total=of or None, pace=pace.words(done, of))

        yield tell
