"""Moments at which readings switch between levels: unlike a wander, which is never at rest and never in a hurry.

A coolant pump, a clamp, a door or a second machine switches; a tracker, its stand and the air drift. Both have the same
covariance, that of an Ornstein-Uhlenbeck process, and differ in form: here a level is constant until it changes.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.wander import Clock, tracker_likelihood, white_likelihood
from ptt.diagnosis.search.joint_wander import along_place
from ptt.diagnosis.unknown.block import Block
from ptt.diagnosis.unknown.jumps import MOST_EVENTS
from ptt.diagnosis.unknown.places import one_way_each, places_of_chain
from ptt.run.axes import AXES

# Nats by which levels have to explain the readings better than a wander does. Of wanders and random walks with 60 to
# 500 readings none comes closer than minus 0.4; what switches between levels of one to three sigma of the noise is
# ahead by 20 to 500.
SURE_NATS = 10.0
MOST_BINS = 600  # neighbouring rows that are taken together beyond, as every pair of rows is tried
ALIKE_ERRORS = 2.0  # standard errors of white noise by which neighbours have to be alike for levels to be looked for
SAME_ERRORS = 3.0  # standard errors up to which two levels count as the same one
LEAST_SHARE = 0.5  # variance of the levels over the white one: smaller ones are not looked for
LEAST_VARIANCE = 1e-12  # against division by zero, in units of the noise


def switching_moments(system: System, state: State) -> dict[str, tuple[float, ...]]:
    """Moments between which the readings stay at a level, where that explains them better than a wander does.

    At the tool and along a joint also better than a single change, which is a knock's or a slip's; and few changes have
    to come back to a level that was left. A rail or a link, which the library has none for, may come loose at a single
    moment.

    Args:
        system: the linearised problem; that of a long run, which holds no rows, tells nothing.
        state: the best set; what acts over time alone in it counts as unexplained. Beside errors of poses, which are
            levels too where poses are revisited one after another, nothing is told.

    Returns:
        Place of one direction, or 'tool' -> its moments by the clock, ascending; none for places that do not switch.
    """
    clock, found = system.clock, dict[str, tuple[float, ...]]()
    if not isinstance(system, RowSystem) or state.memory.pose or not len(clock.constants):
        return found
    left = _left_over_time(system, state)
    ways = [way for way in _directions(system, left) if _is_alike(way[1], clock)]
    wandering = tracker_likelihood(left, system.noise, clock) if ways else np.inf
    for residual, along, lever, may_jump_once in ways:
        levels = _levels_of(along, lever, clock)
        nats, rows = _best_levels(left, levels, clock)
        least = wandering if may_jump_once else max(wandering, _one_change(left, levels))
        recurs = may_jump_once or len(rows) > MOST_EVENTS or _comes_back(levels, rows)
        if len(rows) and nats > least + SURE_NATS and recurs:
            found[residual] = tuple((0.5 * (clock.time[rows - 1] + clock.time[rows])).tolist())
    return found


def acts_over_time(system: System, state: State) -> tuple[str, ...]:
    """Keys of a set's atoms that act over time alone: its blocks over time, and sudden effects.

    And a rail that bows with time: one that comes loose may be taken for it at first.
    """
    atoms = system.atoms
    return tuple(key for key in state.keys if atoms[key].moment is not None or _is_of_time_alone(atoms[key].block))


def _is_of_time_alone(block: Block | None) -> bool:
    """Whether it is a block of nothing but time, or of a rail that bows with it."""
    return block is not None and block.on[0] == "time" and (len(block.on) == 1 or block.place.kind == "rail")


def _left_over_time(system: RowSystem, state: State) -> np.ndarray:
    """Residuals of a set, (m, 3) whitened, with what acts over time alone left in them."""
    values = state.posterior.values.copy()
    for key in acts_over_time(system, state):
        values[state.of(key)] = 0.0
    return system.residual(state.columns, values)


def _directions(system: RowSystem, left: np.ndarray) -> Iterator[tuple[str, np.ndarray, np.ndarray, bool]]:
    """Residuals (m, d) along the axes of the tool, all together and each alone, and along the ways of joints and rails.

    Each with the name of the place, how far it moves each reading, (m,), and whether a single moment counts there.
    """
    alike = np.ones(len(left))
    yield "tool", left, alike, False
    for name, axis in zip(AXES, system.noise.whitener.T, strict=True):
        yield name, left @ (axis / np.linalg.norm(axis))[:, None], alike, False
    for place in places_of_chain(system.at.problem, system.at.chain)[1:]:
        for way in one_way_each(place):
            along, lever = along_place(system, way, left)
            yield way.residual, along[:, None], lever, place.kind in ("rail", "link")


def _is_alike(along: np.ndarray, clock: Clock) -> bool:
    """Whether neighbouring residuals (m, d) are more alike than white noise makes them."""
    within = ~clock.starts[1:]
    products = (along[1:] * along[:-1])[within]
    return float(products.sum()) > ALIKE_ERRORS * float(np.sqrt(np.square(products).sum()))


@dataclass(frozen=True)
class _Levels:
    """Residuals of d directions that stay at levels with a normal prior, beside white noise.

    Attributes:
        sums: of the products of residuals and levers of the rows before each, (m + 1, d).
        weights: of the squared levers of the rows before each, (m + 1,).
        share: variance of the levels over the white one.
        noise: white variance.
    """

    sums: np.ndarray
    weights: np.ndarray
    share: float
    noise: float

    @property
    def rows(self) -> int:
        """Number m of rows."""
        return len(self.sums) - 1

    def taken(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """What levels of some rows take off the sum of squares, (k,); these begin and end before the given rows."""
        squares = np.square(self.sums[end] - self.sums[begin]).sum(axis=1)
        return np.asarray(self.share * squares / (1.0 + self.share * (self.weights[end] - self.weights[begin])))

    def log_noise(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Half the log-determinant of the covariance of the rows of each level, (k,)."""
        return np.asarray(0.5 * self.sums.shape[1] * np.log1p(self.share * (self.weights[end] - self.weights[begin])))

    def gained(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Nats that levels of some rows gain over white noise, (k,)."""
        return np.asarray(0.5 * self.taken(begin, end) / self.noise - self.log_noise(begin, end))


def _best_levels(left: np.ndarray, levels: _Levels, clock: Clock) -> tuple[float, np.ndarray]:
    """Log evidence of the best levels beside white noise, and the first row of each but the first.

    Dynamic programming over the last change (Jackson et al., IEEE Signal Processing Letters 12 (2005) 105). Each change
    costs the choice of its row; runs begin anew at no cost.

    Args:
        left: residuals, (m, 3) whitened.
        levels: of these along some directions.
        clock: of the rows.
    """
    rows, price = levels.rows, float(np.log(levels.rows))
    edges = np.union1d(np.arange(0, rows, -(-rows // MOST_BINS)), np.flatnonzero(clock.starts))
    bounds, first = np.append(edges, rows), 0
    best, before = np.zeros(len(bounds)), np.zeros(len(bounds), dtype=int)
    for last in range(len(edges)):
        first = last if clock.starts[edges[last]] else first
        tried = np.arange(first, last + 1)
        begin, end = bounds[tried], bounds[last + 1]
        gained = levels.gained(begin, end) - price * (tried > first)
        chosen = int(np.argmax(best[tried] + gained))
        best[last + 1], before[last + 1] = (best[tried] + gained)[chosen], tried[chosen]
    begin = _to_the_row(bounds[_followed(before)], levels, clock)
    end, changes = np.append(begin[1:], rows), begin[~clock.starts[begin]]
    log_noise = float(levels.log_noise(begin, end).sum()) + price * len(changes)
    return white_likelihood(left, float(levels.taken(begin, end).sum()), log_noise), changes


def _comes_back(levels: _Levels, changes: np.ndarray) -> bool:
    """Whether a level is one that was left before: what goes on to another level each time are separate events."""
    begin, end = np.append(0, changes), np.append(changes, levels.rows)
    weight = np.maximum(levels.weights[end] - levels.weights[begin], LEAST_VARIANCE)
    height, variance = (levels.sums[end] - levels.sums[begin]) / weight[:, None], levels.noise / weight
    bound = SAME_ERRORS**2 * (variance[:, None] + variance)
    alike = (np.square(height[:, None] - height).max(axis=2) < bound) & np.triu(np.ones_like(bound, dtype=bool), 2)
    return bool(alike.any())


def _one_change(left: np.ndarray, levels: _Levels) -> float:
    """Log evidence of the best single change, as a slip or a knock makes; arguments as of `_best_levels`."""
    rows = levels.rows
    row, begin, end = np.arange(1, rows), np.zeros(rows - 1, dtype=int), np.full(rows - 1, rows)
    best = int(np.argmax(levels.gained(begin, row) + levels.gained(row, end)))
    bounds = np.array([0, row[best], rows])
    log_noise = float(levels.log_noise(bounds[:-1], bounds[1:]).sum()) + float(np.log(rows))
    return white_likelihood(left, float(levels.taken(bounds[:-1], bounds[1:]).sum()), log_noise)


def _levels_of(along: np.ndarray, lever: np.ndarray, clock: Clock) -> _Levels:
    """Levels of residuals (m, d) that move each row by a lever (m,), with the variance that they may have."""
    noise = _quick_variance(along, clock)
    share = max(float(np.square(along).mean()) / noise - 1.0, LEAST_SHARE)
    sums = np.vstack([np.zeros(along.shape[1]), np.cumsum(along * lever[:, None], axis=0)])
    return _Levels(sums, np.append(0.0, np.cumsum(np.square(lever))), share, noise)


def _to_the_row(begin: np.ndarray, levels: _Levels, clock: Clock) -> np.ndarray:
    """First rows of levels, (k,), moved to the best row where rows were taken together; changes that do not pay go."""
    rows, price = levels.rows, float(np.log(levels.rows))
    reach, found = -(-rows // MOST_BINS), [int(begin[0])]
    if reach == 1:
        return begin

    for own, behind in zip(begin[1:], np.append(begin, rows)[2:], strict=True):
        tried = np.arange(max(found[-1] + 1, own - reach), min(behind, own + reach + 1))
        first, last = np.full(len(tried), found[-1]), np.full(len(tried), behind)
        both = levels.gained(first, tried) + levels.gained(tried, last) - price
        if clock.starts[own]:
            found.append(int(own))
        elif len(tried) and both.max() > levels.gained(first[:1], last[:1])[0]:
            found.append(int(tried[np.argmax(both)]))
    return np.array(found)


def _followed(before: np.ndarray) -> list[int]:
    """Where each level of the best ones begins, from where the last one of each number of rows does, ascending."""
    begins, at = list[int](), len(before) - 1
    while at > 0:
        at = int(before[at])
        begins.append(at)
    return begins[::-1]


def _quick_variance(along: np.ndarray, clock: Clock) -> float:
    """White variance of residuals (m, d), from differences of successive rows, which levels leave alone."""
    steps = np.diff(along, axis=0)[~clock.starts[1:]]
    return max(0.5 * float(np.square(steps).mean()), LEAST_VARIANCE)
