"""The main loop of a worker process: it runs one job after the other until the server closes the connection."""

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
from ptt.threads import set_threads


class LeaveOffError(BaseException):
    """The job was cancelled; a BaseException, so that no handler of errors in the library catches it."""


def serve(connection: Connection) -> None:
    """Run jobs until the server closes the connection.

    Args:
        connection: to the server's `ptt.show.studio.pool.WorkerProcess`.
    """
    if hasattr(os, "setsid"):
        os.setsid()  # makes a process group, so that processes started by a job are killed with this one
    set_threads()  # as the command line does, so that results are the same to the last digit
    sys.stdin = open(os.devnull)  # noqa: SIM115 - no job may ask on the server's terminal
    from ptt.show.studio import jobs

    jobs.prepare()
    while True:
        try:
            asked = connection.recv()
            if asked is None:  # the cancellation of a job that has ended meanwhile
                continue
            folder, job, arguments = asked
            os.chdir(folder)  # so that messages name files without folders
            connection.send(_answer(connection, getattr(jobs, job), arguments))
            os.chdir(os.sep)
        except (EOFError, BrokenPipeError, KeyboardInterrupt):
            return


def _answer(connection: Connection, job: Callable[..., Any], arguments: Sequence[Any]) -> tuple[Any, ...]:
    def tell(what: str, done: int = 0, of: int = 0) -> None:
        if connection.poll():  # during a job the only message is its cancellation
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
