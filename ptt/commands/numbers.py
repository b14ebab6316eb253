"""Validation of numbers on the command line, in one place for all verbs: finite and of plausible size."""

import math
from collections.abc import Mapping
from typing import Any

from ptt.door.given import require_finite

UNLIMITED = ("limit_mm",)  # arguments that may be infinite, as no limit


def require_numbers(values: Mapping[str, Any], options: Mapping[str, str]) -> None:
    """Refuse numbers that are not finite, or larger than any machine needs.

    Args:
        values: name of a verb's argument -> value.
        options: name of an argument -> its option.

    Raises:
        InputError: one is not finite, or too large.
    """
    for name, value in values.items():
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, float) and not (name in UNLIMITED and each == math.inf):
                require_finite(each, options.get(name, f"--{name.replace('_', '-')}"))
