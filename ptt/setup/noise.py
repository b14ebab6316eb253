"""Stated noise compared with the scatter of repeated poses, or with the whole residual where no pose was repeated."""

from dataclasses import replace

import numpy as np

from ptt.run.holdout import pose_groups
from ptt.run.tails import median_sigma
from ptt.setup.columns import Result, said, settled
from ptt.setup.proof import BEYOND_FAULTS
from ptt.setup.result import Finding
from ptt.setup.rigid import align_many
from ptt.setup.rows import places
from ptt.setup.setup import Setup, Undo

STATED_TOO_LARGE, SCATTER_TOO_LARGE = 20.0, 10.0  # ratios of stated noise to scatter, and of scatter to stated noise
LARGE = 0.2  # mm: no noise below is called implausibly large
BEYOND_ALL = 5.0  # times the whole residual, faults included: an accuracy stated at three sigma stays below
ROWS = 30  # readings that a rigid motion cannot follow
FEWEST = 10  # repeats for an estimate of the scatter
MEDIAN_3D = 1.538  # median length of a vector of three normal coordinates with sigma 1 (chi, 3 degrees of freedom)


def find_noise(setup: Setup) -> tuple[list[Finding], Setup]:
    """Stated noise that contradicts the scatter of repeats.

    Args:
        setup: both files.

    Returns:
        At most one finding, and the files with the noise restated where that is sure.
    """
    return settled(setup, _noise(setup))


def _noise(setup: Setup) -> Result | None:
    """Stated noise against the scatter of repeats of a pose; without repeats against the whole residual."""
    stated, source = _stated(setup)
    if stated is None:
        return None
    still = repeat_scatter(setup, still=True)
    found = repeat_scatter(setup) or still
    if not stated > 0.0:
        words = f"{source} {_say(source)} that nothing scatters: treated as not stated"
        return said(setup, "noise-implausible", words, "fill the columns, or leave them out", False), None
    if found is None:
        return _beyond_all(setup, stated, source)
    scatter, count = found
    if stated > STATED_TOO_LARGE * scatter and stated > LARGE:
        words = (
            f"{source} {_say(source)} that a coordinate scatters by {1e3 * stated:,.0f} um; "
            f"{count} repeats scatter by {1e3 * scatter:.1f} um"
        )
        fix = f"state it in mm: {scatter:.2g}"
        return said(setup, "noise-implausible", words, fix), _restated(source, scatter / stated)
    scatter, count = still if still is not None else found
    if scatter > SCATTER_TOO_LARGE * stated and (still is not None or scatter > BEYOND_FAULTS):
        words = f"{count} repeats scatter by {1e3 * scatter:,.1f} um, {source} {_say(source)} {1e3 * stated:.1f} um"
        fix = "look for what changed between the repeats, or state the noise in mm"
        return said(setup, "noise-implausible", words, fix, False), None
    return None


def _beyond_all(setup: Setup, stated: float, source: str) -> Result | None:
    """Stated noise against the whole residual of the readings, where no pose was repeated."""
    place, reading = places(setup), setup.table.measured
    known = np.isfinite(place).all(axis=1) & np.isfinite(reading).all(axis=1)
    if known.sum() < ROWS or stated <= LARGE:
        return None
    off = float(np.median(align_many(place[known][None], reading[known][None])[2])) / MEDIAN_3D + 1e-9
    if stated < BEYOND_ALL * off:
        return None
    words = (
        f"{source} {_say(source)} that a coordinate scatters by {1e3 * stated:,.0f} um, "
        f"yet the machine's whole error is {1e3 * off:.1f} um"
    )
    factor = 1e-3 if 1e-3 * stated < off else off / stated  # um in a column of mm
    return said(setup, "noise-implausible", words, f"state it in mm: {factor * stated:.2g}"), _restated(source, factor)


def _stated(setup: Setup) -> tuple[float | None, str]:
    std = setup.table.std
    if std is not None and np.isfinite(std).any():
        return float(np.nanmedian(std)), "the std columns"
    return setup.file.tracker.sigma_mm, "sigma_mm of the machine file"


def _say(source: str) -> str:
    return "say" if source.endswith("columns") else "says"


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
    """Scatter of one coordinate, mm, over readings of a pose that was approached from the same direction.

    Args:
        setup: both files.
        still: only consecutive readings between which nothing moved: their scatter is the tracker's.

    Returns:
        Scatter, by the median so that changes between visits count little, and number of repeats; None where there
        are fewer than `FEWEST`.
    """
    place, reading = _driven(setup), setup.table.measured
    if still:
        apart = np.diff(reading, axis=0)[np.linalg.norm(np.diff(place, axis=0), axis=1) < 1e-6]
        return _scatter(apart[np.isfinite(apart).all(axis=1)])
    arrival = np.sign(np.round(np.diff(place, axis=0, prepend=place[:1]), 4))
    others = [setup.table.run, setup.table.payload_kg]
    beside = [np.nan_to_num(np.asarray(column, dtype=float)) for column in others if column is not None]
    pose = pose_groups(setup.table)
    key = np.column_stack([pose, arrival, *beside])
    good = (pose >= 0) & np.isfinite(np.column_stack([key, place, reading])).all(axis=1)
    key, reading = key[good], reading[good]
    if len(key) < FEWEST:
        return None
    order = np.lexsort(key.T)
    same = (np.diff(key[order], axis=0) == 0.0).all(axis=1)
    return _scatter(np.diff(reading[order], axis=0)[same])


def _driven(setup: Setup) -> np.ndarray:
    """Where the machine was sent, (n, k): an arm's joint commands, which a target does not tell; else the tool, mm."""
    sent = setup.table.command
    return sent if sent is not None and setup.table.joint_prefix == "q" else places(setup)


def _scatter(apart: np.ndarray) -> tuple[float, int] | None:
    """Standard deviation of one reading from differences (n, 3) of two, and their number."""
    if len(apart) < FEWEST:
        return None
    return float(median_sigma(apart) / np.sqrt(2.0)) + 1e-9, len(apart)
