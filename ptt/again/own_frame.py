"""The frame that errors of a run are stated in: a fitted one takes what it can, one that reflectors hold nothing."""

from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.fitting.factor import inverse
from ptt.fitting.layout import FRAME
from ptt.fitting.result import FitResult


@dataclass(frozen=True)
class OwnFrame:
    """What a run's own frames and mounts take of its m readings, all whitened; b of base reflectors hold the frames.

    Attributes:
        taken: (3 m, t) orthonormal basis of what they can take: frames that nothing holds, and mounts.
        held: (3 m, f) columns of the frames that base reflectors hold, in usual sizes; f = 0 where none do.
        by_base: (f, 3 b) by how much they follow what shows in the reflectors.
        from_base: (f,) how far from where the reflectors put them the readings are looked at.
        spread: (f, f) root of what the reflectors' own readings leave open of them.
    """

    taken: np.ndarray
    held: np.ndarray
    by_base: np.ndarray
    from_base: np.ndarray
    spread: np.ndarray

    def without(self, values: np.ndarray, on_base: np.ndarray) -> np.ndarray:
        """What something does to the readings in their frame.

        Args:
            values: (3 m,) or (3 m, c) what it does to them.
            on_base: (3 b,) or (3 b, c) the same of base reflectors, which a tracker's own errors move.

        Returns:
            The values less what frames and mounts take of them.
        """
        off = values - self.held @ (self.by_base @ on_base) if self.held.shape[1] else values
        return np.asarray(off - self.taken @ (self.taken.T @ off))

    def at_base(self, values: np.ndarray) -> np.ndarray:
        """Readings (3 m,) as they are looked at, moved to where base reflectors put the frames."""
        return np.asarray(values + self.held @ self.from_base)

    @property
    def doubt(self) -> np.ndarray:
        """How far the reflectors' own readings leave the readings open, (3 m, f)."""
        return np.asarray(self.held @ self.spread)


def own_frame_of(system: RowSystem, fitted: FitResult, own: np.ndarray, on_base: int) -> OwnFrame:
    """What a run's own frames and mounts take.

    Args:
        system: of the run.
        fitted: where it was linearised.
        own: columns of frames, then of mounts.
        on_base: readings of base reflectors, the first of the system's readings beside the rows.

    Returns:
        As above; frames that reflectors hold stand as `ptt.fitting.solve.residual_of` has them.
    """
    columns = system.columns[:, :, own].reshape(3 * len(system.rows), -1)
    frames = np.flatnonzero(fitted.layout.owner == FRAME) if on_base else np.zeros(0, dtype=int)
    count = len(frames)
    base = system.base_columns[:on_base, :, own[:count]].reshape(3 * on_base, count)
    open_ = inverse(base.T @ base + np.eye(count))  # reflectors in one line leave a turn about it open
    taken, _ = np.linalg.qr(columns[:, count:])
    return OwnFrame(taken, columns[:, :count], open_ @ base.T, fitted.unknowns[frames], np.linalg.cholesky(open_))
