"""One family of errors; every message says what is wrong, where, and what to do about it."""

import re
from collections.abc import Sequence
from typing import Any

QUOTED = 60  # characters of a value that a message quotes
LONGEST_PART = 500  # characters of a part of a message


def shown(value: object, most: int = QUOTED) -> str:
    """A value as a message quotes it: on one line, no control characters, cut where it is long.

    Args:
        value: whatever was found.
        most: characters that are kept.

    Returns:
        Its text.
    """
    text = value if isinstance(value, str) else repr(value) if not hasattr(value, "__fspath__") else str(value)
    text = text if len(text) <= most else f"{text[: most - 3]}..."
    return "".join(sign if sign.isprintable() else "?" if "\ud800" <= sign <= "\udfff" else " " for sign in text)


def _brief(text: str) -> str:
    """A part of a message with whatever it quotes, and itself, cut to a length that can be read."""
    text = re.sub(rf"'([^']{{{QUOTED + 1},}})'", lambda found: f"'{shown(found[1])}'", text[: 100 * LONGEST_PART])
    return shown(" ".join(text.split()), LONGEST_PART)


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
        self.what, self.where, self.fix = _brief(what), shown(where, LONGEST_PART), _brief(fix)
        message = f"{self.where}: {self.what}" if where else self.what
        super().__init__(f"{message}; {self.fix}" if fix else message)


class HostError(PttError):
    """The computer, not the input: a full disk, a closed output."""


class MachineError(InputError):
    """A machine.toml that cannot be used."""


class TableError(InputError):
    """A table of targets, commands or readings that cannot be used."""


class TooFewError(TableError):
    """A sound table with too few rows, poses or repeats for what is asked of it."""

    exit_code = 3


class ModelError(InputError):
    """A model that cannot be composed: an unknown effect, the same one twice, a parameter of the wrong size."""


class UntestedError(ModelError):
    """An effect that a sound run cannot test."""

    exit_code = 3


class WorkspaceError(InputError):
    """Poses that the mechanism cannot reach.

    Attributes:
        rows: zero-based indices of the rows out of reach.
    """

    exit_code = 3

    def __init__(self, what: str, rows: Sequence[int], *, where: str = "", fix: str = "") -> None:
        self.rows = tuple(rows)
        super().__init__(what, where=where, fix=fix)


class PosesError(PttError):
    """Poses that cannot work, of which nothing was written."""

    exit_code = 3


class SetupError(PttError):
    """A set-up mistake that makes everything after it worthless.

    Attributes:
        check: what was found, a `ptt.setup.Check`.
    """

    exit_code = 3

    def __init__(self, what: str, check: Any) -> None:
        self.check = check
        super().__init__(what)
