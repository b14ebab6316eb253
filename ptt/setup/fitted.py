"""Hypotheses with a number that is fitted: a length of the drawing, the targets' own frame, slider zeros."""

from collections.abc import Iterator
from itertools import product

import numpy as np
import torch

from ptt.machine import ThreePttSpec
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.run.frames import rigid_columns
from ptt.setup.candidates import BEYOND_HOMING, slider_words, zeros_from_home
from ptt.setup.drawing import drawn_with
from ptt.setup.rigid import align_many, column_medians
from ptt.setup.score import agree_points, build, forward_many
from ptt.setup.setup import Hypothesis, Setup, Undo, drawn

SEARCHED = ("link_length_mm", "base_radius_mm")  # the platform's radius counts as the base's with the other sign
SLIP = 3.0  # mm: smaller errors of a length are those of construction
WIDEST = 0.4  # half width of the search, as a share of the length
GRID, ZOOMS = 13, 5  # points and refinements: to within 4e-5 of the length
FEW_ROWS = 48  # rows of the search
FRAME_SLIP = 2.0  # mm: smaller displacements of targets are no frame of their own
ROUNDS = 6  # of Gauss-Newton
# Scales of three zeros, shifts and turns in a minimum-norm solution: a common zero goes to the tracker's height first.
SCALE = np.array([0.01, 0.01, 0.01, 1.0, 1.0, 1.0, 0.01, 0.01, 0.01])


def fitted_mistakes(setup: Setup) -> Iterator[Hypothesis]:
    """Mistakes with a number, which is fitted.

    Args:
        setup: both files.

    Yields:
        Hypotheses; none where the run has no commands.
    """
    if setup.table.command is None:
        return
    yield from _lengths(setup)
    yield from target_frame(setup)
    if not np.isfinite(setup.table.target).any():
        yield from _zeros_by_readings(setup)


def target_frame(setup: Setup) -> Iterator[Hypothesis]:
    """Targets that are stated in a frame of their own, the workpiece's."""
    commanded, target = forward_many([setup]), setup.table.target[None]
    known = np.isfinite(commanded).all(axis=2) & np.isfinite(target).all(axis=2)
    if known.sum() < 5:
        return
    turn, shift, _ = align_many(commanded, target)
    moved = (setup.table.target - shift[0]) @ turn[0]
    if column_medians(np.linalg.norm(moved - setup.table.target, axis=1)[:, None]) < FRAME_SLIP:
        return
    words = f"the targets moved out of a frame of their own, {frame_words(turn[0], shift[0])},"
    fix = "state the targets in the machine's frame, or keep them there and let the frame be fitted"

    def undo(now: Setup) -> Setup:
        return now.with_rows(target=(now.table.target - shift[0]) @ turn[0])

    yield Hypothesis("target-frame", words, fix, undo, 1.0)


def frame_words(turn: np.ndarray, shift: np.ndarray) -> str:
    """A rigid motion in words."""
    angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))
    at = ", ".join(f"{value:.1f}" for value in shift)
    return f"turned by {angle:.2f} deg and shifted by ({at}) mm"


def _lengths(setup: Setup) -> Iterator[Hypothesis]:
    """The one length that, changed alone, makes the columns agree best."""
    spec = drawn(setup)
    for key, value in _search(setup).items():
        stated = getattr(spec, key)
        if abs(value - stated) < SLIP:
            continue
        words = f"{key} = {value:.6g} in place of {stated:.6g}"
        if key == "base_radius_mm":
            other = spec.platform_radius_mm - (value - stated)
            words += f" (or platform_radius_mm = {other:.6g}: only their difference counts)"
        fix, undo = f"write {key} = {value:.6g} if the drawing agrees", drawn_with(**{key: round(value, 4)})
        yield Hypothesis("drawing-length", words, fix, undo, 0.6)


def _counted(signs: np.ndarray, zero: np.ndarray) -> Undo:
    return lambda setup: setup.with_rows(command=signs * setup.table.command + zero)


def _search(setup: Setup) -> dict[str, float]:
    """The value of each length, changed alone, at which the columns agree best, by a grid that is refined."""
    spec, mechanism = drawn(setup), build(drawn(setup))
    if mechanism is None:
        return {}
    rows = np.arange(0, setup.table.rows, max(1, setup.table.rows // FEW_ROWS))
    centre = {key: float(getattr(spec, key)) for key in SEARCHED}
    width = {key: WIDEST * value for key, value in centre.items()}
    for _ in range(ZOOMS):
        grid = [(key, value) for key in SEARCHED for value in centre[key] + width[key] * np.linspace(-1.0, 1.0, GRID)]
        left = _left_at(setup, mechanism, rows, grid).reshape(len(SEARCHED), GRID)
        for key, at in zip(SEARCHED, np.argmin(left, axis=1), strict=True):
            centre[key] += width[key] * (2.0 * int(at) / (GRID - 1) - 1.0)
            width[key] *= 2.0 / (GRID - 1)
    return centre


def _left_at(setup: Setup, mechanism: ThreePtt, rows: np.ndarray, grid: list[tuple[str, float]]) -> np.ndarray:
    """Disagreement of the columns at each value of a length, (h,), as a sum of logarithms of rms errors."""
    spec = drawn(setup)
    shape = (len(grid), len(rows), 3)
    q, target, reading = (
        np.broadcast_to(points[rows], shape)  # type: ignore[index]
        for points in (setup.table.command, setup.table.target, setup.table.measured)
    )
    shift = np.repeat(np.stack([_moved(spec, key, value) for key, value in grid]), len(rows), axis=0)
    place = mechanism.forward(torch.as_tensor(q.reshape(-1, 3)), torch.as_tensor(shift)).numpy().reshape(shape)
    sizes = np.full((len(grid), 1), spec.link_length_mm)
    found = agree_points(target, place, reading, np.isfinite(q).all(axis=2), sizes, setup.free)
    return np.array([np.nansum(np.log(agreement.rms + 1e-4)) for agreement in found])


def _moved(spec: ThreePttSpec, key: str, value: float) -> np.ndarray:
    """Geometry shift, (15,) mm, that a length of another value makes.

    Leaning rails turn about their slider's home position, which moves with the length.
    """
    other = {"link_length_mm": spec.link_length_mm, "base_radius_mm": spec.base_radius_mm, key: value}
    spread = [radius - spec.platform_radius_mm for radius in (spec.base_radius_mm, other["base_radius_mm"])]
    square = [
        length**2 - apart**2
        for length, apart in zip((spec.link_length_mm, other["link_length_mm"]), spread, strict=True)
    ]
    rise = np.diff(np.sqrt(np.maximum(square, 0.0)))[0] * (1.0 if spec.sliders == "above" else -1.0)
    azimuth, lean = np.radians(spec.slider_azimuth_deg), np.radians(spec.slider_lean_deg)
    outward = spread[1] - spread[0] - rise * np.sin(lean)
    push = np.stack([outward * np.cos(azimuth), outward * np.sin(azimuth), rise * (1.0 - np.cos(lean))], axis=1)
    return np.r_[np.c_[push, np.full(3, other["link_length_mm"] - spec.link_length_mm)].ravel(), np.zeros(3)]


def _zeros_by_readings(setup: Setup) -> Iterator[Hypothesis]:
    """Slider zeros and signs from the readings alone; the common part of the zeros is the tracker's height."""
    mechanism, command = build(drawn(setup)), setup.table.command
    if mechanism is None or command is None:
        return
    rows = np.arange(0, setup.table.rows, max(1, setup.table.rows // FEW_ROWS))
    signs = np.array(list(product((1.0, -1.0), repeat=3)))
    start = np.stack([zeros_from_home(setup, sign * command, sign) for sign in signs])
    zeros = _fit_zeros(
        mechanism, signs[:, None] * command[rows] + start[:, None], setup.table.measured[rows], setup.free
    )
    for sign, zero in zip(signs, np.round(zeros + start, 3), strict=True):
        down = np.flatnonzero(sign < 0.0).tolist()
        if not np.isfinite(zero).all() or (not down and np.ptp(zero) < BEYOND_HOMING):
            continue
        words = f"{slider_words(down)} counted downward" if down else "each slider counted from its own zero"
        words += f", zeros moved by {', '.join(f'{value:.1f}' for value in zero)} mm"
        fix = "take the columns with that sign and add the constants"
        yield Hypothesis("slider-sign", words, fix, _counted(sign, zero), 0.2 + 0.1 * len(down) if down else 0.8)


def _fit_zeros(mechanism: ThreePtt, command: np.ndarray, reading: np.ndarray, free: bool) -> np.ndarray:
    """Slider zeros that fit the readings best, (h, 3) mm, by Gauss-Newton; NaN where too few poses can be assembled.

    Args:
        mechanism: the machine.
        command: (h, m, 3) mm, one case each.
        reading: (m, 3) mm.
        free: whether the tracker frame is unknown.
    """
    zero, count = np.zeros((len(command), 3)), len(reading)
    reading = np.broadcast_to(reading, command.shape)
    for _ in range(ROUNDS):
        q = torch.as_tensor((command + zero[:, None]).reshape(-1, 3), dtype=torch.float64)
        place = mechanism.forward(q).numpy().reshape(command.shape)
        known = np.isfinite(place).all(axis=2) & np.isfinite(reading).all(axis=2)
        zero[known.sum(axis=1) < max(8, count // 2)] = np.nan
        turn, shift, _ = align_many(place, reading, free)
        left = (reading - shift[:, None]) @ turn - place
        slope = mechanism.jacobian(q).numpy().reshape(*command.shape, 3)
        matrix = np.concatenate([slope, rigid_columns(torch.as_tensor(place)).numpy()], axis=3) if free else slope
        scale = SCALE[: matrix.shape[3]]
        matrix, left = (np.where(known[(...,) + (None,) * (part.ndim - 2)], part, 0.0) for part in (matrix, left))
        inverse = np.linalg.pinv((matrix * scale).reshape(len(command), 3 * count, -1), rcond=1e-6)
        step = (inverse @ left.reshape(len(command), -1, 1))[:, :3, 0] * scale[:3]
        zero = zero + np.clip(step, -60.0, 60.0)
    return zero
