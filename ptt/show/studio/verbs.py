"""Running verbs of the command line in a worker process.

`ptt.show` must not import `ptt.commands`, which imports it; so whoever starts the studio passes the function that runs
verbs (`ptt.commands.main.run`).
"""

import contextlib
import io
import json
from collections.abc import Callable, Sequence
from typing import Any

from ptt.errors import InputError

Run = Callable[[list[str]], int]
_runner: list[Run] = []


def set_runner(run: Run | None) -> None:
    """Set the function that runs verbs in this process.

    Args:
        run: takes the words after `ptt`, prints as the command does and returns its exit code; None for none.
    """
    _runner[:] = [] if run is None else [run]


def run_verb(words: Sequence[str]) -> tuple[str, str]:
    """Run a verb.

    Args:
        words: the words after `ptt`.

    Returns:
        Its standard output and its standard error.

    Raises:
        InputError: it ended with an error and printed no result; the message is that of the command line.
    """
    if not _runner:
        raise InputError("this page was started without the verbs", fix="start it as `ptt studio`")
    said, noted = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(noted):
        code = _runner[0](list(words))
    if code and not said.getvalue():
        lines = [line for line in noted.getvalue().splitlines() if line.strip()] or ["it failed without a word"]
        raise InputError(lines[-1].removeprefix("error: "))
    return said.getvalue(), noted.getvalue()


def run_verb_json(words: Sequence[str]) -> dict[str, Any]:
    """Run a verb with --json.

    Args:
        words: the words after `ptt`.

    Returns:
        Its JSON.

    Raises:
        InputError: it ended with an error and printed no result.
    """
    return dict(json.loads(run_verb([*words, "--json"])[0]))
