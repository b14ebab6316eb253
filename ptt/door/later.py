"""Names of the front door whose room is not built yet."""

from typing import Any

from ptt.errors import PttError


def recheck(*_: Any, **__: Any) -> Any:
    """Say whether a machine has changed since it was solved; not there yet.

    Raises:
        PttError: always.
    """
    raise PttError("ptt.recheck is not part of this version")


def export(*_: Any, **__: Any) -> Any:
    """Write a model for a controller; not there yet.

    Raises:
        PttError: always.
    """
    raise PttError("ptt.export is not part of this version")
