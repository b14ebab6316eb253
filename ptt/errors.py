"""One family of errors; every message says what is wrong, where, and what to do about it."""

from collections.abc import Sequence
from typing import Any


class PttError(Exception):
    """Anything this program refuses or fails at.

    Attributes:
        exit_code: what a command returns to the shell when this error ends it.
    """

    exit_code = 1


class InputError(PttError):
    """Bad input: a file, a value or a combination that the user can mend."""

    exit_code = 2

    def __init__(self, what: str, *, where: str = "", fix: str = "") -> None:
        """Compose the message `where: what; fix`.

        Args:
            what: what is wrong, naming the value.
            where: file, row and column, or the key, as far as known.
            fix: the way out, as an imperative.
        """
        self.what, self.where, self.fix = what, where, fix
        message = f"{where}: {what}" if where else what
        super().__init__(f"{message}; {fix}" if fix else message)


class MachineError(InputError):
    """A machine.toml that cannot be used."""


class TableError(InputError):
    """A table of targets, commands or readings that cannot be used."""


class ModelError(InputError):
    """A model that cannot be composed: an unknown effect, the same one twice, a parameter of the wrong size."""


class WorkspaceError(InputError):
    """Poses that the mechanism cannot reach.

    Attributes:
        rows: zero-based indices of the rows out of reach.
    """

    def __init__(self, what: str, rows: Sequence[int], *, where: str = "", fix: str = "") -> None:
        """Compose the message and keep the rows.

        Args:
            what: what is wrong.
            rows: zero-based indices of the rows out of reach.
            where: file, as far as known.
            fix: the way out.
        """
        self.rows = tuple(rows)
        super().__init__(what, where=where, fix=fix)


class SetupError(PttError):
    """A set-up mistake that makes everything after it worthless.

    Attributes:
        check: what was found, a `ptt.setup.Check`.
    """

    exit_code = 3

    def __init__(self, what: str, check: Any) -> None:
        """Compose the message and keep the findings.

        Args:
            what: findings and cures.
            check: the whole result.
        """
        self.check = check
        super().__init__(what)
