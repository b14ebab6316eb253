"""Units and noise of the columns beside the geometry: temperature, payload, time, feed, what a reading scatters by."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ptt.machine import ThreePttSpec
from ptt.setup.names import Mistake
from ptt.setup.result import Finding
from ptt.setup.rows import places
from ptt.setup.setup import Setup, Undo, used_rows

KELVIN = (230.0, 350.0)  # K: -43 to 77 deg C
FAHRENHEIT = (50.0, 140.0)  # 10 to 60 deg C, where no workshop is that warm in deg C
HOTTEST = 100.0  # deg C: beyond it no machine is measured
GRAVITY = (9.80665, 9.81, 9.8)
HEAVIEST = 100.0  # kg on a machine of up to a metre; larger ones carry with the cube of their size
ROUND = 0.5  # kg: weights that people hang on
CLOSE = 0.01  # of that: two loads hit round weights by chance once in some thousand runs
CLOSER = 2e-4  # of that, where there is a single load
LONGEST_STEP, LONGEST_RUN = 600.0, 2.0 * 86400.0  # s: slower runs are rare, slower still and long ones are in ms
FEW = 10  # rows: fewer show no rule
EPOCH_MS = 1e11  # s since 1970 are 1.8e9
FASTEST = {"three-ptt": 2000.0, "serial": 15000.0}  # mm/s: ball screws, arms
BEYOND_FAULTS = 2.0  # mm: what a machine with ordinary faults never returns to a pose by
STATED_TOO_LARGE, SCATTER_TOO_LARGE = 20.0, 10.0

Result = tuple[Finding, Undo | None]


def find_units(setup: Setup) -> tuple[list[Finding], Setup]:
    """Columns in another unit than their title says, and noise that cannot be.

    Args:
        setup: both files.

    Returns:
        Findings, and the files with the sure ones undone.
    """
    findings = []
    checks: tuple[Callable[[Setup], Result | None], ...] = (_temperature, _payload, _clock, _feed)
    for check in checks:
        found = check(setup)
        if found is not None:
            findings.append(found[0])
            setup = found[1](setup) if found[1] is not None and found[0].sure else setup
    return findings, setup


def find_noise(setup: Setup) -> tuple[list[Finding], Setup]:
    """Noise as stated against what repeats scatter by.

    Args:
        setup: both files.

    Returns:
        At most one finding, and the files with the noise restated where that is sure.
    """
    found = _noise(setup)
    if found is None:
        return [], setup
    return [found[0]], found[1](setup) if found[1] is not None else setup


def _temperature(setup: Setup) -> Result | None:
    values, reference = _known(setup.table.temp_c), setup.file.machine.reference_temp_c
    if not len(values) or abs(float(np.median(values)) - reference) < 30.0:
        return None  # both in the same unit, whatever it is: only differences count
    low, high = float(values.min()), float(values.max())
    span = f"temp_c runs from {low:.1f} to {high:.1f}"
    if low >= KELVIN[0] and high <= KELVIN[1]:
        words = f"{span}: in kelvin that is {low - 273.15:.1f} to {high - 273.15:.1f} deg C, as warm as a workshop"
        return _said(setup, "temperature-unit", words, "rename the column temp_k"), _shifted("temp_c", 1.0, -273.15)
    if low >= FAHRENHEIT[0] and high <= FAHRENHEIT[1]:
        cool, warm = (low - 32.0) / 1.8, (high - 32.0) / 1.8
        words = f"{span}: in Fahrenheit that is {cool:.1f} to {warm:.1f} deg C, as warm as a workshop"
        fix = "turn the column into deg C: (value - 32) / 1.8"
        return _said(setup, "temperature-unit", words, fix), _shifted("temp_c", 1.0 / 1.8, -32.0 / 1.8)
    if high > HOTTEST or low < -HOTTEST:
        return _said(setup, "temperature-unit", f"{span} deg C: no machine is that warm", "say its unit"), None
    return None


def _payload(setup: Setup) -> Result | None:
    values = _known(setup.table.payload_kg)
    loads = np.unique(np.round(values[values > 0.0], 6))
    if not len(loads):
        return None
    most = float(loads.max())
    limit = HEAVIEST * max(1.0, _size(setup) / 1000.0) ** 3
    if most > limit:
        words = (
            f"payload_kg reaches {most:,.0f}: in grams that is {most / 1e3:g} kg; "
            f"a machine of this size carries less than {limit:,.0f} kg"
        )
        said = _said(setup, "payload-unit", words, "rename the column payload_g", most / 1e3 <= limit)
        return said, _shifted("payload_kg", 1e-3, 0.0)
    close = CLOSE if len(loads) > 1 else CLOSER
    gravity = next((g for g in GRAVITY if _is_round(loads / g, close) and not _is_round(loads, CLOSE)), None)
    if gravity is None:
        return None
    shown = ", ".join(f"{load:g}" for load in loads[:4])
    masses = ", ".join(f"{load / gravity:.3g}" for load in loads[:4])
    words = f"payload_kg holds {shown}: taken as newtons these are round weights, {masses} kg"
    fix = f"divide the column by {gravity:g}"
    return _said(setup, "payload-unit", words, fix, len(loads) > 1), _shifted("payload_kg", 1.0 / gravity, 0.0)


def _is_round(values: np.ndarray, close: float) -> bool:
    steps = values / ROUND
    return bool((np.abs(steps - np.round(steps)) < close).all() and (np.round(steps) > 0).all())


def _clock(setup: Setup) -> Result | None:
    table = setup.table
    if table.time_s is None:
        return None
    time = np.asarray(table.time_s, dtype=float)
    rows = used_rows(table) & np.isfinite(time)
    time = time[rows]
    if len(time) < 5:
        return None
    steps = np.diff(time)
    steps = steps[steps > 0.0]
    if not len(steps):
        return None
    usual, whole = float(np.median(steps)), float(np.ptp(time))
    paces = _pace(setup, rows)
    pace, paced = float(np.median(paces[:, 0])) if len(paces) >= 5 else None, _paced(paces)
    slow = usual > LONGEST_STEP and whole > LONGEST_RUN
    unhurried = pace is not None and pace > 300.0 and usual > LONGEST_STEP
    if float(np.abs(time).max()) > EPOCH_MS or slow or paced or unhurried:
        words = (
            f"time_s steps by {usual:,.0f} from row to row, {whole / 86400.0:,.1f} days in all: "
            f"in milliseconds that is {usual / 1e3:.3g} s a row"
        )
        sure = usual / 1e3 < LONGEST_STEP and (slow or paced or float(np.abs(time).max()) > EPOCH_MS)
        return _said(setup, "time-unit", words, "rename the column time_ms", sure), _shifted("time_s", 1e-3, 0.0)
    if pace is not None and pace < 0.1:
        words = (
            f"by time_s the tool moved {1.0 / pace:,.0f} times as fast as feed_mm_s says: "
            "one of the two is in another unit"
        )
        return _said(setup, "time-unit", words, "rename the column: time_min, or feed_mm_min", False), None
    return None


def _pace(setup: Setup, rows: np.ndarray) -> np.ndarray:
    """How many times longer each row took than its path does at the feed, and what that would take in s, (m, 2)."""
    feed, time = setup.table.feed_mm_s, setup.table.time_s
    if feed is None or time is None:
        return np.zeros((0, 2))
    path = np.linalg.norm(np.diff(places(setup)[rows], axis=0), axis=1)
    steps, speed = np.diff(np.asarray(time)[rows]), np.asarray(feed)[rows][1:]
    good = (path > 0.0) & (steps > 0.0) & (speed > 0.0) & np.isfinite(path * steps * speed)
    return np.stack([steps[good] * speed[good] / path[good], path[good] / speed[good]], axis=1)


def _paced(pace: np.ndarray) -> bool:
    """Whether every row took a thousand times as long as its path does: waiting does not grow with the path."""
    if len(pace) < FEW:
        return False
    (low, usual, high), (short, _, long) = np.percentile(pace, [10.0, 50.0, 90.0], axis=0).T
    return bool(300.0 < usual < 3000.0 and high < 1.5 * low and long > 2.0 * short)


def _feed(setup: Setup) -> Result | None:
    values = _known(setup.table.feed_mm_s)
    limit = FASTEST[setup.file.machine.kind]
    if not len(values) or float(np.median(values)) <= limit:
        return None
    usual = float(np.median(values))
    words = (
        f"feed_mm_s is {usual:,.0f}: in mm/min that is {usual / 60.0:,.0f} mm/s; "
        f"no such machine moves faster than {limit:,.0f} mm/s"
    )
    sure = usual / 60.0 <= limit
    return _said(setup, "time-unit", words, "rename the column feed_mm_min", sure), _shifted(
        "feed_mm_s", 1.0 / 60.0, 0.0
    )


def _noise(setup: Setup) -> Result | None:
    """Stated noise against what repeats of a pose in a row scatter by."""
    stated, source = _stated(setup)
    found = repeat_scatter(setup)
    if stated is None or found is None:
        return None
    scatter, count = found
    if stated > STATED_TOO_LARGE * scatter and stated > 0.2:
        words = (
            f"{source} says that a coordinate scatters by {1e3 * stated:,.0f} um; "
            f"{count} repeats scatter by {1e3 * scatter:.1f} um"
        )
        fix = f"state it in mm: {scatter:.2g}"
        return _said(setup, "noise-implausible", words, fix), _restated(source, scatter / stated)
    still = repeat_scatter(setup, still=True)
    scatter, count = still if still is not None else found
    if scatter > SCATTER_TOO_LARGE * stated and (still is not None or scatter > BEYOND_FAULTS):
        words = f"{count} repeats scatter by {1e3 * scatter:,.1f} um, {source} says {1e3 * stated:.1f} um"
        fix = "look for what changed between the repeats, or state the noise in mm"
        return _said(setup, "noise-implausible", words, fix, False), None
    return None


def _stated(setup: Setup) -> tuple[float | None, str]:
    std = setup.table.std
    if std is not None and np.isfinite(std).any():
        return float(np.nanmedian(std)), "the std columns"
    return setup.file.tracker.sigma_mm, "sigma_mm of the machine file"


def _restated(source: str, factor: float) -> Undo:
    factor = 1e-3 if 1e-4 < factor < 1e-2 else factor  # um in a column of mm

    def undo(setup: Setup) -> Setup:
        if "std" in source and setup.table.std is not None:
            return setup.with_rows(std=setup.table.std * factor)
        sigma = float(f"{(setup.file.tracker.sigma_mm or 0.0) * factor:.2g}")
        tracker = setup.file.tracker.model_copy(update={"sigma_mm": sigma})
        return replace(setup, file=replace(setup.file, tracker=tracker))

    return undo


def repeat_scatter(setup: Setup, still: bool = False) -> tuple[float, int] | None:
    """Scatter of one coordinate over readings of a pose that was reached in the same way, mm.

    Args:
        setup: both files.
        still: only readings between which nothing moved: what scatters there is the tracker.

    Returns:
        Scatter, by the median so that what changed between visits counts little, and how many repeats; None where
        there are fewer than ten.
    """
    place, reading = places(setup), setup.table.measured
    if still:
        apart = np.diff(reading, axis=0)[np.linalg.norm(np.diff(place, axis=0), axis=1) < 1e-6]
        return _scatter(apart[np.isfinite(apart).all(axis=1)])
    arrival = np.sign(np.round(np.diff(place, axis=0, prepend=place[:1]), 4))
    others = [setup.table.run, setup.table.payload_kg]
    beside = [np.nan_to_num(np.asarray(column, dtype=float)) for column in others if column is not None]
    key = np.column_stack([np.round(place, 3), arrival, *beside])
    good = np.isfinite(key).all(axis=1) & np.isfinite(reading).all(axis=1)
    key, reading = key[good], reading[good]
    if len(key) < 10:
        return None
    order = np.lexsort(key.T)
    same = (np.abs(np.diff(key[order], axis=0)) < 2e-3).all(axis=1)
    return _scatter(np.diff(reading[order], axis=0)[same])


def _scatter(apart: np.ndarray) -> tuple[float, int] | None:
    """Standard deviation of one reading by differences between two."""
    if len(apart) < 10:
        return None
    return float(np.median(np.abs(apart)) / 0.6745 / np.sqrt(2.0)) + 1e-9, len(apart)


def _known(values: np.ndarray | None) -> np.ndarray:
    return np.zeros(0) if values is None else np.asarray(values, dtype=float)[np.isfinite(values)]


def _size(setup: Setup) -> float:
    spec = setup.file.machine
    if isinstance(spec, ThreePttSpec):
        return 2.0 * spec.link_length_mm
    return float(sum(np.hypot(joint.a_mm, joint.d_mm) for joint in spec.joint))


def _said(setup: Setup, mistake: Mistake, words: str, fix: str, sure: bool = True) -> Finding:
    return Finding(mistake, words, fix, None, None, sure, setup.table.source)


def _shifted(field: str, factor: float, offset: float) -> Undo:
    return lambda setup: setup.with_rows(**{field: np.asarray(getattr(setup.table, field)) * factor + offset})
