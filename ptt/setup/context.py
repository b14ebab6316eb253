"""Units of the context columns: temperature, payload, time, feed."""

from collections.abc import Callable

import numpy as np

from ptt.setup.clock import find_clock, find_feed
from ptt.setup.columns import HOTTEST, Result, heaviest, known, said, settled, shifted
from ptt.setup.result import Finding
from ptt.setup.setup import Setup
from ptt.setup.stray import find_stray

KELVIN = (230.0, 350.0)  # K: -43 to 77 deg C
FAHRENHEIT = (50.0, 140.0)  # 10 to 60 deg C; no workshop is that warm in deg C
GRAVITY = (9.80665, 9.81, 9.8)  # N/kg, as people round it
ROUND = 0.5  # kg: test weights are multiples of it
CLOSE = 0.01  # share of it: two loads are this near to multiples by chance once in some thousand runs
CLOSER = 2e-4  # the same for a single load


def find_units(setup: Setup) -> tuple[list[Finding], Setup]:
    """Columns in another unit than their title says.

    Args:
        setup: both files.

    Returns:
        Findings, and the files with the sure ones undone.
    """
    findings, setup = find_stray(setup)
    checks: tuple[Callable[[Setup], Result | None], ...] = (_temperature, _payload, find_clock, find_feed)
    for check in checks:
        told, setup = settled(setup, check(setup))
        findings += told
    return findings, setup


def _temperature(setup: Setup) -> Result | None:
    values, reference = known(setup.table.temp_c), setup.file.machine.reference_temp_c
    if not len(values) or abs(float(np.median(values)) - reference) < 30.0:
        return None  # both in the same unit, whatever it is: only differences count
    low, high = float(values.min()), float(values.max())
    span = f"temp_c runs from {low:.1f} to {high:.1f}"
    if low >= KELVIN[0] and high <= KELVIN[1]:
        words = f"{span}: in kelvin that is {low - 273.15:.1f} to {high - 273.15:.1f} deg C, as warm as a workshop"
        return said(setup, "temperature-unit", words, "rename the column temp_k"), shifted("temp_c", 1.0, -273.15)
    if low >= FAHRENHEIT[0] and high <= FAHRENHEIT[1]:
        cool, warm = (low - 32.0) / 1.8, (high - 32.0) / 1.8
        words = f"{span}: in Fahrenheit that is {cool:.1f} to {warm:.1f} deg C, as warm as a workshop"
        fix = "rename the column temp_f"
        return said(setup, "temperature-unit", words, fix), shifted("temp_c", 1.0 / 1.8, -32.0 / 1.8)
    if high > HOTTEST or low < -HOTTEST:
        return said(setup, "temperature-unit", f"{span} deg C: no machine is that warm", "say its unit"), None
    return None


def _payload(setup: Setup) -> Result | None:
    values = known(setup.table.payload_kg)
    loads = np.unique(np.round(values[values > 0.0], 6))
    if not len(loads):
        return None
    most = float(loads.max())
    limit = heaviest(setup.file.machine)
    if most > limit:
        words = (
            f"payload_kg reaches {most:,.0f}: in grams that is {most / 1e3:g} kg; "
            f"a machine of this size carries less than {limit:,.0f} kg"
        )
        finding = said(setup, "payload-unit", words, "rename the column payload_g", most / 1e3 <= limit)
        return finding, shifted("payload_kg", 1e-3, 0.0)
    close = CLOSE if len(loads) > 1 else CLOSER
    gravity = next((g for g in GRAVITY if _is_round(loads / g, close) and not _is_round(loads, CLOSE)), None)
    if gravity is None:
        return None
    shown = ", ".join(f"{load:g}" for load in loads[:4])
    masses = ", ".join(f"{load / gravity:.3g}" for load in loads[:4])
    words = f"payload_kg holds {shown}: taken as newtons these are round weights, {masses} kg"
    fix = f"divide the column by {gravity:g}"
    return said(setup, "payload-unit", words, fix, len(loads) > 1), shifted("payload_kg", 1.0 / gravity, 0.0)


def _is_round(values: np.ndarray, close: float) -> bool:
    steps = values / ROUND
    return bool((np.abs(steps - np.round(steps)) < close).all() and (np.round(steps) > 0).all())
