"""Compensation tables of single axes: what to add to an axis by where it is, and by the way it goes."""

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

FINE = 4097  # points at which an axis is looked at before its table is cut
COARSEST, FINEST = 64, 2048  # intervals of a table; smooth curves alone bend by 0.05 um within the coarsest
SEEN_ERROR = 1e-4  # mm or rad: a table that interpolates to a tenth of a micrometre needs no more entries
ROUNDS = 4  # a drive's error changes by a hundredth of what the axis moves, at most: each round gains two digits
WAVES = 5  # knots inside the travel of what is smooth: what geometry asks of an axis has no more bends than that


@dataclass(frozen=True, eq=False)
class AxisTables:
    """One table for each axis.

    Attributes:
        at: positions of the entries, (K, k) mm or rad.
        forward: what to add on the way up, (K, k).
        reverse: what to add on the way down, (K, k).
    """

    at: Array
    forward: Array
    reverse: Array

    def added(self, q: Array, direction: Array) -> Array:
        """What a controller adds, straight between entries, as at the ends beyond them.

        Args:
            q: (n, k) mm or rad.
            direction: (n, k), +1 or -1.

        Returns:
            (n, k).
        """
        up, down = (_straight(q, self.at, values) for values in (self.forward, self.reverse))
        return np.asarray(np.where(direction > 0, up, down))


@dataclass(frozen=True, eq=False)
class Drives:
    """What the steady drive effects do to each axis by where it is sent.

    Attributes:
        at: (F, k) mm or rad, evenly over the travel.
        shift: (F, k), by how much each axis goes farther than it is sent.
        of: the same by each effect, by its key.
    """

    at: Array
    shift: Array
    of: dict[str, Array]

    def at_rows(self, q: Array) -> Array:
        """The shift of axes that are sent to q (n, k), (n, k)."""
        return _straight(q, self.at, self.shift)


def read_drives(sample: WorkspaceSample) -> Drives:
    """Look at what the steady drive effects do along each axis, all axes going through their travel side by side.

    Args:
        sample: for the model, at its first place's payload, temperature and speed.

    Returns:
        What they do; nothing where the drawing cannot be there.
    """
    model = sample.compensator.model
    limits = joint_limits(model.file).numpy()
    at = np.linspace(limits[:, 0], limits[:, 1], FINE)
    terms = [item for item in split_terms(model)[0] if item[0].stage == "drive"]
    of = _shifts(sample, terms, at)
    return Drives(at, sum(of.values(), np.zeros_like(at)), of)


def table_entries(drives: Drives, step: float | None, most: int) -> Array:
    """Where the entries of a table lie: as close as asked, or as close as the drives' errors need.

    Args:
        drives: along each axis.
        step: distance of entries, mm or rad; None for as coarse as interpolates to a tenth of a micrometre.
        most: entries that the controller holds.

    Returns:
        (K, k) mm or rad, ascending.
    """
    low, high = drives.at[0], drives.at[-1]
    if step is not None:
        count = int(np.ceil(float((high - low).max()) / step - 1e-9))
        return np.linspace(low, high, min(max(count, 1), most - 1) + 1)
    count = COARSEST
    while count < FINEST and _lost(drives, np.linspace(low, high, count + 1)) > SEEN_ERROR:
        count *= 2
    return np.linspace(low, high, min(count, most - 1) + 1)


def smooth_basis(q: Array, drives: Drives) -> tuple[Array, Callable[[Array], Array]]:
    """Smooth curves over each axis' own travel.

    Args:
        q: (n, k) where rows stand.
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
    """Half of what commands differ by between the two ways of each axis.

    Args:
        sample: places and commands.

    Returns:
        (k,) mm or rad.
    """
    return np.asarray((sample.commands.reversal * sample.direction).mean(axis=0))


def cut_tables(drives: Drives, at: Array, smooth: Array, half: Array) -> AxisTables:
    """Tables that bring each axis to smooth curves, whatever its drive does.

    Args:
        drives: what they do.
        at: (K, k), entries.
        smooth: (F, k), on the drives' grid, how far beyond an entry the axis is to come.
        half: (k,), what to add on the way up and take off on the way down.

    Returns:
        The tables.
    """
    wanted = _straight(at, drives.at, smooth)
    value = wanted
    for _ in range(ROUNDS):
        value = wanted - drives.at_rows(at + value)
    return AxisTables(at, value + half, value - half)


def tabled(sample: WorkspaceSample, drives: Drives, at: Array) -> Callable[[Effect], Array]:
    """How far each axis is moved by an effect as far as a table of these entries can say it, (n, k)."""

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


def _lost(drives: Drives, at: Array) -> float:
    """Largest error of straight lines between entries."""
    return float(np.abs(_tabled(drives, drives.shift, at, drives.at) - drives.shift).max())


def _tabled(drives: Drives, values: Array, at: Array, q: Array) -> Array:
    """Curves (F, k) taken at entries (K, k) and drawn straight between them, at q (n, k)."""
    return _straight(q, at, _straight(at, drives.at, values))


def _straight(q: Array, at: Array, values: Array) -> Array:
    """Values (m, k) at places (m, k) of each axis, drawn straight between them, at q (n, k); as at the ends beyond."""
    return np.column_stack([np.interp(q[:, i], at[:, i], values[:, i]) for i in range(q.shape[1])])
