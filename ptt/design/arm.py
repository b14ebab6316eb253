"""Poses of an arm that tell most of its geometry."""

import numpy as np
import torch

from ptt.design.foresight import beside, columns_of, see_plan
from ptt.design.space import Space, draw_poses
from ptt.design.visits import single, table_of
from ptt.effects import Library
from ptt.model import Model

CHOICE = 8  # poses among which each one is chosen


def telling_poses(
    model: Model, space: Space, count: int, random: np.random.Generator, known: Library, sigma: float
) -> torch.Tensor:
    """D-optimal poses of an arm for its geometry, greedily from many that the limits allow.

    Source: Fedorov, Theory of Optimal Experiments (1972); one pose adds log det(1 + X M^-1 X^T) to log det M.

    Args:
        model: the arm.
        space: where it can go.
        count: how many poses.
        random: of the candidates.
        known: effects by name.
        sigma: noise of one coordinate, mm.

    Returns:
        (count, k) rad.
    """
    effect = known.get("dh-offsets")
    poses = draw_poses(space, CHOICE * count, random)
    if effect is None or "dh-offsets" in model.keys:
        return poses[:count]
    table = table_of([single(pose, "v") for pose in poses], space, straight=False)
    view, _ = see_plan(model, table)
    every = np.ones(view.rows, dtype=bool)
    usual = np.array([p.usual for p in effect.parameters for _ in range(p.size(space.joints))])
    own = columns_of(model, effect(), view, sigma) * usual
    nuisance = beside(model, view, every, sigma)
    whole = np.concatenate([own, nuisance[: 3 * view.rows].reshape(view.rows, 3, -1)], axis=-1)
    spread = np.eye(whole.shape[-1])  # inverse information, one usual size known of each
    chosen: list[int] = []
    for _ in range(count):
        inner = np.eye(3) + whole @ spread @ whole.transpose(0, 2, 1)
        worth = np.linalg.slogdet(inner)[1]
        worth[chosen] = -np.inf
        best = int(np.argmax(worth))
        chosen.append(best)
        side = spread @ whole[best].T
        spread = spread - side @ np.linalg.solve(inner[best], side.T)
    return poses[chosen]
