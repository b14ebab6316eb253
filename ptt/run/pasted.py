"""Lines of a file that was pasted after itself: after how many they come again."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

PASTED = 12  # rows that repeat in sequence to the last digit, impossible for real readings
TAKEN = "taken as repeats, but copies say nothing about the scatter of readings"
ONCE = f"{TAKEN}; all rows come again, so that they count once"


def taken_as(lines: Sequence[str]) -> str:
    """How copied rows are treated, in words.

    Args:
        lines: of a file, each as it is written.
    """
    return ONCE if period(pd.factorize(np.asarray(lines, dtype=object))[0]) < len(lines) else TAKEN


def period(lines: np.ndarray) -> int:
    """Period of a sequence that repeats as a whole.

    Args:
        lines: hash of each row, (n,) int.

    Returns:
        Number of rows of one period; n where there is none, or one shorter than PASTED.
    """
    rows = len(lines)
    if not (lines[1:] == lines[:1]).any():  # what comes again begins with its first row
        return rows
    for times in range(rows // max(len(np.unique(lines)), 1), 1, -1):
        once = rows // times
        if once * times == rows and (lines[once:] == lines[:-once]).all():
            return once if once >= PASTED else rows
    return rows
