"""Successive rows that are far off: no gross errors, but another reflector, a knock, or a fault of the machine."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ptt.record import Record
from ptt.run.holdout import pose_groups
from ptt.run.noise import Noise
from ptt.run.problem import Problem
from ptt.run.repeats import SAME_FEED, SAME_LOAD
from ptt.run.same_pose import number_alike
from ptt.run.tails import poisson_sf

# rows from which a stretch is no chance: with one reading in twelve lost, one run in six has three in a row
LEAST_STRETCH = 3
MACHINE_STEP = 1.0  # mm that a machine is off by in all, but not from one row to the next as after a knock
# share of all rows, a minority that the others outvote: of two halves nobody can say which is right
MOST_SHIFTED = 0.25
AGREE_SHARE = 0.5  # share of their size by which two far readings may differ and still show the same place
CONE_SHARE = 0.06  # share of pairs of random shifts that differ by no more: a cone of 29 degrees
AGREE_CHANCE = 0.03  # p-value of as many such pairs below which they are no accident
ALIKE_SHARE = 0.9  # share of the rows alike in load, feed, run or direction that are off, from which that is the cause


@dataclass(frozen=True)
class Stretch(Record):
    """Rows in a row that are off by one shift and are left out of every figure.

    Attributes:
        place: 'lines 122 to 151', with the file where there are several.
        lines: first and last line in the file.
        rows: how many readings.
        shift_mm: the shift they share, x, y, z.
    """

    keys: ClassVar[str] = (
        "lines, rows, shift_um.x: shift_mm.0 [um], shift_um.y: shift_mm.1 [um], shift_um.z: shift_mm.2 [um], words"
    )

    place: str
    lines: tuple[int, int]
    rows: int
    shift_mm: tuple[float, float, float]

    @property
    def words(self) -> str:
        """One sentence."""
        x, y, z = (f"{1e3 * value:+.0f}" for value in self.shift_mm)
        return (
            f"{self.place} ({self.rows} readings in a row) are off by x {x}, y {y}, z {z} um together: another "
            "reflector, or a knock? They are left out of every figure"
        )


def name_stretches(
    outliers: np.ndarray, residual: np.ndarray, problem: Problem
) -> tuple[tuple[Stretch, ...], np.ndarray]:
    """Tell stretches from single gross errors among the rows that a fit left out.

    Args:
        outliers: rows left out, (n,) bool.
        residual: what the fit leaves of them, (n, 3) mm.
        problem: the readings.

    Returns:
        The stretches, and the single rows, (n,) bool.
    """
    alone, found = outliers.copy(), []
    for whole in in_a_row(outliers, problem):
        alike = AGREE_SHARE**2 * float(np.square(residual[whole]).sum(axis=1).max())
        for part in _shifts(whole, residual, alike):
            alone[part] = False
            found.append(_stretch(part, residual, problem))
    return tuple(found), alone


def _stretch(part: np.ndarray, residual: np.ndarray, problem: Problem) -> Stretch:
    table = problem.table
    x, y, z = np.median(residual[part], axis=0).tolist()
    lines = int(table.line[part[0]]), int(table.line[part[-1]])
    file = f"{table.run_label[table.run[part[0]]]}: " if table.of_several_files else ""
    return Stretch(f"{file}lines {lines[0]} to {lines[1]}", lines, len(part), (x, y, z))


def confirmed_by_pose(far: np.ndarray, error: np.ndarray, problem: Problem) -> np.ndarray:
    """Far rows whose pose has another far visit with a similar error: a fault of the machine, no broken beam.

    Args:
        far: (n,) bool.
        error: residual, (n, 3).
        problem: the readings.

    Returns:
        (n,) bool.
    """
    pose = pose_groups(problem.table)
    alike, visits = alike_visits(far, error, pose), np.bincount(pose[problem.used])
    chance = agree_by_chance(alike.sum() / 2.0, far.sum() / max(problem.used.sum(), 1), visits)
    return np.zeros_like(far) if chance else alike > 0


def alike_visits(far: np.ndarray, error: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Number of other far visits of each far row's pose with a similar error.

    Args:
        far: (n,) bool.
        error: residual, (n, 3).
        pose: of each row, (n,) int from 0.

    Returns:
        (n,) int; zero of rows that are not far.
    """
    alike = np.zeros(len(far), dtype=int)
    for number in np.flatnonzero(np.bincount(pose[far]) > 1):
        rows = np.flatnonzero(far & (pose == number))
        size = np.linalg.norm(error[rows], axis=1)
        apart = np.linalg.norm(error[rows, None] - error[None, rows], axis=2)
        alike[rows] = (apart <= AGREE_SHARE * np.maximum(size[:, None], size)).sum(axis=1) - 1  # itself left out
    return alike


def agree_by_chance(pairs: float, share: float, visits: np.ndarray) -> bool:
    """Whether so many pairs of far readings of one pose may agree by chance.

    Args:
        pairs: that agree to within `AGREE_SHARE` of their size.
        share: of all readings that are far.
        visits: of each pose, (poses,).

    Returns:
        False where broken beams would hardly do it.
    """
    could = float((visits * (visits - 1.0)).sum()) / 2.0
    return bool(poisson_sf(pairs - 1.0, CONE_SHARE * share**2 * could) >= AGREE_CHANCE)


def in_a_row(far: np.ndarray, problem: Problem) -> list[np.ndarray]:
    """Stretches of rows that follow each other.

    Args:
        far: (n,) bool.
        problem: the readings; rows that do not count stand in nobody's way, runs end a stretch.

    Returns:
        Row numbers of each stretch of at least `LEAST_STRETCH` rows.
    """
    order = np.flatnonzero(problem.used)
    flag, run = far[order], problem.table.run[order]
    cuts = np.flatnonzero((flag[1:] != flag[:-1]) | (run[1:] != run[:-1])) + 1
    return [part for part in np.split(order, cuts) if len(part) >= LEAST_STRETCH and far[part[0]]]


def shifted_stretches(
    whitened: np.ndarray, far: np.ndarray, problem: Problem, limit: float, noise: Noise
) -> list[np.ndarray]:
    """Stretches that are off by one common shift and sound but for that.

    Shifts as small as a machine's own errors stay, for effects to explain, and so does a stretch that differs from all
    others by its load, speed, run or direction of arrival.

    Args:
        whitened: residual in units of noise, (n, 3).
        far: rows beyond the limit, (n,) bool.
        problem: the readings.
        limit: squared distance that a sound row stays below.
        noise: the unit of the residual.

    Returns:
        Row numbers of each; none where they are so many that nobody can say which rows are right.
    """
    together = [part for whole in in_a_row(far, problem) for part in _shifts(whole, whitened, limit)]
    color = np.linalg.inv(noise.whitener).T
    together = [part for part in together if np.linalg.norm(np.median(whitened[part] @ color, axis=0)) > MACHINE_STEP]
    if not together:
        return []
    everyone = np.isin(np.arange(len(far)), np.concatenate(together))
    causes = _likenesses(problem)
    found = [part for part in together if not any(_explains(cause, part, everyone, problem.used) for cause in causes)]
    return found if sum(map(len, found)) <= MOST_SHIFTED * problem.used.sum() else []


def _shifts(whole: np.ndarray, error: np.ndarray, limit: float) -> list[np.ndarray]:
    """A stretch if it has one common shift, else those of its parts that have."""
    if _is_shift(error[whole], limit):
        return [whole]
    step = np.square(np.diff(error[whole], axis=0)).sum(axis=1)
    parts = np.split(whole, np.flatnonzero(step > 2.0 * limit) + 1)  # a difference has twice the variance
    return [part for part in parts if len(part) >= LEAST_STRETCH and _is_shift(error[part], limit)]


def _is_shift(whitened: np.ndarray, limit: float) -> bool:
    apart = np.square(whitened - np.median(whitened, axis=0)).sum(axis=1)
    return bool(np.mean(apart <= limit) > 1.0 - MOST_SHIFTED)


def _likenesses(problem: Problem) -> list[np.ndarray]:
    """Labels (n,) int of rows with the same run, direction of arrival, load or feed, one array for each of these."""
    table = problem.table
    found = [table.run, *problem.view.direction.numpy().T.astype(int)]
    for values, tolerance in ((table.payload_kg, SAME_LOAD), (table.feed_mm_s, SAME_FEED)):
        if values is not None:
            found.append(number_alike(values, tolerance))
    return found


def _explains(cause: np.ndarray, part: np.ndarray, off: np.ndarray, used: np.ndarray) -> bool:
    """Whether all rows of a stretch have a label that sound rows do not have."""
    if (cause[part] != cause[part[0]]).any():
        return False
    alike = used & (cause == cause[part[0]])
    return bool(off[alike].mean() >= ALIKE_SHARE)
