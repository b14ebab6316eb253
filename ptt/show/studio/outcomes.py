"""Exceptions that a job may end with instead of a result."""

from collections.abc import Sequence
from typing import Any


class JobCancelledError(Exception):
    """The person stopped the job."""


class JobFailedError(Exception):
    """The job refused or failed; the message is that of the command line, with advice for the page."""


class QuestionError(Exception):
    """Something in a file is ambiguous, and a person has to decide.

    Attributes:
        question: the question.
        choices: the possible answers.
        about: 'columns'; 'order', where time goes back (choices as of --set order=); or, of a later run, 'anyway':
            whether it is taken although its set-up looks mistaken.
    """

    def __init__(self, question: str, choices: Sequence[str], about: str = "columns") -> None:
        """Keep question, choices and what they are about."""
        super().__init__(question)
        self.question, self.choices, self.about = question, tuple(choices), about


class SetupFoundError(Exception):
    """The set-up looks mistaken; the person may have it corrected, or go on.

    Attributes:
        findings: as `ptt check --json` lists them.
    """

    def __init__(self, findings: Sequence[dict[str, Any]]) -> None:
        """Keep the findings."""
        super().__init__("the set-up looks mistaken")
        self.findings = tuple(findings)
