"""A process that calculates: it does one job after the other until the page goes away."""

import io
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from ptt.errors import PttError, SetupError
from ptt.show.studio.on_page import on_page
from ptt.show.studio.outcomes import QuestionError
from ptt.show.studio.verbs import Run, use
from ptt.threads import set_threads


class LeaveOffError(BaseException):
    """The page wants no answer any more; no handler of errors on the way is meant."""


def serve(connection: Connection, verb: Run | None = None) -> None:
    """Do jobs until the page goes away.

    Args:
        connection: to the page.
        verb: how verbs of the command line are run.
    """
    if hasattr(os, "setsid"):
        os.setsid()  # with what it starts it is one group, ended as one
    set_threads()  # as the command line does: figures are the same to the last digit
    sys.stdin = open(os.devnull)  # noqa: SIM115 - nobody is asked on the terminal that the page was started from
    from ptt.show.studio import jobs

    use(verb)
    jobs.prepare()
    while True:
        try:
            asked = connection.recv()
            if asked is None:  # to leave off what was done by then
                continue
            folder, job, arguments = asked
            os.chdir(folder)  # messages then name files as a person in that folder would
            connection.send(_answer(connection, getattr(jobs, job), arguments))
            os.chdir(os.sep)
        except (EOFError, BrokenPipeError, KeyboardInterrupt):
            return


def _answer(connection: Connection, job: Callable[..., Any], arguments: Sequence[Any]) -> tuple[Any, ...]:
    def tell(what: str, done: int = 0, of: int = 0) -> None:
        if connection.poll():  # while a job goes on nothing comes but the wish that it leaves off
            connection.recv()
            raise LeaveOffError
        connection.send(("progress", what, done, of))

    try:
        with redirect_stderr(io.StringIO()):
            return "done", job(*arguments, tell=tell)
    except LeaveOffError:
        return ("left",)
    except QuestionError as question:
        return "question", question.question, question.choices, question.about
    except SetupError as error:
        return "setup", [finding.to_dict() for finding in error.check.findings]
    except PttError as error:
        return "failed", on_page(" ".join(str(error).split()))
    except OSError as error:
        return "failed", f"{Path(str(error.filename or 'file')).name}: {error.strerror or error}"
    except Exception as error:
        return "failed", f"unexpected {type(error).__name__}: {' '.join(str(error).split())}"
