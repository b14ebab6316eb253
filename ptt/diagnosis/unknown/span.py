"""Ranges and contexts of a whole run, so that basis functions on a part of it are those of the whole."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ptt.dependence.contexts import load_name, loads_of, moves_of
from ptt.dependence.way import ways_of
from ptt.diagnosis.unknown.smooth import (
    MODULATION_DEGREE,
    column_ends,
    cosines,
    modulation,
    product,
    reined,
    scaled,
    unit,
)
from ptt.effects.hysterons import initial_memory
from ptt.run.fading import kept_shares, trailing
from ptt.run.problem import Problem
from ptt.run.view import View
from ptt.run.watched import watched_values

SETTLING_SHARES = (0.02, 0.1)  # time constants, as shares of the run, of what warms up or settles at its start
TIME_COSINES = 10  # cosines over the time of the run
FEED_SHARE = 0.05  # share of the largest feed that a feed has to vary by
MOST_RUNS = 6  # runs up to which the beginning of each has columns of its own; more of them are short
MOST_REMEMBERED = 20_000  # rows beyond which how a run was entered is too small a part to matter
MEMORIES_S = (300.0, 1200.0, 4000.0)  # s: thermal time constants of screws, frames and rooms


@dataclass(frozen=True)
class Context:
    """Something beside the pose that varies.

    Attributes:
        name: 'payload', 'temperature', 'time', 'speed', 'feed', 'way', 'turn', or the title of a column that a person
            wants watched.
        shapes: smooth functions of it, (n, s), of about unit size, zero where it has no effect.
        measure: functions that may modulate play, a level first, (n, m); no columns where no play depends on it.
        fields: whether it may modulate a field over the workspace, beyond scale and rotation.
        joints: whether it may act on joints, or only on the tool.
        mean: mean of the shapes over the whole run, (s,).
    """

    name: str
    shapes: np.ndarray
    measure: np.ndarray
    fields: bool = True
    joints: bool = True
    mean: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def of(self, rows: np.ndarray) -> "Context":
        """The context on some of the rows, (m,) int."""
        return replace(self, shapes=self.shapes[rows], measure=self.measure[rows])


@dataclass(frozen=True)
class Span:
    """Ranges and contexts of a whole run.

    Attributes:
        q: lowest and highest value of each joint, (2, k).
        p: lowest and highest value of each coordinate, (2, 3) mm.
        radius: root mean square of the coordinates, mm.
        contexts: what varies beside the pose, with shapes on all n rows.
        two_sided: joints that reached readings that count from both directions, (k,) bool.
        settling: functions of time for a joint that drifts or settles over the run, (n, 5).
        begun: decaying memory of the direction in which each run was entered, columns of its own for each run,
            (n, k, c).
        loads: load of each joint, as a context of its own, k of them; None where it is unknown or the same everywhere.
        levers: name of a place -> its lever, where other rows of the run have determined it.
    """

    q: np.ndarray
    p: np.ndarray
    radius: float
    contexts: tuple[Context, ...]
    two_sided: np.ndarray
    settling: np.ndarray
    begun: np.ndarray
    loads: tuple[Context | None, ...]
    levers: dict[str, float] = field(default_factory=dict)

    def of(self, rows: np.ndarray) -> "Span":
        """The span with functions on some of the rows, (m,) int."""
        contexts = tuple(context.of(rows) for context in self.contexts)
        loads = tuple(load and load.of(rows) for load in self.loads)
        return replace(self, contexts=contexts, settling=self.settling[rows], begun=self.begun[rows], loads=loads)

    @property
    def slow(self) -> np.ndarray:
        """Cosines over the time of the run, (n, s)."""
        return next(context.shapes for context in self.contexts if context.name == "time")


def span_of(problem: Problem) -> Span:
    """Ranges and contexts of a run.

    Args:
        problem: the whole run.

    Returns:
        Its span.
    """
    view = problem.view
    q, p = view.q.numpy(), view.p.numpy()
    size = max(float(np.sqrt(np.square(p).mean())), 1e-9)
    contexts, settling, loads = tuple(_contexts(problem)), _settling(view.clock.numpy()), tuple(_loads(problem))
    return Span(column_ends(q), column_ends(p), size, contexts, problem.two_sided, settling, _begun(view), loads)


def _loads(problem: Problem) -> Iterator[Context | None]:
    """Loads of the joints: smooth functions of each, and the side on which it bears."""
    loads = loads_of(problem)
    for joint in range(problem.view.joints):
        name = load_name(problem, joint)
        if name not in loads:
            yield None
            continue
        eased = modulation(scaled(loads[name], column_ends(loads[name])))
        yield Context(name, np.column_stack([eased, np.sign(loads[name])]), eased, fields=False)


def _begun(view: View) -> np.ndarray:
    """Memory of how each run's first row was reached, (n, k, c); no columns where runs are many or long."""
    starts = view.starts.numpy()
    runs = int(starts.sum())
    if not 0 < runs <= MOST_RUNS or view.rows > MOST_REMEMBERED:
        return np.zeros((view.rows, view.joints, 0))
    left = initial_memory(view, view.q.amax(dim=0) - view.q.amin(dim=0)).numpy()
    own = np.cumsum(starts)[:, None] - 1 == np.arange(runs)  # shape: (n, run)
    return (left[:, :, None] * own[:, None, :, None]).reshape(view.rows, view.joints, -1)


def _settling(clock: np.ndarray) -> np.ndarray:
    """Functions of time: a level, a line, a parabola and two decaying exponentials, (n, 5).

    Few, so that they compete with a simple wander of the tracker. The level is the mean of what changes over the run.
    """
    first, last = column_ends(clock)
    share = (clock - first) / max(float(last - first), 1e-9)
    dying = [np.exp(-share / constant) for constant in SETTLING_SHARES]
    straight = 2.0 * share - 1.0
    return np.column_stack([np.ones_like(share), straight, np.square(straight), *dying])


def _contexts(problem: Problem) -> Iterator[Context]:
    """Contexts that vary in this run."""
    view = problem.view
    if "payload" in view.varies:
        load = reined(view.payload.numpy())
        yield _context("payload", np.column_stack([unit(load), unit(load**2)]))
    if "temperature" in view.varies:
        warm = reined(view.warmth.numpy())
        yield _context("temperature", np.column_stack([unit(warm), unit(warm**2)]))
        if "time" in view.varies:
            yield _context("memory of temperature", _memory(warm, view.time.numpy(), view.starts.numpy()), play=False)
    clock = view.clock.numpy()
    yield _context("time", cosines(scaled(clock, column_ends(clock)), TIME_COSINES), fields=False)
    if "speed" in view.varies:
        speed = reined(np.sqrt(np.square(view.velocity.numpy()).sum(axis=1)))
        yield _context("speed", np.column_stack([unit(speed - speed.mean()), unit(speed**2)]), fields=False)
        velocity = reined(view.velocity.numpy())
        signed = np.column_stack([velocity, velocity * np.abs(velocity)])
        signed /= np.maximum(np.sqrt(np.square(signed).mean(axis=0)), 1e-9)
        yield _context("velocity", signed, fields=False, play=False)
    feed = problem.table.feed_mm_s
    came, turns = ways_of(view.p.numpy(), view.starts.numpy())
    turns = reined(turns)
    yield _context("way", reined(np.column_stack(list(came))), fields=False, joints=False)
    if feed is None or np.ptp(feed := reined(np.nan_to_num(feed))) <= FEED_SHARE * feed.max():
        yield _context("turn", turns, fields=False, joints=False)
    else:  # the speed of the approach, also where readings were taken at a standstill
        yield _context("feed", _bowed(feed), fields=False)
        swift = np.column_stack([np.ones(view.rows), unit(feed), unit(feed**2)])
        yield _context("turn", product(turns, swift), fields=False, joints=False)
    for name, values in moves_of(problem).items():
        yield _context(name, _bowed(reined(_by_shares(values))), fields=False)
    for title, values in watched_values(problem.table).items():
        yield _context(title, _bowed(np.nan_to_num((held := reined(values)) - np.nanmean(held))))


def _context(name: str, shapes: np.ndarray, *, fields: bool = True, joints: bool = True, play: bool = True) -> Context:
    """A context whose first shape is the linear one; `play`: whether play may vary with it."""
    if not (joints and play):
        measure = np.zeros((len(shapes), 0))
    elif name == "time":
        measure = np.column_stack([np.ones(len(shapes)), shapes[:, :MODULATION_DEGREE]])
    else:
        measure = modulation(scaled(shapes[:, 0], column_ends(shapes[:, 0])))
    return Context(name, shapes, measure, fields, joints, shapes.mean(axis=0))


def _by_shares(values: np.ndarray) -> np.ndarray:
    """Logarithm of a length or a duration, (n,), as what settles decays by shares; unknown ones at the median."""
    known = np.isfinite(values) & (values > 0.0)
    return np.log(np.where(known, values, np.median(values[known])))


def _bowed(values: np.ndarray) -> np.ndarray:
    """Linear and quadratic function of a column, (n, 2)."""
    apart = unit(values - values.mean())
    return np.column_stack([apart, unit(apart**2 - np.mean(apart**2))])


def _memory(warm: np.ndarray, time: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Lag of bodies behind the measured temperature, one column for each time constant of `MEMORIES_S`, (n, 3)."""
    step = np.diff(time, prepend=time[:1])
    return np.column_stack([unit(trailing(warm, kept_shares(step, starts, lag)) - warm) for lag in MEMORIES_S])
