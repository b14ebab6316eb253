"""Hints that positions are in another unit than mm, from their extent."""

import numpy as np

_FACTORS = {"metres": (1000.0, 0.25), "inches": (25.4, 0.05)}  # mm per unit, and tolerance of the ratio
_SUFFIX = {"metres": "m", "inches": "in", "micrometres": "um"}
LARGEST_IN_METRES = 5.0  # extent of a machine, m: a larger figure is not metres, the other one is micrometres


def scale_hint(target: np.ndarray, measured: np.ndarray, size_mm: float | None = None) -> str | None:
    """A suspicion on units from the extents of readings and targets, and the size of the machine.

    Args:
        target: (n, 3) mm, NaN where none.
        measured: (n, 3) mm, NaN where not observed.
        size_mm: size of the machine, mm, or None to compare readings with targets only.

    Returns:
        A sentence, or None where nothing is odd.
    """
    both = ~np.isnan(target).any(axis=1) & ~np.isnan(measured).any(axis=1)
    wanted, found = spread(target[both]), spread(measured[both])
    for unit, (factor, tolerance) in _FACTORS.items():
        for small, large, names in ((found, wanted, ("x_meas", "x_cmd")), (wanted, found, ("x_cmd", "x_meas"))):
            if small > 0.0 and abs(large / small / factor - 1.0) < tolerance:
                if unit == "metres" and small > LARGEST_IN_METRES:
                    return _sentence(names[1], large, "micrometres", f"{names[0]}, y, z spread over {small:.3g} mm")
                return _sentence(names[0], small, unit, f"{names[1]}, y, z spread over {large:.3g} mm")
    if size_mm is None:
        return None
    for values, name in ((target, "x_cmd"), (measured, "x_meas")):
        width = spread(values[~np.isnan(values).any(axis=1)])
        if 0.0 < width < 2e-3 * size_mm:
            return _sentence(name, width, "metres", f"the machine is {size_mm:.3g} mm in size")
    return None


def scale_fix(hint: str) -> str:
    """The way out of a hint: the column title that states the unit.

    Args:
        hint: a sentence of `scale_hint`.

    Returns:
        For instance 'rename the columns (x_meas_in)'.
    """
    title, unit = hint.split(",")[0], hint.split()[-1]
    return f"rename the columns ({title}_{_SUFFIX[unit]})"


def _sentence(title: str, width: float, unit: str, against: str) -> str:
    return f"{title}, y, z spread over {width:.3g} mm while {against}: this looks like {unit}"


def spread(points: np.ndarray) -> float:
    """Median distance from the median point, mm: the same in any frame, unmoved by wild readings; 0 for no points."""
    if len(points) < 2:
        return 0.0
    return float(np.median(np.hypot.reduce(points - np.median(points, axis=0), axis=1)))
