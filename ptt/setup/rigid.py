"""Many rigid motions at once: how far readings stay from places, wherever the tracker stands."""

import numpy as np

TRIM = 6.0  # times the median distance: rows beyond it are gross errors and pull nothing
ROUNDS = 3
TINY = 1e-9  # mm


def align_many(place: np.ndarray, reading: np.ndarray, free: bool = True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Best rigid motion of each case, gross errors left out.

    Source: Kabsch, Acta Cryst. A32 (1976) 922.

    Args:
        place: (h, n, 3) mm, NaN where unknown.
        reading: (h, n, 3) mm, NaN where unknown.
        free: whether the readings may lie in another frame than the places.

    Returns:
        R (h, 3, 3) and t (h, 3) mm with reading = R place + t, and (h, n) mm distances, NaN where unknown.
    """
    known = np.isfinite(place).all(axis=2) & np.isfinite(reading).all(axis=2)
    a, b = (np.where(known[..., None], points, 0.0) for points in (place, reading))
    kept, count = known, len(place)
    turn, shift = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    for _ in range(ROUNDS):
        if free:
            turn, shift = _motion(a, b, kept)
        distance = np.linalg.norm(b - np.einsum("hij,hnj->hni", turn, a) - shift[:, None], axis=2)
        distance = np.where(known, distance, np.nan)
        kept = known & (distance <= TRIM * middle(distance)[:, None] + TINY)
    return turn, shift, distance


def middle(distance: np.ndarray) -> np.ndarray:
    """Median of the known distances of each case, (h,) mm; 0 where none is known."""
    count = np.isfinite(distance).sum(axis=1)
    ordered = np.sort(distance, axis=1)  # NaN goes last
    return np.where(count > 0, ordered[np.arange(len(distance)), np.maximum(count - 1, 0) // 2], 0.0)


def rms(distance: np.ndarray, lost: np.ndarray, size: float | np.ndarray) -> np.ndarray:
    """Root mean square of distances, gross errors left out.

    Args:
        distance: (h, n) mm, NaN where unknown.
        lost: (h, n) bool, rows whose place should be known and is not: they count as wrong by the machine's size.
        size: mm, one or (h, 1).

    Returns:
        (h,) mm; NaN where no row is known.
    """
    filled = np.where(lost, size, distance)
    near = filled <= TRIM * middle(filled)[:, None] + TINY
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(np.where(near, filled**2, 0.0).sum(axis=1) / near.sum(axis=1)))


def _motion(a: np.ndarray, b: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    weight = kept / np.maximum(kept.sum(axis=1), 1)[:, None]
    middle_a, middle_b = np.einsum("hn,hni->hi", weight, a), np.einsum("hn,hni->hi", weight, b)
    product = np.einsum("hn,hni,hnj->hij", weight, b - middle_b[:, None], a - middle_a[:, None])
    left, _, right = np.linalg.svd(product)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    turn = left @ right
    return turn, middle_b - np.einsum("hij,hj->hi", turn, middle_a)
