"""For a row that cannot be sent: the last place on the way to it where the machine still works."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ptt.correct.newton import MISSED, ROUNDS
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.protocol import Mechanism
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.mechanisms.workspace import near_singular, translation_rank, travel_margin

HALVINGS = 20  # of the way: a metre to a micrometre

Nearest = Callable[[Tensor], tuple[Tensor, Tensor]] | None


@dataclass(frozen=True)
class Ways:
    """Straight ways from targets that are sent to targets that are not, m rows.

    Attributes:
        mechanism: the nominal one.
        begin: where they begin, (m, 3) mm.
        goal: where they lead, (m, 3) mm.
        near: joint values at the beginning, (m, k).
        share: how much of each the drawing can go, (m, 1).
    """

    mechanism: Mechanism
    begin: Tensor
    goal: Tensor
    near: Tensor
    share: Tensor

    def places(self, spare: float) -> tuple[Tensor, Tensor]:
        """The last places that work.

        Args:
            spare: share that is left unused, so that a correction does not lead beyond the edge again.

        Returns:
            Places (m, 3) mm, and their joint values by the drawing, (m, k), NaN where not even the beginning works.
        """
        place = self.begin + (1.0 - spare) * self.share * (self.goal - self.begin)
        q = _inverse(self.mechanism, place, self.near)
        return place, torch.where(_works(self.mechanism, place, q)[:, None], q, torch.nan)


def nearest_of(wanted: Tensor, nominal: Tensor, sent: np.ndarray) -> Nearest:
    """Who knows the place that is sent nearest to another.

    Args:
        wanted: targets, (n, 3) mm.
        nominal: their joint values by the drawing, (n, k).
        sent: (n,) bool.

    Returns:
        Places (m, 3) mm -> the nearest ones, (m, 3) mm, and their joint values, (m, k); None where no target is sent.
    """
    if not sent.any():
        return None
    from scipy.spatial import cKDTree

    rows, tree = np.flatnonzero(sent), cKDTree(wanted[sent].numpy())

    def nearest(goal: Tensor) -> tuple[Tensor, Tensor]:
        index = rows[tree.query(goal.numpy())[1]]
        return wanted[index], nominal[index]

    return nearest


def find_ways(mechanism: Mechanism, goal: Tensor, nearest: Nearest) -> Ways:
    """Find how far the drawing can go from the nearest target that is sent toward each that is not.

    Where no target is sent, the ways begin at the home pose.

    Args:
        mechanism: the nominal one.
        goal: those that are not sent, (m, 3) mm.
        nearest: from places to those that are sent nearest, and their joint values; None where there are none.

    Returns:
        The ways.
    """
    if nearest is not None:
        begin, near = nearest(goal)
    else:
        near = torch.as_tensor(mechanism.home(), dtype=torch.float64).expand(len(goal), -1)
        begin = mechanism.forward(near)
    least, most = torch.zeros(len(goal), 1, dtype=torch.float64), torch.ones(len(goal), 1, dtype=torch.float64)
    for _ in range(HALVINGS):
        middle = 0.5 * (least + most)
        place = begin + middle * (goal - begin)
        good = _works(mechanism, place, _inverse(mechanism, place, near))[:, None]
        least, most = torch.where(good, middle, least), torch.where(good, most, middle)
    return Ways(mechanism, begin, goal, near, least)


def _works(mechanism: Mechanism, place: Tensor, q: Tensor) -> Tensor:
    """Whether the drawing reaches places within travel and away from singularities, (m,) bool."""
    return torch.isfinite(q).all(dim=1) & (travel_margin(mechanism, q) >= 0.0) & ~near_singular(mechanism, place, q)


def _inverse(mechanism: Mechanism, place: Tensor, near: Tensor) -> Tensor:
    """Joint values by the drawing; an arm goes on in the posture that it has, by Newton steps."""
    if isinstance(mechanism, ThreePtt):
        return mechanism.inverse(place, None, near)
    q = near
    for _ in range(ROUNDS):
        q = q + least_move(mechanism.jacobian(q), place - mechanism.forward(q), translation_rank(mechanism))
    there = (place - mechanism.forward(q)).norm(dim=1) < MISSED
    return torch.where(there[:, None], q, torch.nan)
