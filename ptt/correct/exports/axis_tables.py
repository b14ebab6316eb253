"""Compensation tables of single axes: correction by position and direction of travel."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from ptt.correct.exports.left import WorkspaceSample
from ptt.correct.terms import split_terms
from ptt.effects import Effect
from ptt.run.table import make_table
from ptt.run.viewing import build_view, joint_limits

Array = np.ndarray

FINE = 4097  # samples of an axis' errors, from which tables are interpolated
COARSEST, FINEST = 64, 2048  # intervals of a table; smooth curves alone need no more than the coarsest (0.05 um)
INTERPOLATION = 1e-4  # mm or rad: interpolation error below which a table needs no more entries
ROUNDS = 4  # of fixed-point iteration: the slope of a drive's error is at most 1 %, so each round gains two digits
WAVES = 5  # inner knots of the smooth curve: corrections of geometry are no wavier than that


@dataclass(frozen=True, eq=False)
class AxisTables:
    """One table for each axis.

    Attributes:
        at: positions of the entries, (K, k) mm or rad.
        forward: correction when moving up, (K, k).
        reverse: correction when moving down, (K, k).
    """

    at: Array
    forward: Array
    reverse: Array

    def added(self, q: Array, direction: Array) -> Array:
        """The correction of the controller: linear between entries, constant beyond the ends.

        Args:
            q: (n, k) mm or rad.
            direction: (n, k), +1 or -1.

        Returns:
            (n, k).
        """
        up, down = (_interpolate(q, self.at, values) for values in (self.forward, self.reverse))
        return np.asarray(np.where(direction > 0, up, down))


@dataclass(frozen=True, eq=False)
class DriveErrors:
    """Shift of each axis by the steady drive effects, as a function of its command.

    Attributes:
        at: (F, k) mm or rad, evenly over the travel.
        shift: (F, k) mm or rad, actual less commanded position.
        of: share of each effect, by its key.
    """

    at: Array
    shift: Array
    of: dict[str, Array]

    def at_rows(self, q: Array) -> Array:
        """The shift at commands q (n, k), (n, k)."""
        return _interpolate(q, self.at, self.shift)


def drive_errors(sample: WorkspaceSample) -> DriveErrors:
    """Sample the steady drive effects along each axis; all axes go through their travel together.

    Args:
        sample: for the model, at its first place's payload, temperature and speed.

    Returns:
        The shifts; zero for an effect that cannot be evaluated at all samples, since not all of them can be assembled.
    """
    model = sample.compensator.model
    limits = joint_limits(model.file).numpy()
    at = np.linspace(limits[:, 0], limits[:, 1], FINE)
    terms = [item for item in split_terms(model)[0] if item[0].stage == "drive"]
    of = _shifts(sample, terms, at)
    return DriveErrors(at, sum(of.values(), np.zeros_like(at)), of)


def table_entries(drives: DriveErrors, step: float | None, most: int) -> Array:
    """Positions of a table's entries: as close as asked, or as close as the drive errors need.

    Args:
        drives: along each axis.
        step: distance of entries, mm or rad; None for the coarsest that keeps the interpolation error below 0.1 um.
        most: entries that the controller holds.

    Returns:
        (K, k) mm or rad, ascending.
    """
    low, high = drives.at[0], drives.at[-1]
    if step is not None:
        count = int(np.ceil(float((high - low).max()) / step - 1e-9))
        return np.linspace(low, high, min(max(count, 1), most - 1) + 1)
    count = COARSEST
    while count < FINEST and _interpolation_error(drives, np.linspace(low, high, count + 1)) > INTERPOLATION:
        count *= 2
    return np.linspace(low, high, min(count, most - 1) + 1)


def smooth_basis(q: Array, drives: DriveErrors) -> tuple[Array, Callable[[Array], Array]]:
    """Cubic B-splines over each axis' own travel.

    Args:
        q: (n, k), positions of the rows.
        drives: along each axis, for its travel.

    Returns:
        (n, k, P), a column moves one axis only; and coefficients (P,) -> values (F, k) along the axes.
    """
    blocks, along = [], []
    for axis in range(q.shape[1]):
        low, high = drives.at[0, axis], drives.at[-1, axis]
        knots = np.concatenate([[low] * 3, np.linspace(low, high, WAVES + 2), [high] * 3])
        blocks.append(BSpline.design_matrix(np.clip(q[:, axis], low, high), knots, 3).toarray())
        along.append(BSpline.design_matrix(drives.at[:, axis], knots, 3).toarray())
    width = blocks[0].shape[1]
    basis = np.zeros((*q.shape, width * q.shape[1]))
    for axis, block in enumerate(blocks):
        basis[:, axis, axis * width : (axis + 1) * width] = block

    def values(coefficients: Array) -> Array:
        parts = coefficients.reshape(q.shape[1], width)
        return np.column_stack([design @ part for design, part in zip(along, parts, strict=True)])

    return basis, values


def by_direction(sample: WorkspaceSample) -> Array:
    """Half the difference of commands between both directions of each axis.

    Args:
        sample: places and commands.

    Returns:
        (k,) mm or rad.
    """
    return np.asarray((sample.commands.reversal * sample.direction).mean(axis=0))


def cut_tables(drives: DriveErrors, at: Array, smooth: Array, half: Array) -> AxisTables:
    """Tables that bring each axis to a smooth curve by inverting its drive error.

    Args:
        drives: their errors.
        at: (K, k), entries.
        smooth: (F, k), on the drives' grid, the wanted actual position less the entry.
        half: (k,), added when moving up and subtracted when moving down.

    Returns:
        The tables.
    """
    wanted = _interpolate(at, drives.at, smooth)
    value = wanted
    for _ in range(ROUNDS):
        value = wanted - drives.at_rows(at + value)
    return AxisTables(at, value + half, value - half)


def tabled(sample: WorkspaceSample, drives: DriveErrors, at: Array) -> Callable[[Effect], Array]:
    """Shift of each axis by an effect as a table with these entries represents it, (n, k)."""

    def shift(effect: Effect) -> Array:
        if effect.key not in drives.of:
            return np.zeros_like(sample.nominal)
        return _tabled(drives, drives.of[effect.key], at, sample.static)

    return shift


def _shifts(sample: WorkspaceSample, terms: list, at: Array) -> dict[str, Array]:
    if not terms:
        return {}
    context = {key: getattr(sample.table, key) for key in ("payload_kg", "temp_c", "feed_mm_s")}
    told = {key: float(value[0]) for key, value in context.items() if value is not None}
    view = build_view(sample.compensator.model.file, make_table(None, at, **told))
    shifts = {effect.key: effect.shift(theta, view).numpy() for effect, theta in terms}
    return {key: np.where(np.isfinite(value).all(), value, 0.0) for key, value in shifts.items()}


def _interpolation_error(drives: DriveErrors, at: Array) -> float:
    """Largest error of linear interpolation between entries."""
    return float(np.abs(_tabled(drives, drives.shift, at, drives.at) - drives.shift).max())


def _tabled(drives: DriveErrors, values: Array, at: Array, q: Array) -> Array:
    """Curves (F, k) sampled at entries (K, k) and interpolated linearly at q (n, k)."""
    return _interpolate(q, at, _interpolate(at, drives.at, values))


def _interpolate(q: Array, at: Array, values: Array) -> Array:
    """Linear interpolation at q (n, k) of values (m, k) at positions (m, k) of each axis; constant beyond the ends."""
    return np.column_stack([np.interp(q[:, i], at[:, i], values[:, i]) for i in range(q.shape[1])])
