"""Reflector offset (mount) on an arm's tool: fitted along with the tracker frame, since it is never known exactly."""

from dataclasses import replace

import numpy as np
import torch

from ptt.machine import MachineFile
from ptt.mechanisms.sensitivity import sensitivity
from ptt.run.frames import align, by_own, rigid_columns
from ptt.run.table import Table
from ptt.run.view import View

ROUNDS = 20  # Gauss-Newton steps at most
SETTLED = 1e-6  # mm, size of a step at which the iteration ends
TRIM = 6.0  # median distances beyond which a row is an outlier
UNSEEN = 1e-4  # relative singular value below which a direction is not determined and stays
TURN_LENGTH = 1e3  # mm that a turn of one radian counts as


def mount_of_rows(file: MachineFile, table: Table) -> np.ndarray:
    """Number the mounts of a table.

    Args:
        file: the machine.
        table: n rows.

    Returns:
        (n,) int, the mount of each row; -1 where the drawing's tool point is trusted, as it is on a 3-PTT.
    """
    if file.machine.kind != "serial" or file.tracker.tool == "trusted":
        return np.full(table.rows, -1)
    return np.asarray(table.run, dtype=int) if file.tracker.tool == "fitted-per-run" else np.zeros(table.rows, int)


def place_mounts(view: View, mount: np.ndarray, mounts: np.ndarray) -> View:
    """Set the reflector's offset.

    Args:
        view: n rows.
        mount: (n,) int, mount of each row.
        mounts: (m, 3) mm, in the tool's frame.

    Returns:
        The view with nominal positions and derivatives of the reflector.
    """
    placed = replace(view, mount=torch.as_tensor(mounts[mount]))
    geometry = placed.mounted(view.q.new_zeros(1, len(view.mechanism.slots)))
    p, by_joint, _ = sensitivity(view.mechanism, view.q, geometry)
    return replace(placed, p=p, jacobian=by_joint)


def find_mounts(
    view: View, reading: np.ndarray, rows: np.ndarray, mount: np.ndarray, frame: np.ndarray, *, free: bool
) -> View:
    """Fit the reflector offsets, together with the frames, to the drawing's poses.

    Args:
        view: n rows.
        reading: (n, 3) mm, NaN where not observed.
        rows: rows that count, (n,) bool.
        mount: (n,) int, mount of each row.
        frame: (n,) int, tracker frame of each row.
        free: whether the frames are unknown; else readings are in the base frame already.

    Returns:
        The view with the mounts in place.
    """
    bare = place_mounts(view, mount, np.zeros((int(mount.max()) + 1, 3)))
    mounts = mounts_beside(bare.p.numpy(), mount_slopes(bare), reading, rows, mount, frame, free=free)
    return place_mounts(bare, mount, mounts)


def mounts_beside(
    place: np.ndarray, by_mount: np.ndarray, reading: np.ndarray, rows: np.ndarray, mount: np.ndarray,
    frame: np.ndarray, *, free: bool,
) -> np.ndarray:  # fmt: skip
    """Reflector offsets by Gauss-Newton, for given tool poses.

    Args:
        place: tool positions, (n, 3) mm, NaN where not known.
        by_mount: (n, 3, 3) axes of the tool's frame, as `mount_slopes` has them.
        reading: (n, 3) mm, NaN where not observed.
        rows: that count, (n,) bool.
        mount: (n,) int, of each row.
        frame: (n,) int, of each row.
        free: whether the frames are unknown.

    Returns:
        (m, 3) mm, in the tool's frame.
    """
    mounts = np.zeros((int(mount.max()) + 1, 3))
    for _ in range(ROUNDS):
        seat = np.einsum("nij,nj->ni", by_mount, mounts[mount])
        step = _step(place + seat, by_mount, reading, rows, mount, frame, free)
        mounts = mounts + step
        if np.abs(step).max() < SETTLED:
            break
    return mounts


def _step(
    p: np.ndarray, by_mount: np.ndarray, reading: np.ndarray, rows: np.ndarray, mount: np.ndarray,
    frame: np.ndarray, free: bool,
) -> np.ndarray:  # fmt: skip
    """A Gauss-Newton step of all mounts, (m, 3) mm."""
    width = 3 * (int(mount.max()) + 1)
    blocks = by_own(by_mount, mount, width // 3)
    left = reading - p
    for index in np.unique(frame[rows]) if free else ():
        own = rows & (frame == index)
        turn, shift = align(p[own], reading[own])
        left[own] = (reading[own] - shift) @ turn - p[own]
        rigid = rigid_columns(torch.as_tensor(p), torch.as_tensor(p[own].mean(axis=0)), TURN_LENGTH)
        blocks.append(np.where(own[:, None, None], rigid.numpy(), 0.0))
    distance = np.linalg.norm(left, axis=1)
    near = rows & (distance <= TRIM * max(float(np.median(distance[rows])), 1e-9))
    columns = np.concatenate(blocks, axis=2)[near].reshape(3 * int(near.sum()), -1)
    return np.linalg.lstsq(columns, left[near].ravel(), rcond=UNSEEN)[0][:width].reshape(-1, 3)


def mount_slopes(view: View) -> np.ndarray:
    """Derivative of the readings by the place of the reflector beside the tool point.

    Args:
        view: n rows.

    Returns:
        (n, 3, 3), the axes of the tool's frame.
    """
    geometry = view.mounted(view.q.new_zeros(1, len(view.mechanism.slots)))
    return sensitivity(view.mechanism, view.q, geometry)[2][..., -3:].numpy()
