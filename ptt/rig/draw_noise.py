"""Kinds of tracker noise, of random sizes."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ptt.rig.draw_faults import log_uniform

Random = np.random.Generator
STATION_DISTANCE = 3000.0  # mm, where the tracker stands unless its noise says otherwise


def draw_noise(kind: str, seed: int) -> dict[str, Any]:
    """Draw a tracker's noise.

    Args:
        kind: of NOISES.
        seed: of the sizes.

    Returns:
        Keys and values of [tracker], with the station where the noise depends on its distance.
    """
    random = np.random.default_rng([seed, 73])
    values = NOISES[kind](random)
    if random.random() < 0.2:
        values["missing_share"] = float(random.uniform(0.01, 0.05))
    if random.random() < 0.3:
        values["report_std"] = True
    return values


def stated_sigma(values: dict[str, Any], distance: float) -> float:
    """Standard deviation of one coordinate as a data sheet states it, without wander, drift and gross errors.

    Args:
        values: keys and values of [tracker].
        distance: mm, from the tracker to the machine.

    Returns:
        Root mean square over the three coordinates, mm.
    """
    radial, sideways = values.get("radial_um", 1.0), values.get("sideways_um_per_m", 1.25) * distance * 1e-3
    white = 1e3 * values["white_mm"] if "white_mm" in values else np.sqrt((radial**2 + 2.0 * sideways**2) / 3.0)
    axes = np.mean(np.square(values.get("axis_um", (0.0,) * 3))) + values.get("quantum_um", 0.0) ** 2 / 12.0
    return float(1e-3 * np.sqrt(white**2 + axes))


def station(angle: float, away: float, height: float) -> list[float]:
    """Where a tracker stands at a polar angle (rad), so far away and so high (mm), to 0.1 mm."""
    return np.round([away * np.cos(angle), away * np.sin(angle), height], 1).tolist()


def _white(random: Random) -> dict[str, Any]:
    return {"white_mm": log_uniform(random, 0.0015, 0.007)}


def _heavy(random: Random) -> dict[str, Any]:
    return {"white_mm": log_uniform(random, 0.002, 0.005), "heavy_dof": float(random.uniform(2.5, 6.0))}


def _range(random: Random) -> dict[str, Any]:
    """A tracker so near that its distance, and with it the noise, changes much over the workspace."""
    angle, away = random.uniform(0.0, 2.0 * np.pi), random.uniform(700.0, 1500.0)
    return {
        "station_mm": station(angle, away, random.uniform(0.0, 400.0)),
        "radial_um": float(random.uniform(0.5, 2.0)),
        "sideways_um_per_m": log_uniform(random, 2.0, 6.0),
    }


def _anisotropic(random: Random) -> dict[str, Any]:
    """Little noise along the beam, much across it."""
    angle, away = random.uniform(0.0, 2.0 * np.pi), random.uniform(2500.0, 6000.0)
    return {
        "station_mm": station(angle, away, random.uniform(0.0, 1500.0)),
        "radial_um": float(random.uniform(0.4, 1.0)),
        "sideways_um_per_m": log_uniform(random, 0.6, 1.6),
    }


def _quantised(random: Random) -> dict[str, Any]:
    """Readings rounded to a coarse step; with noise below a third of it, repeats would all be the same."""
    quantum = float(random.choice([1.0, 2.0, 5.0, 10.0]))
    return {"quantum_um": quantum, "white_mm": 1e-3 * max(quantum * float(random.uniform(0.35, 0.8)), 1.5)}


def _wander(random: Random) -> dict[str, Any]:
    """Wander of 0.3 to 2.5 times the white noise, correlated over half a minute to 80 minutes."""
    white = log_uniform(random, 0.0015, 0.004)
    share, slow = log_uniform(random, 0.3, 2.5), log_uniform(random, 30.0, 5000.0)
    return {"white_mm": white, "wander_um": 1e3 * white * share, "wander_s": slow}


def _outliers(random: Random) -> dict[str, Any]:
    share, size = float(random.uniform(0.01, 0.08)), log_uniform(random, 0.05, 1.0)
    return {**_white(random), "outlier_share": share, "outlier_mm": size}


def _axes(random: Random) -> dict[str, Any]:
    """One axis up to six times as noisy as another."""
    return {"white_mm": 0.001, "axis_um": np.round(np.exp(random.uniform(np.log(1.5), np.log(9.0), 3)), 3).tolist()}


def _mixed(random: Random) -> dict[str, Any]:
    """Anisotropic noise of heavy tails with rounding, wander and gross errors."""
    drawn = {**_anisotropic(random), "heavy_dof": float(random.uniform(3.0, 8.0)), "quantum_um": 1.0}
    drawn |= {"wander_um": log_uniform(random, 1.0, 4.0), "wander_s": log_uniform(random, 60.0, 2000.0)}
    return {**drawn, "outlier_share": float(random.uniform(0.0, 0.03))}


NOISES: dict[str, Callable[[Random], dict[str, Any]]] = {
    "white": _white,
    "heavy": _heavy,
    "range": _range,
    "anisotropic": _anisotropic,
    "quantised": _quantised,
    "wander": _wander,
    "outliers": _outliers,
    "axes": _axes,
    "mixed": _mixed,
}
