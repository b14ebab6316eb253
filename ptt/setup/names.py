"""The set-up mistakes that are known by name."""

from typing import Literal

Mistake = Literal[
    "axes-swapped", "axis-sign", "unit-scale", "slider-order", "slider-sign", "slider-side", "radii-interchanged",
    "diameter-for-radius", "drawing-length", "joint-order", "joint-sign", "angle-unit", "row-shift", "row-order",
    "target-frame", "wrong-reflector", "direction-sign", "temperature-unit", "payload-unit", "time-unit",
    "noise-implausible", "base-reflectors", "stray-value",
]  # fmt: skip
