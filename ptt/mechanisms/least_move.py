"""The smallest move of the joints that takes the tool by a step."""

import torch
from torch import Tensor


def least_move(jacobian: Tensor, step: Tensor, ways: int = 3) -> Tensor:
    """Smallest joint move that takes the tool by a step; NaN where the Jacobian is singular or not a number.

    Args:
        jacobian: dp/dq, (n, 3, k).
        step: (n, 3) mm.
        ways: number of directions in which the joints can move the tool at all; by two of a step in all three a planar
            arm makes what lies in its plane.

    Returns:
        (n, k).
    """
    if ways < min(jacobian.shape[1:]):
        known, move = jacobian.isfinite().all(dim=-1).all(dim=-1), torch.full_like(jacobian[..., 0, :], torch.nan)
        left, size, right = torch.linalg.svd(jacobian[known], full_matrices=False)
        size = torch.where(size[..., :ways] > 0.0, size[..., :ways], torch.nan)
        along = (left[..., :ways].mT @ step[known][..., None])[..., 0] / size
        move[known] = (right[..., :ways, :].mT @ along[..., None])[..., 0]
        return move
    if jacobian.shape[-1] == step.shape[-1]:
        return torch.linalg.solve_ex(jacobian, step[..., None])[0][..., 0]
    across = jacobian.mT
    if jacobian.shape[-1] > step.shape[-1]:
        return (across @ torch.linalg.solve_ex(jacobian @ across, step[..., None])[0])[..., 0]
    return torch.linalg.solve_ex(across @ jacobian, across @ step[..., None])[0][..., 0]
