"""Numbers on a command line: finite, and such as a machine can mean. One place for all verbs."""

import math
from collections.abc import Mapping
from typing import Any

from ptt.door.given import require_finite

UNLIMITED = ("limit_mm",)  # arguments that are a limit, and may be none


def require_numbers(values: Mapping[str, Any], options: Mapping[str, str]) -> None:
    """Refuse numbers that nothing can be worked out with.

    Args:
        values: name of a verb's argument -> value.
        options: name of an argument -> what its option is called.

    Raises:
        InputError: one is not finite, or beyond any machine.
    """
    for name, value in values.items():
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, float) and not (name in UNLIMITED and each == math.inf):
                require_finite(each, options.get(name, f"--{name.replace('_', '-')}"))
