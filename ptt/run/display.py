"""A thermometer's display: warmth goes on between the steps that it shows."""

import numpy as np

from ptt.run.table import Table

COARSEST = 1.0  # K: no thermometer shows less than whole degrees; what goes further at once was set by somebody
HELD = 0.5  # share of neighbouring rows that show the same, from which a display is said to stand still
BY_ONE = 0.5  # share of its changes that are of one step; the others are pauses, or somebody sets what it shows
ALIKE = 1e-6  # of a step, by which written numbers may lie beside the steps of a display


def between_steps(table: Table) -> tuple[Table, list[str]]:
    """Take temperature as it passes from one step of its display to the next, not as the display stands.

    A display that goes from 20.0 to 20.5 says that it is 20.25 just then, and says nothing of that sort where it
    stands. Taken as it stands it is off by up to half a step for as many rows as it does, all in one direction; growth
    that is a hundred times the noise would leave a course in time that no effect follows.

    Args:
        table: n rows in order of measuring.

    Returns:
        The table, and a line on what was done, none where nothing was.
    """
    warmth = table.temp_c
    step = None if warmth is None else _step(warmth, table.run)
    if warmth is None or step is None:
        return table, []
    clock, taken = table.time_s, warmth.copy()
    for code in np.unique(table.run):
        rows = np.flatnonzero((table.run == code) & np.isfinite(warmth))
        along = rows.astype(float)
        if clock is not None and np.isfinite(clock[rows]).all() and (np.diff(clock[rows]) >= 0.0).all():
            along = clock[rows]
        taken[rows] = _passing(warmth[rows], along, 0.5 * step)
    if np.array_equal(taken, warmth, equal_nan=True):
        return table, []
    line = f"temp_c is recorded in steps of {step:.3g} K: interpolated between the moments at which it changes"
    return table.replace(temp_c=taken), [line]


def _step(warmth: np.ndarray, run: np.ndarray) -> float | None:
    """Width of the steps in which values (n,) are shown that stand still for some rows, K; None where they do not."""
    shown = np.unique(warmth[np.isfinite(warmth)])
    if len(shown) < 3:
        return None
    step = float(np.diff(shown).min())
    beside = (shown - shown[0]) / step
    if step > COARSEST or np.abs(beside - np.round(beside)).max() > ALIKE * max(beside[-1], 1.0):
        return None
    changes = np.abs(np.diff(warmth))[np.diff(run) == 0]
    changes = changes[np.isfinite(changes)]
    moves = changes[changes > 0.5 * step]
    by_one = len(moves) > 0 and np.mean(moves < 1.5 * step) >= BY_ONE
    return step if by_one and len(moves) <= (1.0 - HELD) * len(changes) else None


def _passing(shown: np.ndarray, along: np.ndarray, half: float) -> np.ndarray:
    """Values (n,) on lines between the moments at which the display changes, never further off than half a step.

    Where it goes back to the step that it came from, it was about what is shown between.
    """
    last = np.flatnonzero(np.diff(shown) != 0.0)  # rows before a change
    if len(last) < 2:  # how fast it goes is not told
        return shown
    when, level = 0.5 * (along[last] + along[last + 1]), 0.5 * (shown[last] + shown[last + 1])
    if (np.diff(when) <= 0.0).any():
        return shown
    back = np.flatnonzero(np.diff(np.sign(shown[last + 1] - shown[last])) != 0.0)
    first = _end(shown[0], along[0], when[:2], level[:2], half)
    end = _end(shown[-1], along[-1], when[-2:][::-1], level[-2:][::-1], half)
    knots = np.r_[along[0], when, 0.5 * (when[back] + when[back + 1]), along[-1]]
    order = np.argsort(knots, kind="stable")
    level = np.r_[first, level, shown[last[back] + 1], end]
    return np.clip(np.interp(along, knots[order], level[order]), shown - half, shown + half)


def _end(shown: float, along: float, when: np.ndarray, level: np.ndarray, half: float) -> float:
    """Where it stands at an end: between what is shown and as far on as between the nearest changes, in this step.

    What warms up slows down, and by how much no further change tells.
    """
    on = level[0] + (level[1] - level[0]) / (when[1] - when[0]) * (along - when[0])
    return 0.5 * (shown + float(np.clip(on, shown - half, shown + half)))
