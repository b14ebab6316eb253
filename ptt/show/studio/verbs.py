"""Verbs of the command line for the page's own processes: whoever starts the page hands in how they are run."""

import contextlib
import io
import json
from collections.abc import Callable, Sequence
from typing import Any

from ptt.errors import InputError

Run = Callable[[list[str]], int]
_how: list[Run] = []


def use(run: Run | None) -> None:
    """Keep how verbs are run in this process.

    Args:
        run: takes what is typed after `ptt`, prints as the command does and returns its exit code.
    """
    _how[:] = [] if run is None else [run]


def say(words: Sequence[str]) -> tuple[str, str]:
    """Run a verb.

    Args:
        words: as typed after `ptt`.

    Returns:
        What it prints, and its notes.

    Raises:
        InputError: it ended with an error; its words are those of the command line.
    """
    if not _how:
        raise InputError("this page was started without the verbs", fix="start it as `ptt studio`")
    said, noted = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(noted):
        code = _how[0](list(words))
    if code and not said.getvalue():
        lines = [line for line in noted.getvalue().splitlines() if line.strip()] or ["it failed without a word"]
        raise InputError(lines[-1].removeprefix("error: "))
    return said.getvalue(), noted.getvalue()


def ask(words: Sequence[str]) -> dict[str, Any]:
    """Run a verb with --json.

    Args:
        words: as typed after `ptt`.

    Returns:
        What it prints.

    Raises:
        InputError: it ended with an error.
    """
    return dict(json.loads(say([*words, "--json"])[0]))
