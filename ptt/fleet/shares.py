"""What the parts of a log say at a point: sums that are mapped over the parts, here or on workers, and added in a tree.

Nothing that grows with the log is held at once by anybody: a worker has one part; the process that asks has how each
part is entered, and which of its rows are gross errors.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any

import numpy as np

from ptt.fitting.layout import Layout
from ptt.fitting.long import add_totals
from ptt.fitting.outliers import MOST_EXCEPTIONS, limit_of
from ptt.fitting.prior import design_effect_of_sums
from ptt.fitting.whitened import Total, build_whitened
from ptt.fleet.log import Log, LogState, Part, enter_part, hand_on, read_part
from ptt.progress import Progress, unwatched
from ptt.run.noise import Noise
from ptt.run.same_pose import SAME_POSE
from ptt.run.tails import chi2_ppf

EDGES = np.linspace(np.log(1e-9), np.log(1e12), 5000)  # of squared distances: a quantile to one in a hundred
POSES = 2**12  # drawers that poses are sorted into, by cells: no part knows which rows of another are of the same pose
CELL = 10.0 * SAME_POSE  # mm: poses as wide as may be are cut by so few edges that their rows crowd by a tenth less
EDGE = 0.345  # of a cell, where it begins: no target that is written to the micron or a tenth of it is cut by rounding
MOST_GROSS_SHARE = 0.02  # of a part's rows; more is the machine or the model


@dataclass(frozen=True)
class Share:
    """What one part, or several together, say at a point.

    Attributes:
        total: normal equations of the rows that count.
        far: (5000,) how many rows lie how far off, by `EDGES`.
        poses: (POSES, 5) summed residual of the rows in each drawer in units of noise, their squares, how many there
            are.
        square: (3,) mm^2 summed over the rows that count.
        rows: that count.
        distant: rows that lie far, (m,) int of the whole log, and their squared distances.
    """

    total: Total
    far: np.ndarray
    poses: np.ndarray
    square: np.ndarray
    rows: int
    distant: tuple[np.ndarray, np.ndarray]

    @property
    def design_effect(self) -> float:
        """How many rows say the same as one row, as `ptt.fitting.prior.design_effect_of` tells."""
        return design_effect_of_sums(self.poses[:, :3], float(self.poses[:, 3].sum()), self.poses[:, 4])

    @property
    def sifted(self) -> np.ndarray:
        """Gross errors, rows beyond the limit that eleven in twelve and their median set, (m,) int in rising order.

        Nobody holds all rows, so neither other visits of a pose nor rows before and after are asked, as they are of a
        run: `MOST_GROSS_SHARE` keeps what many rows of a part have from being left out.
        """
        shares = np.cumsum(self.far) / max(self.far.sum(), 1)
        places = [(part, int(np.searchsorted(shares, part))) for part in (1.0 - MOST_EXCEPTIONS, 0.5)]
        wide = [float(np.exp(EDGES[place])) / float(chi2_ppf(part, 3)) for part, place in places]
        rows, squared = self.distant
        return np.sort(rows[squared > limit_of(max(1.0, *wide), int(self.far.sum()))])


class Passes:
    """Passes over a log: in this process, or by the workers of a dask cluster; the last one is remembered.

    A choice of its rows is (m,) int in rising order, rows that are left out.
    """

    def __init__(
        self, log: Log, layout: Layout, noise: Noise, client: Any = None, tell: Progress | None = None
    ) -> None:
        self.log, self.layout, self.noise, self.client, self.count = log, layout, noise, client, 0
        self._tell = tell or unwatched
        self.states = self._states()
        self._last: tuple[np.ndarray, np.ndarray, Share] | None = None

    def _states(self) -> list[Any]:
        """How each part is entered: read all at once, handed on one after the other."""
        states: list[Any] = [None]
        for number, part in enumerate(self.log.parts[:-1]):
            self._tell("how its parts are entered", number, len(self.log.parts))
            if self.client is None:
                states.append(hand_on(read_part(self.log, part), part, states[-1]))
            else:
                there = self.client.submit(read_part, self.log, part, pure=False)
                states.append(self.client.submit(hand_on, there, part, states[-1], pure=False))
        return states if self.client is None else [None, *self.client.gather(states[1:])]

    def __call__(self, unknowns: np.ndarray, out: np.ndarray) -> Share:
        """All parts at one point, the rows that are given left out."""
        if self._last is None or not all(map(np.array_equal, self._last[:2], (unknowns, out))):
            self._last = unknowns.copy(), out.copy(), self._pass_over(unknowns, out)
        return self._last[2]

    def _pass_over(self, unknowns: np.ndarray, out: np.ndarray) -> Share:
        self.count += 1
        gross = np.split(out, np.searchsorted(out, [first for first, _ in self.log.parts[1:]]))
        each = list(zip(self.log.parts, self.states, gross, strict=True))
        work = partial(share_of, self.log, self.layout, self.noise.whitener, unknowns)
        if self.client is None:
            return reduce(add_shares, (self._counted(number, work(*own)) for number, own in enumerate(each)))
        return self._on_workers(work, each)

    def _on_workers(self, work: Callable[..., Share], each: list[Any]) -> Share:
        from distributed import as_completed

        submit = self.client.submit
        shares = [submit(work, *own, pure=False) for own in each]
        done = as_completed(shares)
        while len(shares) > 1:
            pairs = [shares[place : place + 2] for place in range(0, len(shares), 2)]
            shares = [submit(add_shares, *pair, pure=False) if len(pair) == 2 else pair[0] for pair in pairs]
        for number, future in enumerate(done):  # a share is let go as soon as it is added
            self._counted(number, future)
            del future
        share: Share = shares[0].result()
        return share

    def _counted(self, number: int, share: Any) -> Any:
        self._tell(f"pass {self.count}", number + 1, len(self.log.parts))
        return share


def share_of(
    log: Log, layout: Layout, whitener: np.ndarray, unknowns: np.ndarray, part: Part, state: LogState | None,
    out: np.ndarray,
) -> Share:  # fmt: skip
    """What one part says at a point.

    Args:
        log: the log.
        layout: of the unknowns.
        whitener: (3, 3) 1/mm.
        unknowns: (u,) in usual sizes.
        part: its rows.
        state: how they are entered.
        out: gross errors among them, (m,) int of the whole log.

    Returns:
        Its share.
    """
    problem = enter_part(read_part(log, part), part, state)
    system = build_whitened(layout, problem, whitener, unknowns)
    squared = np.einsum("nc,nc->n", system.residual, system.residual)
    used = problem.used & np.isfinite(squared)
    kept = used.copy()
    kept[out - part[0]] = False
    far, _ = np.histogram(np.log(np.maximum(squared[used], 1e-8)), EDGES)
    left = system.residual[kept]
    drawer = drawers_of(problem.target[kept])
    summed = (*left.T, squared[kept], np.ones(len(left)))
    poses = np.stack([np.bincount(drawer, column, POSES) for column in summed], axis=1)
    most = np.flatnonzero(used)[np.argsort(squared[used])[::-1][: int(MOST_GROSS_SHARE * len(kept)) + 1]]
    most = most[squared[most] > limit_of(1.0, log.rows)]
    square = np.square(left @ np.linalg.inv(whitener).T).sum(axis=0)
    distant = most + part[0], squared[most]
    return Share(system.sums(kept), np.append(far, 0), poses, square, int(kept.sum()), distant)


def drawers_of(place: np.ndarray) -> np.ndarray:
    """Sort places into drawers: by chance, so that the sums of several poses in one are as of independent ones.

    Args:
        place: (n, 3) mm.

    Returns:
        (n,) int, less than `POSES`.
    """
    whole = np.floor(place / CELL - EDGE).astype(np.int64).astype(np.uint64)
    mixed = whole @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
    return (mixed >> np.uint64(64 - (POSES.bit_length() - 1))).astype(int)  # its highest bits, as many as tell drawers


def add_shares(one: Share, other: Share) -> Share:
    """The sums of two shares."""
    distant = np.append(one.distant[0], other.distant[0]), np.append(one.distant[1], other.distant[1])
    return Share(
        add_totals(one.total, other.total), one.far + other.far, one.poses + other.poses, one.square + other.square,
        one.rows + other.rows, distant,
    )  # fmt: skip
