"""Commands ahead of axes that lag: what follows their velocity is moved as well when they are.

An axis at q - T D q, where D takes commands to velocities, is moved by dq with (I - T D) dq. D is linear once the pace
of the travel is fixed (`ptt.run.pace`), and nearly skew but for corners after moves that outlast usual lags: the system
can be solved where the lag is as long as the time between two rows. Steps that leave D out would not settle there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ptt.run.pace import Pace
from ptt.run.slopes import Shares

NUDGE = 1.0 + 1e-6  # of the lag: where it is just as long as a move to a stop, no command of that row moves the axis


@dataclass(frozen=True)
class Lead:
    """Moves of lagging axes.

    Attributes:
        solvers: of each joint; None where it does not lag.
        moved: rows that may move, (n,) float: 1 or 0.
    """

    solvers: tuple[Callable[[np.ndarray], np.ndarray] | None, ...]
    moved: np.ndarray

    def __call__(self, move: Tensor) -> Tensor:
        """Moves of commands that move the axes.

        Args:
            move: of the axes, (n, k); what is not a number is left out.

        Returns:
            Of the commands, (n, k).
        """
        wanted, found = move.numpy(), move.numpy().copy()
        for joint, solve in enumerate(self.solvers):
            if solve is not None:
                found[:, joint] = solve(np.nan_to_num(wanted[:, joint]) * self.moved)
        return torch.as_tensor(np.where(np.isfinite(wanted), found, wanted))


def lead_of(pace: Pace, lag: np.ndarray, hold: np.ndarray, moved: np.ndarray) -> Lead:
    """Factor the system of each joint.

    Args:
        pace: of the travel, n rows.
        lag: of each joint, (k,) s.
        hold: which row's command holds at each row, (n,) int.
        moved: rows that may move, (n,) bool.

    Returns:
        The moves.
    """
    free = moved.astype(float)
    known = {value: _solver(pace, value, hold, free) for value in set(lag.tolist()) if value}
    return Lead(tuple(known.get(value) for value in lag.tolist()), free)


def _solver(pace: Pace, lag: float, hold: np.ndarray, free: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Solve x - T (S H x + m) = r together with B m = R H x: straight stretches S, slopes m of the splines, H held."""
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
    """Sums of weighted slopes as a matrix on joint values, (sums, n)."""
    from scipy import sparse

    row, interval, weight = shares
    rate = weight / lasts[interval]
    places = np.concatenate([row, row]), np.concatenate([interval + 1, interval])
    return sparse.csr_matrix((np.concatenate([rate, -rate]), places), shape=(sums, len(lasts) + 1))
