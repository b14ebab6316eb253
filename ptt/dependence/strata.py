"""Independent rows from repeated poses: each row whitened for its pose's common error, or one mean for each pose."""

from dataclasses import dataclass

import numpy as np

from ptt.run.same_pose import number_rows
from ptt.run.tails import f_ppf

LARGEST_RATIO = 1e4  # bound of the variance ratio
SURELY = 0.99  # confidence of the lower bound of the common variance, of which the largest of all axes is taken
ENOUGH = 30  # degrees of freedom within poses, from which these tell slow error
LEAST_POSES = 12  # independent rows below which a variable is not tested

PERMUTATIONS = 128


@dataclass(frozen=True)
class RepeatedPoses:
    """Rows grouped by pose, with the error that rows of a pose have in common.

    Attributes:
        number: pose of each row, numbered in order of first appearance, (n,).
        first: first row of each pose, (g,).
        size: number of rows of each pose, (g,).
        ratio: variance of the common error over the variance within poses.
    """

    number: np.ndarray
    first: np.ndarray
    size: np.ndarray
    ratio: float

    @property
    def alike(self) -> float:
        """Intraclass correlation: of two rows of one pose."""
        return self.ratio / (1.0 + self.ratio)

    def mean(self, columns: np.ndarray) -> np.ndarray:
        """Means over poses, (n, m) -> (g, m)."""
        rows = len(self.number)
        from scipy import sparse

        member = sparse.csr_matrix((np.ones(rows, columns.dtype), (self.number, np.arange(rows))))
        return np.asarray((member @ columns) / self.size[:, None], dtype=columns.dtype)

    def is_constant(self, values: np.ndarray) -> bool:
        """Whether a variable is the same at every visit of a pose."""
        inside = values - self.mean(values[:, None])[self.number, 0]
        return bool(np.square(inside).sum() <= 1e-4 * np.square(values - values.mean()).sum())


@dataclass(frozen=True)
class Stratum:
    """m independent rows on which a variable is tested, with r residuals and B permutations of them.

    Attributes:
        poses: the poses of the n rows.
        means: whether a row is the mean of a pose (for variables that are constant in a pose), or a reading.
        white: residuals, whitened, the constant projected off, (m, r).
        nuisance: whitened constant of unit length, (m, 1).
        shuffled: residuals, then their permutations, each column of unit length, (m, (1 + B) r).
        within: deviations of the readings from the mean of their pose, (n, r); None with too few repeats.
    """

    poses: RepeatedPoses
    means: bool
    white: np.ndarray
    nuisance: np.ndarray
    shuffled: np.ndarray
    within: np.ndarray | None = None

    @property
    def rows(self) -> int:
        """Number m of independent rows."""
        return len(self.white)

    def whiten(self, columns: np.ndarray) -> np.ndarray:
        """Whiten columns of this stratum, (m, c) -> (m, c)."""
        return whiten(columns, self.poses, means=self.means)

    def values(self, column: np.ndarray) -> np.ndarray:
        """A variable on the rows of this stratum, (n,) -> (m,)."""
        return column[self.poses.first] if self.means else column

    def expand(self, columns: np.ndarray) -> np.ndarray:
        """Columns of this stratum on every row, (m, c) -> (n, c)."""
        return columns[self.poses.number] if self.means else columns


def find_poses(residual: np.ndarray, group: np.ndarray) -> RepeatedPoses:
    """Group rows by pose, and estimate a lower bound of the variance that they have in common (one-way ANOVA).

    A lower confidence bound, because few repeats tell little; those that are all equal by rounding are not used.

    Args:
        residual: (n, r), any units.
        group: (n,) int, poses.

    Returns:
        The poses, with the largest ratio of all residuals.
    """
    number = number_rows(group[:, None])
    size, rows = np.bincount(number).astype(float), len(number)
    poses = RepeatedPoses(number, np.unique(number, return_index=True)[1], size, 0.0)
    if len(size) < 3 or rows - len(size) < 3:
        return poses
    mean = poses.mean(residual)
    within = np.square(residual - mean[number]).sum(axis=0) / (rows - len(size))
    between = (size[:, None] * np.square(mean - residual.mean(axis=0))).sum(axis=0) / (len(size) - 1)
    usual = max((rows - np.square(size).sum() / rows) / (len(size) - 1), 1e-9)
    chance = float(f_ppf(SURELY, len(size) - 1, rows - len(size)))
    told = (LARGEST_RATIO * within > between) | (rows - len(size) >= ENOUGH)
    shared = between[told] / np.maximum(within[told], 1e-30) / chance - 1.0
    alike = 0.0 if told.any() or not between.any() else LARGEST_RATIO  # repeats are copies
    ratio = float(shared.max(initial=0.0) / usual) + alike
    return RepeatedPoses(number, poses.first, size, min(max(ratio, 0.0), LARGEST_RATIO))


def build_stratum(residual: np.ndarray, poses: RepeatedPoses, *, means: bool, seed: int) -> Stratum:
    """Whiten residuals, and permute them.

    Args:
        residual: (n, r), each of about unit variance, single precision.
        poses: repeated visits.
        means: one row for each pose.
        seed: of the permutations.

    Returns:
        The stratum.
    """
    data = poses.mean(residual) if means else residual
    flat = whiten(np.ones((len(data), 1), np.float32), poses, means=means)
    flat = flat / np.sqrt(np.square(flat).sum())
    white = whiten(data, poses, means=means)
    white = white - flat @ (flat.T @ white)
    random = np.random.default_rng([seed, 7, int(means)])
    order = np.argsort(random.random((PERMUTATIONS, len(white))), axis=1)
    order = np.concatenate([np.arange(len(white))[None], order])
    shuffled = np.ascontiguousarray(white[order.T].reshape(len(white), -1))
    length = np.square(shuffled).sum(axis=0) - np.square(flat.T @ shuffled)[0]
    within = residual - poses.mean(residual)[poses.number] if len(residual) - len(poses.size) >= ENOUGH else None
    return Stratum(poses, means, white, flat, shuffled / np.sqrt(np.maximum(length, 1e-12)), within)


def whiten(columns: np.ndarray, poses: RepeatedPoses, *, means: bool) -> np.ndarray:
    """Give columns independent errors of equal variance.

    Rows of one pose share an error of their own: v - (1 - root) mean(v), root = 1 / sqrt(1 + size x ratio) (Fuller and
    Battese 1973, nested errors). Means of poses are weighted by the inverse of their standard deviation.

    Args:
        columns: (n, c), or (g, c) with `means`.
        poses: repeated visits.
        means: one row for each pose.

    Returns:
        The same shape.
    """
    if means:
        weight = 1.0 / np.sqrt(poses.ratio + 1.0 / poses.size)
        return np.asarray(columns * (weight / weight.max())[:, None], dtype=columns.dtype)
    if poses.ratio == 0.0:
        return columns
    shrunk = poses.mean(columns) * (1.0 - 1.0 / np.sqrt(1.0 + poses.size * poses.ratio))[:, None]
    return np.asarray(columns - shrunk[poses.number], dtype=columns.dtype)
