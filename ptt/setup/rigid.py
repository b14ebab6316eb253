"""Rigid alignment of many point sets at once, robust against gross errors."""

import numpy as np

TRIM = 6.0  # times the median distance: rows beyond it are gross errors and are left out
ROUNDS = 3  # of alignment and trimming; more rarely change which rows are left out
TINY = 1e-9  # mm: where half the points fit exactly the median is zero


def align_many(place: np.ndarray, reading: np.ndarray, free: bool = True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Best rigid motion of each case, gross errors left out.

    Source: Kabsch, Acta Cryst. A32 (1976) 922.

    Args:
        place: (h, n, 3) mm, NaN where unknown.
        reading: (h, n, 3) mm, NaN where unknown.
        free: whether the tracker frame is fitted; otherwise it is the base frame.

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
        left = b - a @ turn.transpose(0, 2, 1) - shift[:, None]
        distance = np.where(known, np.sqrt((left * left).sum(axis=2)), np.nan)
        last, kept = kept, known & _near(distance)
        if not free or (kept == last).all():
            break
    return turn, shift, distance


def middle(distance: np.ndarray) -> np.ndarray:
    """Lower median of the known distances (h, n) of each case, (h,) mm; 0 where none is known."""
    count = np.isfinite(distance).sum(axis=1)
    ordered = np.sort(distance, axis=1)  # NaN goes last
    return np.where(count > 0, ordered[np.arange(len(distance)), np.maximum(count - 1, 0) // 2], 0.0)


def column_medians(points: np.ndarray) -> np.ndarray:
    """Median of the known values of each column: (n, k) -> (k,); NaN where none is known."""
    ordered, count = np.sort(points, axis=0), np.isfinite(points).sum(axis=0)  # NaN goes last
    if not len(points):
        return np.full(points.shape[1:], np.nan)
    low, high = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, len(points) - 1)
    column = np.arange(points.shape[1])
    return np.asarray(0.5 * (ordered[low, column] + ordered[high, column]))


def rms(distance: np.ndarray, lost: np.ndarray, size: float | np.ndarray) -> np.ndarray:
    """Root mean square of distances, gross errors left out.

    Args:
        distance: (h, n) mm, NaN where unknown.
        lost: (h, n) bool, rows whose place cannot be computed (a command that does not close).
        size: mm, one or (h, 1): the distance that a lost row counts with.

    Returns:
        (h,) mm; NaN where no row is known.
    """
    filled = np.where(lost, size, distance)
    near = _near(filled)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(np.where(near, filled**2, 0.0).sum(axis=1) / near.sum(axis=1)))


def rms_of_parts(distance: np.ndarray, part: np.ndarray) -> float:
    """Root mean square distance, mm, without gross errors, which are judged within each part: a part has its own level.

    Args:
        distance: (m,) mm.
        part: (m,) int, of each row.
    """
    near = np.zeros(len(distance), dtype=bool)
    for each in np.unique(part):
        here = part == each
        near[here] = _near(distance[None, here])[0]
    return float(np.sqrt(np.mean(distance[near] ** 2)))


def _near(distance: np.ndarray) -> np.ndarray:
    """Distances (h, n) that are no gross errors within their case, (h, n) bool."""
    return np.asarray(distance <= TRIM * middle(distance)[:, None] + TINY)


def _motion(a: np.ndarray, b: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares R (h, 3, 3) and t (h, 3) with b = R a + t over the kept points (h, n, 3)."""
    weight = (kept / np.maximum(kept.sum(axis=1), 1)[:, None])[:, None]
    middle_a, middle_b = weight @ a, weight @ b
    product = ((b - middle_b).transpose(0, 2, 1) * weight) @ (a - middle_a)
    left, _, right = np.linalg.svd(product)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    turn = left @ right
    return turn, (middle_b - middle_a @ turn.transpose(0, 2, 1))[:, 0]


def rotate_rows(values: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Rows multiplied by a matrix, (n, 3); an empty (NaN) coordinate makes only those empty that depend on it.

    Args:
        values: (n, 3), NaN where empty.
        matrix: (3, 3).
    """
    turned = values @ matrix.T
    if np.isnan(values).any():
        for axis, weights in enumerate(matrix):
            part = np.flatnonzero(weights)
            turned[:, axis] = values[:, part] @ weights[part]
    return turned
