"""Commands that lead lagging axes: a step of all commands together, since a lag follows velocities between rows.

A lagging axis stands at x = q - T D q, T the lag and D the linear map from the commands of all rows to velocities, once
the pace of the travel is fixed (`ptt.run.pace`). A step dx of the axis needs dq = (I - T D)^-1 dx. D is nearly skew
(central differences) but for corners after moves that outlast usual lags, so the system is regular even where the lag
is as long as the time between two rows; Newton steps without D would not converge there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ptt.run.pace import Pace
from ptt.run.slopes import Shares

NUDGE = 1.0 + 1e-6  # times the lag: a lag exactly as long as the last move before a stop makes I - T D singular


@dataclass(frozen=True)
class Lead:
    """Steps of the axes -> steps of the commands that make them.

    Attributes:
        solvers: for each joint the solution of (I - T D) x = r; None where it does not lag.
        moved: 1 in rows whose commands may change, else 0, (n,).
    """

    solvers: tuple[Callable[[np.ndarray], np.ndarray] | None, ...]
    moved: np.ndarray

    def __call__(self, move: Tensor) -> Tensor:
        """Steps of the commands for steps of the axes.

        Args:
            move: steps of the axes, (n, k) mm or rad; where they are not numbers they count as zero.

        Returns:
            (n, k) mm or rad, not a number where `move` is none.
        """
        wanted, found = move.numpy(), move.numpy().copy()
        for joint, solve in enumerate(self.solvers):
            if solve is not None:
                found[:, joint] = solve(np.nan_to_num(wanted[:, joint]) * self.moved)
        return torch.as_tensor(np.where(np.isfinite(wanted), found, wanted))


def lead_of(pace: Pace, lag: np.ndarray, hold: np.ndarray, moved: np.ndarray) -> Lead:
    """Factor the sparse system of each joint.

    Args:
        pace: of the travel, n rows.
        lag: of each joint, (k,) s.
        hold: index of the row whose command holds at each row, (n,) int.
        moved: rows whose commands may change, (n,) bool.
    """
    free = moved.astype(float)
    known = {value: _solver(pace, value, hold, free) for value in set(lag.tolist()) if value}
    return Lead(tuple(known.get(value) for value in lag.tolist()), free)


def _solver(pace: Pace, lag: float, hold: np.ndarray, free: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Solver of x - T (S H x + P m) = r, B m = R H x: slopes of straight stretches S and of splines m, held rows H.

    S, P, B and R are `pace.straight`, `pace.part`, `pace.bands` and `pace.right` (`ptt.run.pace.Pace`).
    """
    from scipy import sparse
    from scipy.sparse.linalg import splu

    rows, slopes = len(hold), len(pace.owner)
    late = sparse.diags(lag * NUDGE * free)
    held = sparse.csr_matrix((np.ones(rows), (np.arange(rows), hold)), shape=(rows, rows))
    straight = _matrix(pace.straight, pace.lasts, rows) @ held
    blocks = [[sparse.identity(rows) - late @ straight]]
    if slopes:
        owned = sparse.csr_matrix((pace.part, (pace.owner, np.arange(slopes))), shape=(rows, slopes))
        band = sparse.dia_matrix((pace.bands, (1, 0, -1)), shape=(slopes, slopes))
        blocks = [[blocks[0][0], -late @ owned], [-_matrix(pace.right, pace.lasts, slopes) @ held, band]]
    factors: Any = splu(sparse.bmat(blocks, format="csc"))
    return lambda wanted: np.asarray(factors.solve(np.concatenate([wanted, np.zeros(slopes)]))[:rows])


def _matrix(shares: Shares, lasts: np.ndarray, sums: int) -> Any:
    """Weighted sums of slopes between rows, as a sparse matrix on joint values, (sums, n)."""
    from scipy import sparse

    row, interval, weight = shares
    rate = weight / lasts[interval]
    places = np.concatenate([row, row]), np.concatenate([interval + 1, interval])
    return sparse.csr_matrix((np.concatenate([rate, -rate]), places), shape=(sums, len(lasts) + 1))
