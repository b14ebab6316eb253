"""A CSV grid of corrections over the workspace, with the error of interpolating in it."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import cKDTree

from ptt.correct.exports.format import Options, Written
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import HELD, rms_um, said_left, share_without_payload, useless_note
from ptt.correct.exports.left import WorkspaceSample, error_left, holdings, sample_workspace, solve, without
from ptt.correct.exports.whole import write_all
from ptt.correct.terms import split_terms
from ptt.errors import InputError
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.progress import Progress
from ptt.run.table import make_table
from ptt.run.viewing import build_view

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

CELLS = 20  # along the longest side, where no step is given
MOST_POINTS = 500_000  # a minute of computing; a controller holds far fewer
WHY = {
    "payload": "a table holds for one load, this one for none",
    "temperature": "a table holds for one temperature, this one for the reference",
    "speed": "a table holds for a machine that stands still",
}
SIDE = "a table does not know from which side a joint comes"
APART = "the table's points are too far apart for it"


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write corrections of the slider commands on a grid of tool positions, for trilinear interpolation.

    The grid covers the box of the workspace. Places that cannot be sent repeat the nearest place that can.

    Args:
        compensator: physics, and a network where there is one.
        out: CSV to write.
        options: with the step, mm.

    Returns:
        What came of it.

    Raises:
        InputError: a step that makes no table.
    """
    sample = sample_workspace(compensator, options)
    axes = _axes(sample, options.step)
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    cannot = _cannot(compensator)
    still = without(sample.compensator, cannot)  # places are in the base frame, whatever frame targets are stated in
    between = _between(still, axes, places, sample)
    still = without(still, [key for key, (whole, left) in between.items() if left > whole])
    shift = _corrections(still, places, options.progress)
    there = np.isfinite(shift).all(axis=1)
    shift = shift[there][cKDTree(places[there]).query(places)[1]]  # cells at the edge have corners beyond it
    apart = _interpolation(still, axes, shift, there, options.progress)
    head = [*head_lines(compensator, options), *_explained(axes, apart)]
    text = "".join(f"# {line}\n" for line in head) + "x_mm,y_mm,z_mm,db1_mm,db2_mm,db3_mm,sent\n"
    rows = np.column_stack([places, shift, there])
    text += "".join(",".join(f"{value:.7g}" for value in row) + "\n" for row in rows)
    written = write_all({out: text})
    q = sample.nominal + _interpolate(axes, shift, sample.targets)
    fine = {
        key: f"{APART} ({said_left(whole, min(left, whole))})"  # what comes out as something else is left out
        for key, (whole, left) in between.items()
        if left > HELD * whole
    }
    loaded = {key: WHY["payload"] for key, share in share_without_payload(sample).items() if share < 1.0 - HELD}
    holds, lost = holdings(sample, fine | loaded | cannot)
    network = compensator.network is not None
    left = error_left(sample, q)
    return Written(written, holds, lost, left, (*head[-3:], *useless_note(sample, left, holds)), network)


def _cannot(compensator: "Compensator") -> dict[str, str]:
    why = {}
    for term in compensator.model.terms:
        needs = [WHY[need] for need in term.effect.requires if need in WHY]
        if term.effect.reverses:
            why[term.effect.key] = SIDE
        elif needs:
            why[term.effect.key] = needs[0]
    return why


def _between(
    still: "Compensator", axes: Sequence[np.ndarray], places: np.ndarray, sample: WorkspaceSample
) -> dict[str, tuple[float, float]]:
    """Shift of the tool by each effect alone over the workspace, and its interpolation error in the grid, um rms.

    Periods shorter than two steps of the grid are aliased, which would be worse than no correction.
    """
    file, found = still.model.file, dict[str, tuple[float, float]]()
    reached = build_mechanism(file.machine).inverse(torch.as_tensor(places)).isfinite().all(dim=1).numpy()
    nearest = cKDTree(places[reached]).query(places)[1]
    views = [build_view(file, make_table(some)) for some in (places[reached], sample.targets)]
    for term in split_terms(still.model)[0]:
        at, there = ((predict([term], view).p - predict([], view).p).numpy() for view in views)
        left = _interpolate(axes, at[nearest], sample.targets) - there
        found[term[0].key] = (rms_um(there), rms_um(left))
    return found


def _axes(sample: WorkspaceSample, step: float | None) -> list[np.ndarray]:
    """Grid positions along x, y and z: multiples of the step that enclose the workspace."""
    low, high = sample.targets.min(axis=0), sample.targets.max(axis=0)
    width = float((high - low).max()) / CELLS if step is None else step
    count = _count(low, high, width)
    if count > MOST_POINTS or width > float((high - low).min()):
        size = " x ".join(f"{value:.0f}" for value in high - low)
        finest = _finest(low, high)
        near = finest if count > MOST_POINTS else max(finest, float(f"{float((high - low).min()) / 4:.2g}"))
        what = f"a step of {width:g} mm makes a table of {count} places" + (
            f", more than {MOST_POINTS}" if count > MOST_POINTS else ""
        )
        raise InputError(what, where="--step", fix=f"the workspace is {size} mm: try {near:g}")
    ends = np.floor(low / width).astype(int), np.ceil(high / width).astype(int)
    return [width * np.arange(begin, end + 1) for begin, end in zip(*ends, strict=True)]


def _count(low: np.ndarray, high: np.ndarray, width: float) -> int:
    """Number of grid points of a step."""
    return int(np.prod(np.ceil(high / width) - np.floor(low / width) + 1.0))


def _finest(low: np.ndarray, high: np.ndarray) -> float:
    """The smallest step of two significant digits that gives no more than MOST_POINTS, mm."""
    guess = float(np.cbrt(np.prod(high - low) / MOST_POINTS))
    digit = 10.0 ** (np.floor(np.log10(guess)) - 1.0)
    steps = (float(f"{digit * tens:.2g}") for tens in itertools.count(int(guess / digit)))
    return next(step for step in steps if _count(low, high, step) <= MOST_POINTS)


def _corrections(still: "Compensator", places: np.ndarray, progress: Progress) -> np.ndarray:
    """Corrected command less that of the drawing, (n, 3) mm; NaN where none can be sent."""
    commands = solve(still, make_table(places), progress)  # a network is over places here
    nominal = build_mechanism(still.model.file.machine).inverse(torch.as_tensor(places)).numpy()
    return np.asarray(np.where(commands.sent[:, None], commands.q - nominal, np.nan))


def _interpolate(axes: Sequence[np.ndarray], shift: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Trilinear interpolation, (n, 3) mm."""
    values = shift.reshape(*(len(axis) for axis in axes), 3)
    return np.asarray(RegularGridInterpolator(tuple(axes), values, bounds_error=False)(places))


def _interpolation(
    still: "Compensator", axes: Sequence[np.ndarray], shift: np.ndarray, there: np.ndarray, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """Error of interpolated corrections at the centres of whole cells, and of cells at the edge, um."""
    middles = [0.5 * (axis[1:] + axis[:-1]) for axis in axes]
    places = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1).reshape(-1, 3)
    off = _interpolate(axes, shift, places)
    apart = 1e3 * np.abs(off - _corrections(still, places, progress)).max(axis=1)
    whole = _interpolate(axes, np.repeat(there[:, None], 3, axis=1).astype(float), places)[:, 0] == 1.0
    known = np.isfinite(apart)
    return apart[known & whole], apart[known & ~whole]


def _explained(axes: Sequence[np.ndarray], apart: tuple[np.ndarray, np.ndarray]) -> list[str]:
    sizes = " x ".join(str(len(axis)) for axis in axes)
    step = axes[0][1] - axes[0][0]
    return [
        "db: what to add to the drawing's slider heights at x, y, z of the base frame; sent 0: the nearest point",
        f"{sizes} points {step:g} mm apart, z runs fastest; no payload, reference temperature, no reversal",
        f"trilinear interpolation: off by {_off(apart[0])} within whole cells, by {_off(apart[1])} at the edge",
    ]


def _off(apart: np.ndarray) -> str:
    if not len(apart):
        return "nothing known"
    return f"{np.sqrt((apart**2).mean()):.3g} um rms, {apart.max():.3g} um at most a slider ({len(apart)} cells)"
