"""What may come of a job beside its result, and how it tells where it is."""

from collections.abc import Sequence
from typing import Any


class JobCancelledError(Exception):
    """The person stopped the job."""


class JobFailedError(Exception):
    """The job refused or failed; the message is the one of the command line."""


class QuestionError(Exception):
    """A file leaves something open that a person has to answer.

    Attributes:
        question: what is open.
        choices: the possible answers.
        about: 'columns', or 'order': what is to be done where time goes back, as --set has it; of a later run 'anyway',
            too: whether it is taken although its set-up looks mistaken.
    """

    def __init__(self, question: str, choices: Sequence[str], about: str = "columns") -> None:
        """Keep question, choices and what they are about."""
        super().__init__(question)
        self.question, self.choices, self.about = question, tuple(choices), about


class SetupFoundError(Exception):
    """The set-up looks mistaken; the person may mend it or go on.

    Attributes:
        findings: as `ptt check --json` lists them.
    """

    def __init__(self, findings: Sequence[dict[str, Any]]) -> None:
        """Keep the findings."""
        super().__init__("the set-up looks mistaken")
        self.findings = tuple(findings)
