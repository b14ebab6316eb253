"""How large the unknowns of a fit may be before the rows speak: learned from the rows, one size for each parameter."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ptt.fitting.evidence import NARROWEST, WIDEST, learn
from ptt.fitting.layout import Layout
from ptt.fitting.whitened import Total
from ptt.run.noise import Noise

FRAME = 1.0  # prior variance of frames and mounts, which stand near where they belong: their usual sizes are wide
TURNS = 4  # of learning sizes beside the scatter of the rows
SAME = 0.05  # change of a log variance below which the scatter counts as settled
PLENTY = 100.0  # degrees of freedom that a stated noise counts for at most: a model may miss more than noise
SEARCHED = 100.0  # prior variance of what is searched: ten usual sizes hold it where the rows see nothing of it


class Summed(Protocol):
    """A linearised problem, whole or in chunks."""

    def sums(self, kept: np.ndarray) -> Total:
        """J^T J, J^T r, r^T r and the number of coordinates of the rows that count."""
        ...


@dataclass(frozen=True)
class Prior:
    """Variances before the rows, and how much wider than stated the rows scatter.

    Attributes:
        variance: (u,) of each unknown, in usual sizes squared.
        scales: (g,) the same for each group of the layout.
        widening: variance of the rows over that of the noise that whitened them, at least one.
    """

    variance: np.ndarray
    scales: np.ndarray
    widening: float = 1.0

    @property
    def weight(self) -> np.ndarray:
        """What the prior adds to the diagonal of the normal equations, (u,)."""
        return self.widening / self.variance

    def sizes(self, layout: Layout) -> np.ndarray:
        """How large each unknown may be, (u,) in usual sizes: the usual size, more where the rows ask for it."""
        free = np.array([kind == "free" for kind in layout.kinds] + [False])[layout.group]
        return np.where(free, np.sqrt(np.maximum(self.variance, 1.0)), 1.0)


def usual_prior(layout: Layout) -> Prior:
    """The prior of a machine that nobody has measured.

    Args:
        layout: the unknowns.

    Returns:
        The prior.
    """
    return _prior(layout, np.array([SEARCHED if kind == "searched" else 1.0 for kind in layout.kinds]), 1.0)


def learn_prior(
    system: Summed, kept: np.ndarray, layout: Layout, unknowns: np.ndarray, noise: Noise, start: Prior
) -> Prior:
    """Learn how large each group of unknowns is, where a fit stands.

    Args:
        system: linearised there.
        kept: rows that count, (n,) bool.
        layout: the unknowns.
        unknowns: (u,) in usual sizes.
        noise: that whitened the rows.
        start: to start from.

    Returns:
        The prior.
    """
    if "free" not in layout.kinds:
        return start
    gram, slope, left, count = system.sums(kept)
    side = slope + gram @ unknowns  # of the readings, not of what is left of them
    square = left + float(unknowns @ (slope + side))
    fixed = np.array([kind != "free" for kind in layout.kinds])
    scales, wider = start.scales, start.widening
    for _ in range(TURNS):
        found = learn(
            gram / wider, side / wider, square / wider, count, layout.group,
            freedom=min(3.0 * noise.freedom, PLENTY), start=scales, wide=FRAME,
            floor=np.where(fixed, scales, NARROWEST), ceiling=np.where(fixed, scales, WIDEST),
        )  # fmt: skip
        before, wider, scales = wider, max(wider * found.phi, 1.0), np.where(fixed, scales, found.scales)
        if abs(np.log(wider / before)) < SAME:
            break
    return _prior(layout, scales, wider)


def _prior(layout: Layout, scales: np.ndarray, widening: float) -> Prior:
    return Prior(np.append(scales, FRAME)[layout.group], scales, widening)
