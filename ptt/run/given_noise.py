"""The noise floor that a run or the machine file gives."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ptt.run.noise import Noise, at_least, least_variance
from ptt.run.repeats import noise_from_repeats

if TYPE_CHECKING:
    from ptt.run.table import Table


def noise_from_std(table: "Table", rotation: np.ndarray, frame: np.ndarray) -> Noise | None:
    """Take the tracker's own standard deviations, which are along its axes, into the base frame.

    Args:
        table: n rows.
        rotation: of each tracker frame, from the base frame to the tracker's, (f, 3, 3).
        frame: of each row, (n,) int.

    Returns:
        The noise, or None without `x_std, y_std, z_std`.
    """
    if table.std is None:
        return None
    read = np.isfinite(table.measured).all(axis=1) & (table.role != "base")
    told = read & (table.std > 0.0).all(axis=1)  # zero stands for unknown
    if not told.any():
        return None
    covariance = 1e-14 * np.eye(3)
    for index in np.unique(frame[told]):
        own = told & (frame == index)
        share, squares = own.sum() / told.sum(), np.median(table.std[own] ** 2, axis=0)
        covariance += share * (rotation[index].T * squares) @ rotation[index]
    return Noise(covariance, "std columns")


def given_noise(
    table: "Table", measured: np.ndarray, direction: np.ndarray, sigma: float | None, rotation: np.ndarray,
    frame: np.ndarray,
) -> Noise | None:  # fmt: skip
    """The noise floor from the data or the machine file.

    A tracker's own standard deviations, taken while the machine stands, do not contain what differs from visit to
    visit; where repeats scatter by more, the repeats are used.

    Args:
        table: n rows.
        measured: readings in the base frame, (n, 3) mm.
        direction: directions of arrival, (n, k).
        sigma: the machine file's figure for one coordinate, mm.
        rotation: of each tracker frame, from the base frame to the tracker's, (f, 3, 3).
        frame: of each row, (n,) int.

    Returns:
        The noise; None where only a saturated model can give it.
    """
    columns = noise_from_std(table, rotation, frame)
    known = _given_noise(table, measured, direction, columns, sigma)
    if known is None:
        return None
    read = table.measured[np.isfinite(table.measured).all(axis=1) & (table.role != "base")]
    least = least_variance(read, known.total**2 / 3.0)
    return replace(known, covariance=at_least(known.covariance, least), least=least)


def _given_noise(
    table: "Table", measured: np.ndarray, direction: np.ndarray, columns: Noise | None, sigma: float | None
) -> Noise | None:
    repeats = noise_from_repeats(table, measured, direction)
    file = Noise(np.eye(3) * sigma**2, "machine file") if sigma is not None else None
    if columns is not None and (repeats is None or repeats.total <= columns.total):
        return columns
    if repeats is None:
        return file
    stated = columns or file
    return repeats if stated is None else replace(repeats, stated=(stated.source, stated.total))
