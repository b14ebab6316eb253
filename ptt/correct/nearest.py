"""For a target that cannot be sent: the last position on the line to it that the machine can still reach."""

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

HALVINGS = 20  # bisections of a line: a metre to a micrometre

Nearest = Callable[[Tensor], tuple[Tensor, Tensor]] | None


@dataclass(frozen=True)
class Lines:
    """Straight lines from targets that are sent to targets that are not, m rows.

    Attributes:
        mechanism: the nominal mechanism.
        begin: their beginnings, (m, 3) mm.
        goal: their ends, (m, 3) mm.
        near: joint values at the beginnings, (m, k).
        share: share of each line that the drawing can go, (m, 1).
    """

    mechanism: Mechanism
    begin: Tensor
    goal: Tensor
    near: Tensor
    share: Tensor

    def last_positions(self, spare: float) -> tuple[Tensor, Tensor]:
        """The last positions that the drawing reaches, with a margin.

        Args:
            spare: margin as a share of `share`, so that the correction does not lead beyond the edge again.

        Returns:
            Positions (m, 3) mm, and their joint values by the drawing, (m, k), NaN where not even the beginning works.
        """
        place = self.begin + (1.0 - spare) * self.share * (self.goal - self.begin)
        q = _inverse(self.mechanism, place, self.near)
        return place, torch.where(_works(self.mechanism, place, q)[:, None], q, torch.nan)


def nearest_of(wanted: Tensor, nominal: Tensor, sent: np.ndarray) -> Nearest:
    """Nearest-neighbour search among the targets that are sent.

    Args:
        wanted: targets, (n, 3) mm.
        nominal: their joint values by the drawing, (n, k).
        sent: (n,) bool.

    Returns:
        Positions (m, 3) mm -> the nearest targets that are sent, (m, 3) mm, and their joint values, (m, k); None where
        no target is sent.
    """
    if not sent.any():
        return None
    from scipy.spatial import cKDTree

    rows, tree = np.flatnonzero(sent), cKDTree(wanted[sent].numpy())

    def nearest(goal: Tensor) -> tuple[Tensor, Tensor]:
        index = rows[tree.query(goal.numpy())[1]]
        return wanted[index], nominal[index]

    return nearest


def find_lines(mechanism: Mechanism, goal: Tensor, nearest: Nearest) -> Lines:
    """Find by bisection how far the drawing can go from the nearest target that is sent toward each that is not.

    Where no target is sent, the lines begin at the home pose.

    Args:
        mechanism: the nominal mechanism.
        goal: targets that are not sent, (m, 3) mm.
        nearest: positions -> the nearest targets that are sent, and their joint values; None where none is sent.

    Returns:
        The lines.
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
    return Lines(mechanism, begin, goal, near, least)


def _works(mechanism: Mechanism, place: Tensor, q: Tensor) -> Tensor:
    """Whether the drawing reaches positions within travel and away from singularities, (m,) bool."""
    return torch.isfinite(q).all(dim=1) & (travel_margin(mechanism, q) >= 0.0) & ~near_singular(mechanism, place, q)


def _inverse(mechanism: Mechanism, place: Tensor, near: Tensor) -> Tensor:
    """Joint values by the drawing; an arm keeps its posture, by Newton steps from `near`."""
    if isinstance(mechanism, ThreePtt):
        return mechanism.inverse(place, None, near)
    q = near
    for _ in range(ROUNDS):
        q = q + least_move(mechanism.jacobian(q), place - mechanism.forward(q), translation_rank(mechanism))
    there = (place - mechanism.forward(q)).norm(dim=1) < MISSED
    return torch.where(there[:, None], q, torch.nan)
