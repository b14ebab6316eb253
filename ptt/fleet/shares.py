"""Sums over a log at given values of the unknowns: mapped over its parts, here or on workers, and added in a tree.

No process holds all rows: a worker has one part at a time; the process that asks holds the state before each part, and
which rows are gross errors.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any

import numpy as np

from ptt.fitting.layout import Layout
from ptt.fitting.outliers import MOST_EXCEPTIONS, limit_of
from ptt.fitting.prior import design_effect_of_sums
from ptt.fitting.whitened import Total, add_totals, build_whitened
from ptt.fleet.log import Log, LogState, Part, enter_part, hand_on, read_part
from ptt.progress import Progress, unwatched
from ptt.run.noise import Noise
from ptt.run.same_pose import SAME_POSE
from ptt.run.tails import chi2_ppf

# Logarithms of the bin edges of the histogram of squared distances, from which quantiles are read to one per cent.
LOG_EDGES = np.linspace(np.log(1e-9), np.log(1e12), 5000)
# Poses are hashed into buckets by the cell of space that they lie in: no part knows the poses of the others. Cells are
# wide enough that edges cut few poses in two, which takes less than a tenth off the design effect, and are offset so
# that no edge lies on a target that is written to the micron or a tenth of it, where rounding would decide.
BUCKETS = 2**12
CELL = 10.0 * SAME_POSE  # mm
CELL_OFFSET = 0.345  # of a cell
MOST_GROSS_SHARE = 0.02  # of a part's rows that may be gross errors; where more lie far off, machine or model is wrong


@dataclass(frozen=True)
class Share:
    """Sums over one part of a log, or several together, at given values of the unknowns.

    Attributes:
        total: normal equations of the rows that are fitted.
        far: histogram of the rows' squared whitened distances over `LOG_EDGES`, (5000,), gross errors included.
        poses: for each bucket of poses the summed whitened residual x, y, z, its summed squares, and the number of
            rows, (BUCKETS, 5).
        square: sum of squared residuals of the fitted rows by axis, (3,) mm^2.
        rows: number of fitted rows.
        distant: rows that may be gross errors, (m,) int from 0 in the whole log, and their squared distances (m,).
    """

    total: Total
    far: np.ndarray
    poses: np.ndarray
    square: np.ndarray
    rows: int
    distant: tuple[np.ndarray, np.ndarray]

    @property
    def design_effect(self) -> float:
        """By how much correlated errors at a pose inflate variances, as `ptt.fitting.prior.design_effect_of`."""
        return design_effect_of_sums(self.poses[:, :3], float(self.poses[:, 3].sum()), self.poses[:, 4])

    @property
    def sifted(self) -> np.ndarray:
        """Gross errors: rows beyond a limit set by two quantiles of all distances, (m,) int in rising order.

        The quantiles are the median and 1 - `MOST_EXCEPTIONS`. In a run, other visits of a pose and neighbouring rows
        are consulted too; here no process has them, and `MOST_GROSS_SHARE` keeps many rows of a part from being left
        out.
        """
        shares = np.cumsum(self.far) / max(self.far.sum(), 1)
        places = [(part, int(np.searchsorted(shares, part))) for part in (1.0 - MOST_EXCEPTIONS, 0.5)]
        wide = [float(np.exp(LOG_EDGES[place])) / float(chi2_ppf(part, 3)) for part, place in places]
        rows, squared = self.distant
        return np.sort(rows[squared > limit_of(max(1.0, *wide), int(self.far.sum()))])


class Passes:
    """Passes over a log, in this process or by the workers of a dask cluster: the `Rows` that `settle` fits to.

    A choice of rows is here those that are left out, (m,) int in rising order. The last pass is kept.
    """

    def __init__(
        self, log: Log, layout: Layout, noise: Noise, client: Any = None, tell: Progress | None = None
    ) -> None:
        self.log, self.layout, self.noise, self.client, self.count = log, layout, noise, client, 0
        self._tell = tell or unwatched
        self.states = self._states()
        self._last: tuple[np.ndarray, np.ndarray, Share] | None = None

    def _states(self) -> list[Any]:
        """The state before each part, None for the first: parts are read in parallel, states computed in sequence."""
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
        """The sums of all parts at the unknowns (u,), without the rows `out`, (m,) int in rising order."""
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
        for number, future in enumerate(done):  # without a reference here a share is freed as soon as it is added
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
    """Sums over one part.

    Args:
        log: the log.
        layout: of the unknowns.
        whitener: (3, 3) 1/mm.
        unknowns: (u,) in units of their usual sizes.
        part: its rows.
        state: the state before it; None for the first part.
        out: gross errors among its rows, (m,) int from 0 in the whole log.

    Returns:
        The sums.
    """
    problem = enter_part(read_part(log, part), part, state)
    system = build_whitened(layout, problem, whitener, unknowns)
    squared = np.einsum("nc,nc->n", system.residual, system.residual)
    used = problem.used & np.isfinite(squared)
    kept = used.copy()
    kept[out - part[0]] = False
    far, _ = np.histogram(np.log(np.maximum(squared[used], 1e-8)), LOG_EDGES)
    left = system.residual[kept]
    bucket = buckets_of(problem.target[kept])
    summed = (*left.T, squared[kept], np.ones(len(left)))
    poses = np.stack([np.bincount(bucket, column, BUCKETS) for column in summed], axis=1)
    most = np.flatnonzero(used)[np.argsort(squared[used])[::-1][: int(MOST_GROSS_SHARE * len(kept)) + 1]]
    most = most[squared[most] > limit_of(1.0, log.rows)]
    square = np.square(left @ np.linalg.inv(whitener).T).sum(axis=0)
    distant = most + part[0], squared[most]
    return Share(system.sums(kept), np.append(far, 0), poses, square, int(kept.sum()), distant)


def buckets_of(place: np.ndarray) -> np.ndarray:
    """Hash positions into buckets by the cell they lie in, so that poses which share a bucket are unrelated.

    Args:
        place: (n, 3) mm.

    Returns:
        (n,) int, 0 to `BUCKETS` - 1.
    """
    whole = np.floor(place / CELL - CELL_OFFSET).astype(np.int64).astype(np.uint64)
    mixed = whole @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
    return (mixed >> np.uint64(64 - (BUCKETS.bit_length() - 1))).astype(int)  # the highest bits are mixed best


def add_shares(one: Share, other: Share) -> Share:
    """The sums of two shares."""
    distant = np.append(one.distant[0], other.distant[0]), np.append(one.distant[1], other.distant[1])
    return Share(
        add_totals(one.total, other.total), one.far + other.far, one.poses + other.poses, one.square + other.square,
        one.rows + other.rows, distant,
    )  # fmt: skip
