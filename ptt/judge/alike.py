"""Hints where two runs that are compared were measured under different conditions."""

import numpy as np

from ptt.errors import TableError
from ptt.judge.evaluation import Evaluation
from ptt.judge.run_errors import errors_of
from ptt.run.axes import rms_length
from ptt.run.repeats import SAME_FEED, SAME_LOAD, SAME_WARMTH
from ptt.run.same_pose import same_places
from ptt.run.table import Table

CONDITIONS = (  # column, its name, its unit, and the difference beyond which it is not the same
    ("payload_kg", "payload", "kg", SAME_LOAD),
    ("temp_c", "temperature", "K", SAME_WARMTH),
    ("feed_mm_s", "feed", "mm/s", SAME_FEED),
)
APART = 0.5  # ratio of the error with a frame per run to that with a common one, below which the former is likely meant


def hints_on(before: Table, after: Table, result: Evaluation, *, told: bool) -> tuple[str, ...]:
    """Hints on differences that make a comparison of two runs doubtful.

    Args:
        before: the first run.
        after: the second.
        result: their evaluation.
        told: whether the frame policy was stated by the user or a machine file.

    Returns:
        One sentence for each difference.
    """
    alone = () if told else _frames(before, after)
    return (*alone, *_visits(before, after, result), *_conditions(before, after, result.matched))


def _frames(before: Table, after: Table) -> tuple[str, ...]:
    """Hint where the tracker seems to have been set up anew for each run of a table."""
    for side, table in (("BEFORE", before), ("AFTER", after)):
        if not table.run.any():
            continue
        try:
            whole, own = (_size(errors_of(table, None, way).aligned) for way in ("fitted", "fitted-per-run"))
        except TableError:  # too few poses in one run
            continue
        if own < APART * whole:
            return (
                f"one tracker frame for all {table.run.max() + 1} runs of {side} leaves {whole:.1f} um, one for each "
                f"{own:.1f} um; was the tracker set up anew for each run? Then give --frame fitted-per-run, or "
                "--model M of a machine file that says so",
            )
    return ()


def _size(error: np.ndarray) -> float:
    """Rms length of error vectors (n, 3) mm, in um; rows with NaN are left out."""
    return 1e3 * rms_length(error[np.isfinite(error).all(axis=1)])


def _visits(before: Table, after: Table, result: Evaluation) -> tuple[str, ...]:
    """Hint where one run visits the common poses more often, so that many of its readings have no counterpart."""
    words = []
    for side, table, matched in zip(("BEFORE", "AFTER"), (before, after), result.matched, strict=True):
        place = same_places(table.target)
        known = np.isfinite(table.measured).all(axis=1) & np.isfinite(table.target).all(axis=1)
        seen = known & (table.role != "base") & np.isin(place, place[matched])
        if seen.sum() >= 2 * len(matched):
            words.append(
                f"{side} measures the same poses {seen.sum() / len(matched):.3g} times as often as the other run: "
                "visits are paired in order, and the rest do not count"
            )
    return tuple(words)


def _conditions(before: Table, after: Table, matched: tuple[np.ndarray, np.ndarray]) -> tuple[str, ...]:
    """Hints where matched rows differ in load, temperature or feed, or where only one run records them."""
    words = []
    for column, name, unit, same in CONDITIONS:
        own, other = (
            np.full(len(rows), np.nan) if (values := getattr(table, column)) is None else values[rows]
            for table, rows in zip((before, after), matched, strict=True)
        )
        apart = np.abs(other - own)
        far = apart > same  # False where either is NaN
        if far.any():
            words.append(
                f"{far.sum()} of {len(far)} rows of AFTER were measured at another {name} than in BEFORE, up to "
                f"{apart[far].max():.3g} {unit} off; commands are right for the {name} that they were made for"
            )
        for side, silent, telling in (("AFTER", other, own), ("BEFORE", own, other)):
            known = telling[np.isfinite(telling)]
            if np.isnan(silent).all() and len(known) and np.ptp(known) > same:
                words.append(f"{side} has no {column}, which changes by {np.ptp(known):.3g} {unit} in the other run")
    return tuple(words)
