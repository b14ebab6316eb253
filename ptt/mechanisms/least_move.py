"""The joint step of least norm for a step of the tool: the pseudoinverse of the Jacobian."""

import torch
from torch import Tensor


def least_move(jacobian: Tensor, step: Tensor, rank: int) -> Tensor:
    """Moore-Penrose solution of (dp/dq) dq = step; NaN where the Jacobian is singular or not a number.

    Of a redundant arm it is the smallest joint step; where the joints cannot make the whole of a step (fewer than three
    of them, or a planar arm) it makes the part that they can, by least squares.

    Args:
        jacobian: dp/dq, (n, 3, k) mm per mm or rad.
        step: (n, 3) mm.
        rank: of the Jacobian at a general pose (`ptt.mechanisms.workspace.translation_rank`); smaller singular values
            than the first `rank` are rounding.

    Returns:
        dq: (n, k) mm or rad.
    """
    if rank < min(jacobian.shape[1:]):  # truncated singular value decomposition
        known, move = jacobian.isfinite().all(dim=-1).all(dim=-1), torch.full_like(jacobian[..., 0, :], torch.nan)
        left, size, right = torch.linalg.svd(jacobian[known], full_matrices=False)
        size = torch.where(size[..., :rank] > 0.0, size[..., :rank], torch.nan)
        along = (left[..., :rank].mT @ step[known][..., None])[..., 0] / size
        move[known] = (right[..., :rank, :].mT @ along[..., None])[..., 0]
        return move
    if jacobian.shape[-1] == step.shape[-1]:
        return _solved(jacobian, step)
    transposed = jacobian.mT
    if jacobian.shape[-1] > step.shape[-1]:
        return (transposed @ _solved(jacobian @ transposed, step)[..., None])[..., 0]
    return _solved(transposed @ jacobian, (transposed @ step[..., None])[..., 0])


def _solved(matrix: Tensor, right: Tensor) -> Tensor:
    """Solutions (n, m) of square systems (n, m, m), NaN where the matrix is singular."""
    found, failed = torch.linalg.solve_ex(matrix, right[..., None])
    return torch.where(failed[..., None] == 0, found[..., 0], torch.nan)
