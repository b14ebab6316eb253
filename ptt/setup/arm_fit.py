"""Fits of an arm's readings with unknown tracker position and reflector offset: linear to screen, exact to judge."""

from dataclasses import dataclass

import numpy as np
import torch

from ptt.machine import SerialSpec
from ptt.mechanisms.serial import Serial
from ptt.run.frames import rigid_columns
from ptt.setup.faults import left_after_faults
from ptt.setup.rigid import align_many, middle, rms
from ptt.setup.setup import Setup

SETTLED = 1e-3  # mm, size of a Gauss-Newton step that ends the iteration
ROUNDS = 8  # Gauss-Newton steps at most
USUAL = (0.5, 1e-3, 0.5, 1e-3, 1e-3)  # mm and rad: usual errors of a, alpha, d, theta and the Hayati angle
LOOSE = 1e-9  # ridge of the linear fit, relative
TURN_LENGTH = 100.0  # mm that a turn of one radian counts as


@dataclass(frozen=True, eq=False)
class Posed:
    """Nominal tool poses of the joint values of a hypothesis.

    Attributes:
        place: positions, (m, 3) mm.
        turn: orientations, (m, 3, 3).
    """

    place: np.ndarray
    turn: np.ndarray


def pose_many(cases: list[tuple[SerialSpec, np.ndarray]]) -> list[Posed]:
    """Nominal tool poses for each case of a drawing and joint values, (m, k) rad."""
    posed: list[Posed | None] = [None] * len(cases)
    groups: dict[SerialSpec, list[int]] = {}
    for index, (spec, _) in enumerate(cases):
        groups.setdefault(spec, []).append(index)
    for spec, members in groups.items():
        q = torch.as_tensor(np.stack([cases[index][1] for index in members]), dtype=torch.float64)
        place, turn = Serial.from_spec(spec).pose(q)
        for index, p, r in zip(members, place.numpy(), turn.numpy(), strict=True):
            posed[index] = Posed(p, r)
    return [pose for pose in posed if pose is not None]


def linear_many(posed: list[Posed], readings: np.ndarray) -> np.ndarray:
    """Residual of the best linear map from pose to reading in each case, (h,) mm: `linear`, batched.

    Args:
        posed: h cases of m rows.
        readings: (h, m, 3) mm, NaN where there is none.
    """
    known = np.isfinite(readings).all(axis=2)
    weight = known / np.maximum(known.sum(axis=1), 1)[:, None]
    columns = np.stack([np.concatenate([pose.place, pose.turn.reshape(-1, 9)], axis=1) for pose in posed])
    wanted = np.where(known[..., None], readings, 0.0)
    columns, wanted = (points - weight[:, None] @ points for points in (columns, wanted))
    columns, wanted = (np.where(known[..., None], points, 0.0) for points in (columns, wanted))
    scaled = columns / (np.sqrt(weight[:, None] @ columns**2) + 1e-9)
    normal = scaled.transpose(0, 2, 1) @ scaled + LOOSE * known.sum(axis=1)[:, None, None] * np.eye(columns.shape[2])
    left = wanted - scaled @ np.linalg.solve(normal, scaled.transpose(0, 2, 1) @ wanted)
    return middle(np.where(known, np.sqrt((left**2).sum(axis=2)), np.nan))


def linear(pose: Posed, reading: np.ndarray) -> tuple[float, np.ndarray]:
    """Median residual of the best linear map from pose to reading, mm, and the map's position part, (3, 3)."""
    known = np.isfinite(reading).all(axis=1)
    columns = np.concatenate([pose.place, pose.turn.reshape(-1, 9)], axis=1)[known]
    columns, wanted = columns - columns.mean(axis=0), reading[known] - reading[known].mean(axis=0)
    size = np.sqrt((columns**2).mean(axis=0)) + 1e-9
    scaled = columns / size
    normal = scaled.T @ scaled + LOOSE * len(scaled) * np.eye(scaled.shape[1])
    solved = np.linalg.solve(normal, scaled.T @ wanted)
    left = np.linalg.norm(wanted - scaled @ solved, axis=1)
    return float(np.sqrt(np.median(left**2))), (solved / size[:, None])[:3].T


def judge_arm(setup: Setup, rows: np.ndarray, *, mounted: bool = True) -> float:
    """Residual of an exact fit of tracker frame, reflector offset and ordinary link errors, mm.

    Args:
        setup: both files.
        rows: the rows that are fitted.
        mounted: whether the reflector has an unknown offset from the tool point; else it has none.
    """
    q, reading, pose = _posed(setup, rows)
    place = pose.place + pose.turn @ mount_of(pose, reading, setup.free) if mounted else pose.place
    arm = Serial.from_spec(arm_spec(setup))
    slopes = arm.geometry_jacobian(torch.as_tensor(q, dtype=torch.float64))[:, :3].numpy()[..., :-3]
    columns = np.concatenate([slopes * np.tile(USUAL, arm.joints), *([pose.turn] if mounted else [])], axis=2)
    left = left_after_faults(place, reading, columns, setup.free)
    return float(rms(left[None], np.zeros((1, len(left)), dtype=bool), 1.0)[0])


def mount_of_rows(setup: Setup, rows: np.ndarray) -> np.ndarray:
    """Reflector offset from the drawing's tool point, (3,) mm in the tool's frame."""
    _, reading, pose = _posed(setup, rows)
    return mount_of(pose, reading, setup.free)


def _posed(setup: Setup, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, Posed]:
    """Joint values (m, k) rad, readings (m, 3) mm and nominal poses of the rows that have a reading."""
    reading = setup.table.measured[rows]
    kept = np.isfinite(reading).all(axis=1)
    q, reading = setup.table.command[rows][kept], reading[kept]  # type: ignore[index]
    (pose,) = pose_many([(arm_spec(setup), q)])
    return q, reading, pose


def mount_of(pose: Posed, reading: np.ndarray, free: bool, part: np.ndarray | None = None) -> np.ndarray:
    """Reflector offset from the drawing's tool point, (3,) mm in the tool's frame, by Gauss-Newton.

    Args:
        pose: nominal poses of m rows.
        reading: (m, 3) mm.
        free: whether the tracker frame is unknown.
        part: (m,) int, tracker frame of each row; None for one.
    """
    mount = np.zeros(3)
    part = np.zeros(len(reading), dtype=int) if part is None else part
    parts = [np.flatnonzero(part == each) for each in np.unique(part)]
    for _ in range(ROUNDS):
        place = pose.place + pose.turn @ mount
        left, columns = np.empty_like(place), np.zeros((*place.shape, 3 + 6 * len(parts)))
        columns[..., :3] = pose.turn
        for index, rows in enumerate(parts):
            turn, shift, _ = align_many(place[None, rows], reading[None, rows], free)
            left[rows] = (reading[rows] - shift[0]) @ turn[0] - place[rows]
            here = torch.as_tensor(place[rows])
            columns[rows, :, 3 + 6 * index : 9 + 6 * index] = rigid_columns(here, here.mean(dim=0), TURN_LENGTH).numpy()
        step = np.linalg.lstsq(columns.reshape(3 * len(place), -1), left.ravel(), rcond=1e-8)[0][:3]
        mount = mount + step
        if np.abs(step).max() < SETTLED:
            break
    return mount


def arm_spec(setup: Setup) -> SerialSpec:
    """The drawing of a machine that is known to be an arm."""
    assert isinstance(setup.file.machine, SerialSpec)
    return setup.file.machine
