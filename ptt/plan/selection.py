"""D-optimal selection of candidate poses by greedy choice and Fedorov exchange."""

import numpy as np

SWEEPS = 4  # rounds of exchange, at most
GAIN = 1e-9  # least growth of log det for an exchange


def select_poses(columns: np.ndarray, count: int) -> np.ndarray:
    """Choose poses that maximise det(1 + sum X^T X), by greedy choice and pairwise exchanges.

    The 1 is a prior standard deviation of one usual size for each parameter.

    Source: Fedorov, Theory of Optimal Experiments (1972); one pose adds log det(1 + X M^-1 X^T) to log det M.

    Args:
        columns: (n, 3, P) derivative of each candidate's reading by the parameters, in usual sizes and units of noise.
        count: how many to choose.

    Returns:
        (count,) int, candidates in the order of their choice; all of them where there are not more.
    """
    if count >= len(columns):
        return np.arange(len(columns))
    before = np.eye(columns.shape[-1])
    spread = before  # inverse of the information matrix
    chosen: list[int] = []
    for _ in range(count):
        best, _ = _best(columns, spread, chosen)
        chosen.append(best)
        spread = _updated(spread, columns[best], 1.0)
    for _ in range(SWEEPS):
        if not _exchange(columns, spread, chosen):
            break
        spread = np.linalg.inv(before + np.einsum("nip,niq->pq", columns[chosen], columns[chosen]))
    return np.array(chosen)


def _exchange(columns: np.ndarray, spread: np.ndarray, chosen: list[int]) -> bool:
    """One sweep: each chosen pose gives way to a better one; the list changes in place. True where any did."""
    changed = False
    for place, old in enumerate(list(chosen)):
        without = _updated(spread, columns[old], -1.0)
        rest = chosen[:place] + chosen[place + 1 :]
        best, worth = _best(columns, without, rest)
        if best != old and worth > _worth(columns[old : old + 1], without)[0] + GAIN:
            chosen[place], changed = best, True
            spread = _updated(without, columns[best], 1.0)
    return changed


def _best(columns: np.ndarray, spread: np.ndarray, chosen: list[int]) -> tuple[int, float]:
    worth = _worth(columns, spread)
    worth[chosen] = -np.inf
    best = int(np.argmax(worth))
    return best, float(worth[best])


def _worth(columns: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """What each candidate adds to log det, (n,)."""
    inner = np.eye(3) + (columns @ spread) @ columns.transpose(0, 2, 1)
    return np.asarray(np.linalg.slogdet(inner)[1])


def _updated(spread: np.ndarray, rows: np.ndarray, sign: float) -> np.ndarray:
    """Inverse information with a pose's rows (3, P) added (+1) or taken away (-1): Woodbury's identity."""
    side = spread @ rows.T
    return np.asarray(spread - sign * side @ np.linalg.solve(np.eye(3) + sign * rows @ side, side.T))
