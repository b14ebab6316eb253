"""Quantised temperatures: interpolation between the steps of a thermometer's display."""

import numpy as np

from ptt.run.table import Table

COARSEST = 1.0  # K: thermometers resolve a degree or better; larger steps were entered by hand
HELD = 0.5  # least share of neighbouring rows with equal values from which values count as a display's
BY_ONE = 0.5  # least share of changes by one step; the others come after pauses
ALIKE = 1e-6  # share of a step by which numbers may be off a whole number of steps


def between_steps(table: Table) -> tuple[Table, list[str]]:
    """Interpolate temperature between the moments at which its display changes.

    When a display goes from 20.0 to 20.5 the temperature is 20.25 just then. Taken as shown it would be off by up to
    half a step over many rows in the same direction; with thermal growth of a hundred times the noise that would leave
    a trend in time that no effect explains.

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
    """Step of a display's values (n,), K; None where they are not those of a display."""
    changes = np.abs(np.diff(warmth))[np.diff(run) == 0]
    changes = changes[np.isfinite(changes)]
    return display_step(np.unique(warmth[np.isfinite(warmth)]), changes, len(changes))


def display_step(shown: np.ndarray, changes: np.ndarray, pairs: int) -> float | None:
    """The step of a thermometer's display.

    Args:
        shown: its values, ascending, each once.
        changes: sizes of its changes from row to row, K; zeros may be left out.
        pairs: number of neighbouring rows.

    Returns:
        K; None where the values are not those of a display.
    """
    if len(shown) < 3:
        return None
    step = float(np.diff(shown).min())
    beside = (shown - shown[0]) / step
    if step > COARSEST or np.abs(beside - np.round(beside)).max() > ALIKE * max(beside[-1], 1.0):
        return None
    moves = changes[changes > 0.5 * step]
    by_one = len(moves) > 0 and np.mean(moves < 1.5 * step) >= BY_ONE
    return step if by_one and len(moves) <= (1.0 - HELD) * pairs else None


def _passing(shown: np.ndarray, along: np.ndarray, half: float) -> np.ndarray:
    """Values (n,) interpolated between the moments at which the display changes, at most half a step off it."""
    passage = passage_of(shown, along, half)
    return shown if passage is None else along_passage(shown, along, passage, half)


Passage = tuple[np.ndarray, np.ndarray]  # moments (m,), ascending, and the temperature at each


def passage_of(shown: np.ndarray, along: np.ndarray, half: float) -> Passage | None:
    """The moments at which a display passes from step to step.

    Where it changes back to the step that it came from, the temperature between is taken as shown.

    Args:
        shown: values (n,), of the first and the last row and both rows of each change at least.
        along: time or number of each row, (n,), not falling.
        half: half a step, K.

    Returns:
        The moments and their temperatures; None where it changes less than twice, so that its rate is not known.
    """
    last = np.flatnonzero(np.diff(shown) != 0.0)  # rows before a change
    if len(last) < 2:
        return None
    when, level = 0.5 * (along[last] + along[last + 1]), 0.5 * (shown[last] + shown[last + 1])
    if (np.diff(when) <= 0.0).any():
        return None
    back = np.flatnonzero(np.diff(np.sign(shown[last + 1] - shown[last])) != 0.0)
    first = _end(shown[0], along[0], when[:2], level[:2], half)
    end = _end(shown[-1], along[-1], when[-2:][::-1], level[-2:][::-1], half)
    knots = np.r_[along[0], when, 0.5 * (when[back] + when[back + 1]), along[-1]]
    order = np.argsort(knots, kind="stable")
    return knots[order], np.r_[first, level, shown[last[back] + 1], end][order]


def along_passage(shown: np.ndarray, along: np.ndarray, passage: Passage, half: float) -> np.ndarray:
    """Temperatures (n,) along a passage, at most half a step off what is shown; arguments as of `passage_of`."""
    return np.clip(np.interp(along, *passage), shown - half, shown + half)


def _end(shown: float, along: float, when: np.ndarray, level: np.ndarray, half: float) -> float:
    """Value at an end: the mean of what is shown and of the line through the nearest two changes, within this step.

    Warming slows down, and beyond the last change its rate is not known.
    """
    on = level[0] + (level[1] - level[0]) / (when[1] - when[0]) * (along - when[0])
    return 0.5 * (shown + float(np.clip(on, shown - half, shown + half)))
