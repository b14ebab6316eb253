"""For a row that cannot be sent: the last place on the way to it where the machine still works."""

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.workspace import near_singular, travel_margin

HALVINGS = 30  # of the way: a metre to a nanometre


def nearest_places(
    mechanism: Mechanism, wanted: Tensor, nominal: Tensor, sent: np.ndarray, spare: float
) -> tuple[Tensor, Tensor]:
    """The last places where the drawing works on straight ways from the nearest targets that are sent.

    Where no target is sent, the ways begin at the home pose.

    Args:
        mechanism: the nominal one.
        wanted: targets, (n, 3) mm.
        nominal: their joint values by the drawing, (n, k); NaN where there are none.
        sent: (n,) bool.
        spare: share of the way that is left unused, so that a correction does not lead beyond the edge again.

    Returns:
        Places (m, 3) mm for the m rows that are not sent, and their joint values by the drawing, (m, k), NaN where not
        even the beginning works.
    """
    goal = wanted[~sent]
    if sent.any():
        index = np.flatnonzero(sent)[cKDTree(wanted[sent].numpy()).query(goal.numpy())[1]]
        begin, near = wanted[index], nominal[index]
    else:
        near = torch.as_tensor(mechanism.home(), dtype=torch.float64).expand(len(goal), -1)
        begin = mechanism.forward(near)
    least, most = torch.zeros(len(goal), 1, dtype=torch.float64), torch.ones(len(goal), 1, dtype=torch.float64)
    for _ in range(HALVINGS):
        middle = 0.5 * (least + most)
        good = works(mechanism, begin + middle * (goal - begin), near)[:, None]
        least, most = torch.where(good, middle, least), torch.where(good, most, middle)
    place = begin + (1.0 - spare) * least * (goal - begin)
    q = mechanism.inverse(place, None, near)
    return place, torch.where(works(mechanism, place, near)[:, None], q, torch.nan)


def works(mechanism: Mechanism, place: Tensor, near: Tensor) -> Tensor:
    """Whether the drawing reaches places within travel and away from singularities.

    Args:
        mechanism: the nominal one.
        place: (m, 3) mm.
        near: (m, k), joint values to stay close to.

    Returns:
        (m,) bool.
    """
    q = mechanism.inverse(place, None, near)
    return torch.isfinite(q).all(dim=1) & (travel_margin(mechanism, q) >= 0.0) & ~near_singular(mechanism, place, q)
