"""A process beside the page: what takes long runs there, tells how far it is, and can be stopped."""

import asyncio
import io
import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from ptt.errors import PttError

Progress = Callable[[str, int, int], None]
POLL = 0.03  # s


class JobCancelledError(Exception):
    """The person stopped the job."""


class JobFailedError(Exception):
    """The job refused or failed; the message is the one of the command line."""


class QuestionError(Exception):
    """A file leaves something open that a person has to answer.

    Attributes:
        question: what is open.
        choices: the possible answers.
    """

    def __init__(self, question: str, choices: Sequence[str]) -> None:
        """Keep question and choices."""
        super().__init__(question)
        self.question, self.choices = question, tuple(choices)


class Worker:
    """One process that does one job after the other in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        """Start the process, so that it has loaded the library when the first job comes.

        Args:
            folder: its working folder.
        """
        self.folder = folder
        self._start()

    @property
    def busy(self) -> bool:
        """Whether a job is running."""
        return self._busy

    async def run(self, job: str, *arguments: Any, tell: Progress | None = None) -> Any:
        """Do a job.

        Args:
            job: name of a function of `ptt.show.studio.jobs`.
            *arguments: what it takes, all of it picklable.
            tell: told what is done, how much of how much.

        Returns:
            What it returns.

        Raises:
            JobCancelledError: it was stopped.
            JobFailedError: it refused or failed.
            QuestionError: it needs an answer.
        """
        self._busy = True
        connection = self._connection
        try:
            connection.send((job, arguments))
            while True:
                while not connection.poll():
                    await asyncio.sleep(POLL)
                kind, *content = connection.recv()
                if kind == "done":
                    return content[0]
                if kind == "failed":
                    raise JobFailedError(content[0])
                if kind == "question":
                    raise QuestionError(*content)
                if tell is not None:
                    tell(*content)
        except (EOFError, OSError):
            if connection is not self._connection:
                raise JobCancelledError("stopped") from None
            self._start()
            raise JobFailedError("the calculation ended unexpectedly (out of memory?); try again") from None
        finally:
            self._busy = connection is not self._connection and self._busy

    def cancel(self) -> None:
        """Stop the running job; a fresh process takes the next one."""
        process, connection = self._process, self._connection
        self._start()
        process.kill()
        process.join()
        connection.close()

    def close(self) -> None:
        """Stop for good."""
        self._process.kill()
        self._process.join()
        self._connection.close()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._process: SpawnProcess = context.Process(target=serve, args=(other, str(self.folder)), daemon=True)
        self._process.start()
        other.close()
        self._busy = False


def serve(connection: Connection, folder: str) -> None:
    """Do jobs until the page goes away.

    Args:
        connection: to the page.
        folder: to work in; messages then name files as a person in that folder would.
    """
    os.chdir(folder)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.stdin = open(os.devnull)  # noqa: SIM115 - nobody is asked on the terminal that the page was started from
    from ptt.show.studio import jobs

    jobs.prepare()
    while True:
        try:
            job, arguments = connection.recv()
            connection.send(_answer(connection, getattr(jobs, job), arguments))
        except (EOFError, BrokenPipeError, KeyboardInterrupt):
            return


def _answer(connection: Connection, job: Callable[..., Any], arguments: Sequence[Any]) -> tuple[Any, ...]:
    def tell(what: str, done: int = 0, of: int = 0) -> None:
        connection.send(("progress", what, done, of))

    try:
        with redirect_stderr(io.StringIO()):
            return "done", job(*arguments, tell=tell)
    except QuestionError as question:
        return "question", question.question, question.choices
    except PttError as error:
        return "failed", " ".join(str(error).split())
    except OSError as error:
        return "failed", f"{Path(str(error.filename or 'file')).name}: {error.strerror or error}"
    except Exception as error:
        return "failed", f"unexpected {type(error).__name__}: {' '.join(str(error).split())}"
