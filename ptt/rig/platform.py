"""The platform with six degrees of freedom: three link lengths and three universal-joint constraints, by Newton."""

from dataclasses import dataclass

import numpy as np

from ptt.errors import WorkspaceError

Array = np.ndarray
TOLERANCE = 1e-11  # mm and rad, a Newton step below which nothing but rounding changes
MAX_STEPS = 60  # a start on the other side of a large machine takes many steps of bounded length
LONGEST_STEP = 60.0  # mm, a fifth of the bench's links: keeps a far start on its own side of the sliders
CLOSED = 1e-8  # mm, residual of a closed chain: far above rounding, far below any reading


@dataclass(frozen=True)
class Legs:
    """Ends, joint axes and lengths of the three chains of every row.

    Attributes:
        slider: (n, 3, 3) mm, centre of the joint on each slider, base frame.
        slider_axis: (n, 3, 3), unit vector e of the joint axis fixed to each slider, base frame.
        platform: (n, 3, 3) mm, centre of each platform joint from the platform's centre, platform frame.
        platform_axis: (3, 3), unit vector e' of the joint axis fixed to the platform, platform frame.
        length: (n, 3) mm, between the middle axes of each link's two universal joints.
        slider_offset: (3,) mm, distance of the middle axis from the slider's axis, positive towards the platform.
        platform_offset: (3,) mm, distance of the middle axis from the platform's axis, positive towards the slider.
    """

    slider: Array
    slider_axis: Array
    platform: Array
    platform_axis: Array
    length: Array
    slider_offset: Array
    platform_offset: Array


@dataclass(frozen=True)
class Pose:
    """Solved poses of the platform.

    Attributes:
        position: (n, 3) mm, platform centre.
        rotation: (n, 3, 3), platform to base.
        link: (n, 3, 3), unit vector of each link from slider to platform.
    """

    position: Array
    rotation: Array
    link: Array


def solve_platform(legs: Legs, start: Array, where: str = "") -> Pose:
    """Forward kinematics: the poses of the platform that close all three chains.

    Source: |B_i - A_i - offsets| = L_i and s_i . (e_i x R e'_i) = 0, because the middle axes at both ends of a link are
    parallel: the link and both outer axes lie in one plane. Newton's method on position and rotation.

    Args:
        legs: the chains of n rows.
        start: (n, 3) mm, first guess of the position, on the platform's side of the sliders.
        where: name of the rig's file, for messages.

    Returns:
        The poses.

    Raises:
        WorkspaceError: the chains of some rows cannot be closed.
    """
    position = np.array(start, dtype=float)
    rotation = np.broadcast_to(np.eye(3), (len(position), 3, 3)).copy()
    for _ in range(MAX_STEPS):
        residual, jacobian, link = _closure(legs, position, rotation)
        step = _solve(jacobian, residual)
        length = np.linalg.norm(step[:, :3], axis=1)
        step *= np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-300))[:, None]
        position = position - step[:, :3]
        rotation = rotation_matrix(-step[:, 3:]) @ rotation
        if not np.isfinite(step).all() or np.abs(step).max(initial=0.0) < TOLERANCE:
            break
    residual, _, link = _closure(legs, position, rotation)
    # Not by the step: rounding keeps a closed row moving, while one without a solution has a large residual.
    open_ = ~(np.abs(residual).max(axis=1, initial=0.0) < CLOSED)
    if open_.any():
        rows = np.flatnonzero(open_).tolist()
        raise WorkspaceError(
            f"the virtual machine cannot reach row {rows[0] + 1} of the run"
            + (f" (the first of {len(rows)} such rows)" if len(rows) > 1 else ""),
            rows,
            where=where,
            fix="stay inside the workspace of the machine",
        )
    return Pose(position, rotation, link)


def link_tension(pose: Pose, force: Array) -> Array:
    """Static tension of each link under a force on the platform.

    Source: balance of forces, sum T_i s_i = F; the universal joints take up every couple.

    Args:
        pose: n solved platforms.
        force: (n, 3) N on the platform.

    Returns:
        (n, 3) N, positive where the link is pulled.
    """
    return _solve(np.swapaxes(pose.link, 1, 2), force)


def reflector_shift(pose: Pose, reflector: Array) -> Array:
    """Shift of the reflector by the rotation of the platform.

    Args:
        pose: n solved platforms.
        reflector: (3,) mm from the platform's centre, platform frame.

    Returns:
        (n, 3) mm, base frame.
    """
    return np.einsum("nij,j->ni", pose.rotation, reflector) - reflector


def small_rotation(pose: Pose) -> Array:
    """Rotation vector of platforms that hardly turn, to first order: the skew part of the rotation matrix.

    Args:
        pose: n solved platforms.

    Returns:
        (n, 3) rad.
    """
    skew = pose.rotation - np.swapaxes(pose.rotation, 1, 2)
    return 0.5 * np.column_stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])


def rotation_matrix(vector: Array) -> Array:
    """Rotation matrices of rotation vectors.

    Source: Rodrigues' formula.

    Args:
        vector: (n, 3) rad.

    Returns:
        (n, 3, 3).
    """
    angle = np.linalg.norm(vector, axis=-1)[:, None, None]
    cross = np.zeros((*vector.shape[:-1], 3, 3))
    cross[:, 2, 1], cross[:, 0, 2], cross[:, 1, 0] = vector.T
    cross = cross - np.swapaxes(cross, 1, 2)
    half = np.sinc(angle / (2.0 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * half**2 * cross @ cross


def _closure(legs: Legs, position: Array, rotation: Array) -> tuple[Array, Array, Array]:
    """Residuals (n, 6), their Jacobian by position and small rotation (n, 6, 6), and link directions (n, 3, 3).

    Residuals are three in mm, of the link lengths, and three without unit, of the planes of links and outer axes.
    """
    arm = np.einsum("nij,nlj->nli", rotation, legs.platform)
    axis = np.einsum("nij,lj->nli", rotation, legs.platform_axis)
    span = position[:, None, :] + arm - legs.slider
    link = span
    for _ in range(2):  # the offsets turn with the link, whose direction they hardly change
        offset = legs.slider_offset[:, None] * _across(link, legs.slider_axis)
        offset = offset + legs.platform_offset[:, None] * _across(link, axis)
        link = span - offset
    length = np.linalg.norm(link, axis=-1, keepdims=True)
    unit = link / length
    normal = np.cross(legs.slider_axis, axis)
    out_of_plane = (unit * normal).sum(-1)
    by_position = (normal - unit * out_of_plane[..., None]) / length
    parallel = (legs.slider_axis * axis).sum(-1, keepdims=True)
    by_rotation = parallel * unit - (unit * axis).sum(-1, keepdims=True) * legs.slider_axis
    lengths = np.concatenate([unit, np.cross(arm, unit)], axis=-1)
    planes = np.concatenate([by_position, by_rotation + np.cross(arm, by_position)], axis=-1)
    residual = np.concatenate([length[..., 0] - legs.length, out_of_plane], axis=-1)
    return residual, np.concatenate([lengths, planes], axis=1), unit


def _across(link: Array, axis: Array) -> Array:
    """Unit vector perpendicular to an outer axis in the plane of axis and link: from the outer to the middle axis."""
    normal = link - (link * axis).sum(-1, keepdims=True) * axis
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _solve(matrix: Array, right: Array) -> Array:
    try:
        return np.linalg.solve(matrix, right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        return np.full_like(right, np.nan)
