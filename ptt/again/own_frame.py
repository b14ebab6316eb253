"""The frame in which errors of a run are stated: fitted to the readings, or held by base reflectors."""

from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.fitting.factor import inverse
from ptt.fitting.layout import FRAME
from ptt.fitting.result import FitResult


@dataclass(frozen=True)
class OwnFrame:
    """A run's own frames and mounts, over m readings and b readings of base reflectors, all whitened.

    Attributes:
        taken: orthonormal basis of the shifts that are fitted to the readings, by mounts and by frames that base
            reflectors do not hold, (3 m, t).
        held: columns of the frames that base reflectors hold, (3 m, f) in usual sizes; f = 0 where none do.
        by_base: estimate of these frames from the reflectors' readings, (f, 3 b).
        from_base: their displacement at the linearisation from where the reflectors put them, (f,).
        spread: root of their covariance given the reflectors' readings, (f, f).
    """

    taken: np.ndarray
    held: np.ndarray
    by_base: np.ndarray
    from_base: np.ndarray
    spread: np.ndarray

    def without(self, values: np.ndarray, on_base: np.ndarray) -> np.ndarray:
        """Shifts of the readings after the frames and mounts have been fitted to them.

        Args:
            values: shifts of the readings, (3 m,) or (3 m, c).
            on_base: shifts of the base reflectors' readings by the same cause, which move the frames that these hold,
                (3 b,) or (3 b, c).

        Returns:
            The shifts less those of the frames and mounts, as `values`.
        """
        off = values - self.held @ (self.by_base @ on_base) if self.held.shape[1] else values
        return np.asarray(off - self.taken @ (self.taken.T @ off))

    def at_base(self, values: np.ndarray) -> np.ndarray:
        """Residuals at the linearisation, (3 m,), with the frames moved to where base reflectors put them."""
        return np.asarray(values + self.held @ self.from_base)

    @property
    def doubt(self) -> np.ndarray:
        """Root of the readings' covariance by the uncertainty of the held frames, (3 m, f)."""
        return np.asarray(self.held @ self.spread)


def own_frame_of(system: RowSystem, fitted: FitResult, own: np.ndarray, on_base: int) -> OwnFrame:
    """Set up the frames and mounts of a run.

    Args:
        system: of the run.
        fitted: where it was linearised.
        own: indices of the columns of frames, then of mounts.
        on_base: number of readings of base reflectors, the first of `system.base_columns`.

    Returns:
        The frames and mounts; those that reflectors hold are as `ptt.fitting.solve.residual_of` has them.
    """
    columns = system.columns[:, :, own].reshape(3 * len(system.rows), -1)
    frames = np.flatnonzero(fitted.layout.owner == FRAME) if on_base else np.zeros(0, dtype=int)
    count = len(frames)
    base = system.base_columns[:on_base, :, own[:count]].reshape(3 * on_base, count)
    open_ = inverse(
        base.T @ base + np.eye(count)
    )  # prior N(0, 1): collinear reflectors do not determine the turn about their line
    taken, _ = np.linalg.qr(columns[:, count:])
    return OwnFrame(taken, columns[:, :count], open_ @ base.T, fitted.unknowns[frames], np.linalg.cholesky(open_))
