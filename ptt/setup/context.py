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
CLOSE = 0.01  # share of it, within which a load is a multiple: as people write one in kilograms
DIGITS = 6  # of a load that are looked at
BY_CHANCE = 0.01  # chance of loads in kilograms to be those of round weights in newtons, below which they are sure


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
    step = _step(loads)
    gravity = next((g for g in GRAVITY if _are_round(loads, g, step)), None)
    if gravity is None or (np.abs(loads / ROUND - np.round(loads / ROUND)) < CLOSE).all():
        return None
    masses = _weights(loads, gravity)
    shown, taken = (", ".join(f"{one:g}" for one in each[:4]) for each in (loads, masses))
    words = f"payload_kg holds {shown}: taken as newtons these are round weights, {taken} kg"
    fix = f"divide the column by {gravity:g}"
    sure = len(loads) > 1 and _chance(masses, step) < BY_CHANCE
    return said(setup, "payload-unit", words, fix, sure), shifted("payload_kg", 1.0 / gravity, 0.0)


def _step(loads: np.ndarray) -> float:
    """Step of the last digit that any of some loads has, kg."""
    digits = next((n for n in range(DIGITS) if np.allclose(loads, np.round(loads, n), rtol=0.0, atol=1e-9)), DIGITS)
    return float(10.0**-digits)


def _weights(loads: np.ndarray, gravity: float) -> np.ndarray:
    """The round weights nearest to loads in newtons, (n,) kg."""
    return np.asarray(np.round(loads / (gravity * ROUND)) * ROUND)


def _are_round(loads: np.ndarray, gravity: float, step: float) -> bool:
    """Whether loads in newtons are those of round weights, each to its last digit."""
    masses = _weights(loads, gravity)
    return bool((np.abs(loads - masses * gravity) <= 0.5 * step * (1.0 + 1e-6)).all() and (masses > 0.0).all())


def _chance(masses: np.ndarray, step: float) -> float:
    """Chance of loads in kilograms to look like round weights in newtons, for any of the usual gravities.

    Args:
        masses: the weights that they would be, n different ones, kg.
        step: of the loads' last digit.
    """
    # Loads are often multiples of the smallest one: those are no further coincidence.
    apart = masses[(np.arange(len(masses)) == 0) | (np.remainder(masses, masses[0]) > 0.0)]
    near = np.minimum(len(GRAVITY) * step, step + (max(GRAVITY) - min(GRAVITY)) * apart)
    each = near / (ROUND * GRAVITY[0])
    return float(np.prod(np.minimum(each, 1.0)))
