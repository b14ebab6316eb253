"""Numbers of a model as C constants."""

from typing import Any

import numpy as np

LINE = 4  # numbers a line


def number(value: float) -> str:
    """A double that reads back the same."""
    text = repr(float(value))
    if text in ("inf", "-inf"):
        return text.replace("inf", "HUGE_VAL")
    return text if any(c in text for c in ".en") else f"{text}.0"


def table(name: str, values: Any, note: str = "") -> str:
    """A constant array of doubles, of any dimension.

    Args:
        name: of the array.
        values: array, at least one number.
        note: comment behind it.

    Returns:
        C text.
    """
    array = np.asarray(values, dtype=float)
    sizes = "".join(f"[{size}]" for size in array.shape)
    comment = f" /* {note} */" if note else ""
    return f"static const double {name}{sizes} ={comment}\n{_block(array, 1)};\n"


def _block(array: np.ndarray, depth: int) -> str:
    pad = "    " * depth
    if array.ndim == 1:
        parts = [", ".join(number(value) for value in array[at : at + LINE]) for at in range(0, len(array), LINE)]
        return pad + "{" + (",\n" + pad + " ").join(parts) + "}"
    return pad + "{\n" + ",\n".join(_block(each, depth + 1) for each in array) + "\n" + pad + "}"


def define(name: str, value: float | int | str) -> str:
    """A macro of a number."""
    return f"#define {name} {value if isinstance(value, int | str) else number(value)}\n"
