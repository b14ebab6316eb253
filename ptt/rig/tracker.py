"""The laser tracker: readings of reflectors whose true positions in the base frame are known."""

from dataclasses import dataclass

import numpy as np

from ptt.machine_schema import BasePoint
from ptt.rig.nominal import Array
from ptt.rig.platform import rotation_matrix
from ptt.rig.schema import Tracker
from ptt.rig.units import MM_PER_UM, PPM, RAD_PER_MRAD


@dataclass(frozen=True)
class Reading:
    """Readings of the tracker.

    Attributes:
        measured: (n, 3) mm, frame of the readings; NaN where the reflector was not observed.
        std: (n, 3) mm, standard deviation of each coordinate as the tracker states it.
        outlier: (n,) bool, grossly wrong readings.
    """

    measured: Array
    std: Array
    outlier: Array


def read_points(
    tracker: Tracker, point: Array, time: Array, run: Array, *, seed: int, setup_seed: int, noise: bool
) -> Reading:
    """Read reflectors.

    In this order: scale (of wavelength) about the station, noise along the beam and across it, wander, gross errors,
    drift and knock of the stand, rigid motion into the frame of the readings, noise of its axes, rounding.

    Args:
        tracker: station, frame and faults.
        point: (n, 3) mm, true positions in the base frame.
        time: (n,) s; drift and a knock at a time count from the first row.
        run: (n,) int, each run may have its own set-up.
        seed: of the noise.
        setup_seed: of the set-ups, the same when the run is repeated.
        noise: False leaves out everything random but the set-ups, and the rounding.

    Returns:
        The readings.
    """
    station = np.asarray(tracker.station_mm)
    away = point - station
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    beam = away / np.maximum(distance, 1e-9)
    radial, transverse = _sigmas(tracker, distance)
    read = station + (1.0 + PPM * tracker.scale_ppm) * away
    axis_noise = np.zeros_like(point)
    outlier = np.zeros(len(point), dtype=bool)
    missing = np.zeros(len(point), dtype=bool)
    if noise:
        white = _white(tracker, np.random.default_rng([seed, 1]), point.shape)
        along = (white * beam).sum(1, keepdims=True) * beam
        read = read + radial * along + transverse * (white - along)
        read = read + _wander(tracker, time, np.random.default_rng([seed, 2]))
        axis_noise = np.random.default_rng([seed, 8]).normal(size=point.shape) * MM_PER_UM * np.asarray(tracker.axis_um)
        gross = np.random.default_rng([seed, 3])
        outlier = gross.random(len(point)) < tracker.outlier_share
        missing = gross.random(len(point)) < tracker.missing_share
        jump = gross.normal(size=point.shape)
        jump *= (1.0 + gross.exponential(size=(len(point), 1))) / np.linalg.norm(jump, axis=1, keepdims=True)
        read = read + np.where(outlier[:, None], tracker.outlier_mm * jump, 0.0)
    read = read + _drift(tracker, time - time[0])
    read = _knock(tracker, read, time)
    turn, shift = _setups(tracker, run, np.random.default_rng([setup_seed, 4]))
    read = np.einsum("nij,nj->ni", turn, read) + shift + axis_noise
    if noise and tracker.quantum_um:
        read = np.round(read / (MM_PER_UM * tracker.quantum_um)) * MM_PER_UM * tracker.quantum_um
    beam = np.einsum("nij,nj->ni", turn, beam)
    std = np.sqrt((radial * beam) ** 2 + transverse**2 * (1.0 - beam**2) + _axis_sigma(tracker) ** 2)
    return Reading(np.where(missing[:, None], np.nan, read), std, outlier)


def place_base(points: tuple[BasePoint, ...], seed: int, *, exact: bool) -> dict[str, Array]:
    """True positions of the base reflectors, which the machine file states with an error of their sigma.

    Args:
        points: of the machine file.
        seed: of the machine.
        exact: take the stated positions as true.

    Returns:
        Name -> (3,) mm, base frame.
    """
    error = np.random.default_rng([seed, 5]).normal(size=(len(points), 3)) * (0.0 if exact else 1.0)
    return {
        point.name: np.asarray(point.xyz_mm) + point.sigma_mm * error[number] for number, point in enumerate(points)
    }


def _sigmas(tracker: Tracker, distance: Array) -> tuple[Array, Array]:
    """Standard deviations along the beam and of each direction across it, (n, 1) mm each."""
    if tracker.white_mm is not None:
        both = np.full_like(distance, tracker.white_mm)
        return both, both
    radial = np.full_like(distance, MM_PER_UM * tracker.radial_um)
    return radial, MM_PER_UM * tracker.sideways_um_per_m * distance * 1e-3


def _white(tracker: Tracker, random: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Independent noise of unit variance, normal or of Student's t."""
    if tracker.heavy_dof is None:
        return random.normal(size=shape)
    dof = tracker.heavy_dof
    return random.standard_t(dof, size=shape) * np.sqrt((dof - 2.0) / dof)


def _axis_sigma(tracker: Tracker) -> Array:
    """Standard deviation of the noise of each axis of the readings, rounding (step / sqrt 12) included, (3,) mm."""
    return MM_PER_UM * np.hypot(np.asarray(tracker.axis_um), tracker.quantum_um / np.sqrt(12.0))


def _wander(tracker: Tracker, time: Array, random: np.random.Generator) -> Array:
    """Slow random wander of air and stand, (n, 3) mm.

    Source: stationary Ornstein-Uhlenbeck process of each coordinate, exact between readings.
    """
    kick = random.normal(size=(len(time), 3))
    if tracker.wander_um == 0.0:
        return np.zeros_like(kick)
    keep = np.exp(-np.diff(time, prepend=-np.inf) / tracker.wander_s)
    state, out = np.zeros(3), np.empty_like(kick)
    for number in range(len(time)):
        state = keep[number] * state + np.sqrt(1.0 - keep[number] ** 2) * kick[number]
        out[number] = state
    return MM_PER_UM * tracker.wander_um * out


def _drift(tracker: Tracker, elapsed: Array) -> Array:
    """Steady drift and drift that settles exponentially, (n, 3) mm."""
    steady = np.outer(elapsed / 3600.0, tracker.drift_um_per_h)
    settling = np.outer(-np.expm1(-elapsed / tracker.drift_constant_s), tracker.drift_um)
    return MM_PER_UM * (steady + settling)


def _knock(tracker: Tracker, read: Array, time: Array) -> Array:
    """Readings in which everything has moved like a rigid body, about the base frame's origin, from the knock on."""
    if tracker.knock_row is not None:
        after = np.arange(len(read)) >= tracker.knock_row
    elif tracker.knock_time_s is not None:
        after = time - time[0] >= tracker.knock_time_s
    else:
        return read
    turn = rotation_matrix(RAD_PER_MRAD * np.asarray([tracker.knock_mrad]))[0]
    return np.where(after[:, None], read @ turn.T + MM_PER_UM * np.asarray(tracker.knock_um), read)


def _setups(tracker: Tracker, run: Array, random: np.random.Generator) -> tuple[Array, Array]:
    """Rotation (n, 3, 3) and translation (n, 3) mm from the base frame to the frame of the readings."""
    runs = int(run.max()) + 1
    scatter = random.normal(size=(runs, 2, 3))
    vector = RAD_PER_MRAD * (np.asarray(tracker.rotation_mrad) + tracker.frame_scatter_mrad * scatter[:, 0])
    shift = np.asarray(tracker.translation_mm) + tracker.frame_scatter_mm * scatter[:, 1]
    return rotation_matrix(vector)[run], shift[run]
