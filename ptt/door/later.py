"""Names of the front door whose room is not built yet."""

from typing import Any

from ptt.errors import PttError


def export(*_: Any, **__: Any) -> Any:
    """Write a model for a controller; not there yet.

    Raises:
        PttError: always.
    """
    raise PttError("ptt.export is not part of this version")
