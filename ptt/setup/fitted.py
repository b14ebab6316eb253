"""Mistakes whose size has to be found: a length of the drawing, the targets' own frame, a slider's own zero."""

from collections.abc import Iterator

import numpy as np
import torch

from ptt.machine import ThreePttSpec
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.setup.candidates import slider_words, zeros_from_home
from ptt.setup.rigid import align_many
from ptt.setup.score import agree, agree_points, build, forward_many
from ptt.setup.setup import Hypothesis, Setup, Undo

LENGTHS = ("link_length_mm", "base_radius_mm", "platform_radius_mm")
SLIP = 3.0  # mm: a length off by less is how machines are built
WIDEST = 0.4  # of the length
GRID, ZOOMS = 21, 4
FINE = 13
FEW_ROWS = 80
FRAME_SLIP = 2.0  # mm that a frame of their own moves the targets by, at least
ROUNDS = 6
SCALE = np.array([0.01, 0.01, 0.01, 1.0, 1.0, 1.0, 0.01, 0.01, 0.01])  # a common zero is a height of the tracker first


def fitted_mistakes(setup: Setup, rows: np.ndarray) -> Iterator[Hypothesis]:
    """Mistakes with a number in them, the number found.

    Args:
        setup: both files.
        rows: (m,) int, rows looked at.

    Yields:
        Hypotheses; none where the run has no commands.
    """
    if setup.table.command is None:
        return
    yield from _lengths(setup, rows)
    yield from target_frame(setup, rows)
    if not np.isfinite(setup.table.target[rows]).any():
        yield from _zeros_by_readings(setup, rows)


def target_frame(setup: Setup, rows: np.ndarray) -> Iterator[Hypothesis]:
    """Targets that are stated in a frame of their own, the workpiece's."""
    commanded, target = forward_many([setup], rows), setup.table.target[rows][None]
    known = np.isfinite(commanded).all(axis=2) & np.isfinite(target).all(axis=2)
    if known.sum() < 5:
        return
    turn, shift, _ = align_many(commanded, target)
    moved = (setup.table.target - shift[0]) @ turn[0]
    if np.nanmedian(np.linalg.norm(moved - setup.table.target, axis=1)) < FRAME_SLIP:
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


def _lengths(setup: Setup, rows: np.ndarray) -> Iterator[Hypothesis]:
    """The one length that, changed alone, makes the columns agree best."""
    spec = setup.file.machine
    if not isinstance(spec, ThreePttSpec):
        return
    best = {key: _search(setup, rows, key) for key in LENGTHS[:2]}
    for key, value in best.items():
        drawn = getattr(spec, key)
        if abs(value - drawn) < SLIP:
            continue
        words = f"{key} = {value:.4g} in place of {drawn:.4g}"
        if key == "base_radius_mm":
            other = spec.platform_radius_mm - (value - drawn)
            words += f" (or platform_radius_mm = {other:.4g}: only their difference counts)"
        changes = {key: round(value, 4)}
        yield Hypothesis(
            "drawing-length", words, f"write {key} = {value:.4g} if the drawing agrees", _redrawn(changes), 0.6
        )


def _redrawn(changes: dict[str, float]) -> Undo:
    return lambda setup: setup.with_drawing(**changes)


def _counted(signs: np.ndarray, zero: np.ndarray) -> Undo:
    return lambda setup: setup.with_rows(command=signs * setup.table.command + zero)


def _search(setup: Setup, rows: np.ndarray, key: str) -> float:
    """The value of a length at which the columns agree best, by a grid that closes in."""
    spec, mechanism = setup.file.machine, build(setup.file.machine)
    if mechanism is None or not isinstance(spec, ThreePttSpec):
        return float(getattr(spec, key))
    rows = rows[:: max(1, len(rows) // FEW_ROWS)]
    q = torch.as_tensor(setup.table.command[rows], dtype=torch.float64).repeat(GRID, 1)  # type: ignore[index]
    target, reading = (np.tile(points[rows], (GRID, 1, 1)) for points in (setup.table.target, setup.table.measured))
    sent = np.isfinite(q.numpy()).all(axis=1).reshape(GRID, -1)
    push, centre, width = _slots(spec, key), 0.0, WIDEST * getattr(spec, key)
    for _ in range(ZOOMS):
        grid = centre + width * np.linspace(-1.0, 1.0, GRID)
        geometry = torch.as_tensor(np.repeat(grid, len(rows))[:, None] * push, dtype=torch.float64)
        place = mechanism.forward(q, geometry).numpy().reshape(target.shape)
        agreements = agree_points(target, place, reading, sent, np.full((GRID, 1), spec.link_length_mm), setup.free)
        totals = [np.nansum(np.log(agreement.rms + 1e-4)) for agreement in agreements]
        centre, width = float(grid[int(np.argmin(totals))]), 2.0 * width / (GRID - 1)
    found = float(getattr(spec, key)) + centre
    return _sharpen(setup, rows, key, found, width) if any(spec.slider_lean_deg) else found


def _sharpen(setup: Setup, rows: np.ndarray, key: str, found: float, width: float) -> float:
    """The same with each drawing built anew: leaning rails turn about their home, which moves with the length."""
    width = max(20.0 * width, 0.05 * found)
    for _ in range(ZOOMS + 1):
        grid = found + width * np.linspace(-1.0, 1.0, FINE)
        setups = [setup.with_drawing(**{key: float(value)}) for value in grid]
        totals = [np.nansum(np.log(agreement.rms + 1e-4)) for agreement in agree(setups, rows)]
        found, width = float(grid[int(np.argmin(totals))]), 2.0 * width / (FINE - 1)
    return found


def _slots(spec: ThreePttSpec, key: str) -> np.ndarray:
    """Which of the mechanism's slots move by how much when a length grows by 1 mm, (15,)."""
    push = np.zeros((3, 4))
    if key == "link_length_mm":
        push[:, 3] = 1.0
    else:
        azimuth = np.radians(spec.slider_azimuth_deg)
        push[:, 0], push[:, 1] = np.cos(azimuth), np.sin(azimuth)
    return np.r_[push.ravel(), np.zeros(3)]


def _zeros_by_readings(setup: Setup, rows: np.ndarray) -> Iterator[Hypothesis]:
    """Each slider's zero from the readings alone; what all have in common is the tracker's height."""
    spec = setup.file.machine
    mechanism = build(spec) if isinstance(spec, ThreePttSpec) else None
    reading, command = setup.table.measured[rows], setup.table.command
    if mechanism is None or command is None:
        return
    for down in ((), (0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2)):
        signs = np.where(np.isin(np.arange(3), down), -1.0, 1.0)
        start = zeros_from_home(setup, signs * command, signs)
        zero = _follow(mechanism, signs * command[rows] + start, reading, setup.free)
        if zero is None or (not down and np.ptp(zero) < 5.0):
            continue
        zero = np.round(zero + start, 3)
        words = f"{slider_words(down)} counted downward" if down else "each slider counted from its own zero"
        words += f", zeros moved by {', '.join(f'{value:.1f}' for value in zero)} mm"
        fix = "take the columns with that sign and add the constants"
        yield Hypothesis("slider-sign", words, fix, _counted(signs, zero), 0.2 + 0.1 * len(down) if down else 0.8)


def _follow(mechanism: ThreePtt, command: np.ndarray, reading: np.ndarray, free: bool) -> np.ndarray | None:
    """Zeros at which the readings fit best, (3,) mm, by Gauss-Newton; None where the machine does not close."""
    zero = np.zeros(3)
    for _ in range(ROUNDS):
        q = torch.as_tensor(command + zero, dtype=torch.float64)
        place = mechanism.forward(q).numpy()
        known = np.isfinite(place).all(axis=1) & np.isfinite(reading).all(axis=1)
        if known.sum() < max(8, len(place) // 2):
            return None
        turn, shift, _ = align_many(place[None], reading[None], free)
        left = ((reading - shift[0]) @ turn[0] - place)[known]
        slope = mechanism.jacobian(q[torch.as_tensor(known)]).numpy()
        turns = np.stack([np.cross(axis, place[known]) for axis in np.eye(3)], axis=2)
        frame = np.concatenate([np.broadcast_to(np.eye(3), slope.shape), turns], axis=2)
        matrix = (np.concatenate([slope, frame], axis=2) if free else slope).reshape(3 * len(slope), -1)
        scale = SCALE[: matrix.shape[1]]
        step = np.linalg.lstsq(matrix * scale, left.ravel(), rcond=1e-6)[0][:3] * scale[:3]
        zero = zero + np.clip(step, -60.0, 60.0)
    return zero if np.isfinite(zero).all() else None
