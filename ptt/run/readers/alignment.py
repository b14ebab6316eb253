"""Sequence alignment of readings and targets whose names repeat (longest common subsequence)."""

import numpy as np

from ptt.errors import TableError

CYCLES = 1.2  # readings per target from which the list may have been repeated, not only some readings
MOST_CELLS = 100_000_000  # readings times targets: 200 MB


def align_names(names: np.ndarray, wanted: np.ndarray, place: np.ndarray, where: str) -> tuple[np.ndarray, np.ndarray]:
    """The target of each reading, where all longest alignments that keep both orders agree on it.

    A missed or repeated reading therefore does not shift those after it.

    Args:
        names: (n,) int, name of each reading in their order, -1 for one that is not listed.
        wanted: (m,) int, name of each target in their order.
        place: (m,) int, equal for consecutive targets at one position: which of them is meant makes no difference.
        where: file, for messages.

    Returns:
        (n,) int, -1 where there is no target; and whether it is ambiguous, (n,) bool.

    Raises:
        TableError: too many to compare.
    """
    cycles = -(-len(names) // len(wanted)) if len(names) > CYCLES * len(wanted) else 1  # the last may be broken off
    if len(names) * len(wanted) * cycles > MOST_CELLS:
        raise TableError(
            f"{len(names)} readings of {len(wanted)} targets, some names not as often as listed",
            where=where,
            fix="give each target a name of its own, or the export in parts",
        )
    tried = [_aligned(names, wanted, place, count) for count in dict.fromkeys((1, cycles))]
    return min(tried, key=lambda found: int((found[0] < 0).sum()))


def _aligned(names: np.ndarray, wanted: np.ndarray, place: np.ndarray, cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """Alignment with a list that was repeated `cycles` times."""
    first, last = _ends(names, np.tile(wanted, cycles))
    stretch = (place + np.arange(cycles)[:, None] * (place.max() + 1)).ravel()
    found = first <= last
    open_ = found & (stretch[first % len(stretch)] != stretch[last])
    target, before = np.full(len(names), -1), -1
    for row in np.flatnonzero(found & ~open_):
        beside = before >= 0 and stretch[before] == stretch[first[row]]
        before = max(first[row], min(last[row], before + 1)) if beside else first[row]
        target[row] = before
    return np.where(target < 0, -1, target % len(wanted)), open_


def _ends(names: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last target of each reading, (n,) int, over all longest common subsequences; last before first if none.

    An interrupted run has no reading of the last targets: only the fewest that give the full length are used.

    Source: Hirschberg, Comm. ACM 18 (1975) 341: a pair is in one if the lengths before and after it add up.
    """
    whole = np.zeros(len(wanted) + 1, dtype=np.int16 if len(wanted) < 2**15 else np.int32)
    for name in names:
        whole = _longer(whole, wanted == name)
    most = whole[-1]
    wanted = wanted[: int(np.argmax(whole == most))]
    behind = np.zeros((len(names) + 1, len(wanted) + 1), dtype=whole.dtype)
    for row in range(len(names) - 1, -1, -1):
        behind[row] = _longer(behind[row + 1][::-1], (wanted == names[row])[::-1])[::-1]
    before = np.zeros(len(wanted) + 1, dtype=whole.dtype)
    first, last = np.full(len(names), len(wanted)), np.full(len(names), -1)
    for row, name in enumerate(names):
        same = wanted == name
        may = np.flatnonzero(same & (before[:-1] + 1 + behind[row + 1, 1:] == most))
        if len(may):
            first[row], last[row] = may[0], may[-1]
        before = _longer(before, same)
    return first, last


def _longer(length: np.ndarray, same: np.ndarray) -> np.ndarray:
    """Lengths of the longest common subsequences with the first j targets, (m + 1,), after one more reading."""
    grown = length.copy()
    grown[1:] = np.maximum(length[1:], length[:-1] + same)
    return np.asarray(np.maximum.accumulate(grown))
