"""Residuals in tool and joint space, and the context variables that they may depend on."""

import re

import numpy as np
import torch

from ptt.dependence.way import last_moves, ways_of
from ptt.effects.curve_basis import GRAVITY, LOAD, value_of
from ptt.run.axes import AXES
from ptt.run.frames import by_own, rigid_columns
from ptt.run.mounts import mount_slopes
from ptt.run.problem import Problem
from ptt.run.tails import chi2_sf, median_sigma
from ptt.run.watched import watched_values

ENOUGH = 12  # rows beyond the number of columns of frames and mounts, from which these are removed
FAR = 6.0  # robust standard deviations at which residuals are clipped
CHANCE = 1e-3  # significance level of the Hausman test for removing the frame
LEAST_ROWS = 3  # rows that each direction of arrival, or run, needs for the variable to vary
WIDE = 1.5  # ratio of the longest to the shortest moves, beyond which their lengths or durations vary
FEW_MOVES = 4  # moves at the least that count as the longest or the shortest: a few rests in a day are enough
LEAST_LOAD = 0.1  # share of its largest load by which that of a joint has to vary
SHORT = 0.05  # least lever of a joint, as a share of its rms lever; least rms lever, as a share of the longest one


def residual_views(problem: Problem, residual: np.ndarray) -> dict[str, np.ndarray]:
    """A residual in tool space, and as the joint errors that would cause it.

    Args:
        problem: n rows.
        residual: (n, 3) mm, tool space, base frame; NaN where not observed.

    Returns:
        'x', 'y', 'z' (n,) mm, and 'slider 1'.. (n,) mm or 'joint 1'.. (n,) rad; NaN on rows that do not count. Joint
        errors are J e of the source paper; on an arm those of each joint alone, see `lone_joints`.
    """
    view, serial = problem.view, problem.file.machine.kind == "serial"
    seen = problem.used & np.isfinite(residual).all(axis=1)
    inner = np.full((view.rows, view.joints), np.nan)
    inner[seen] = (lone_joints if serial else joint_residual)(view.jacobian.numpy()[seen], residual[seen])
    tool = np.where(seen[:, None], residual, np.nan)
    word = problem.file.machine.noun
    views = dict(zip(AXES, tool.T, strict=True))
    return views | {f"{word} {i + 1}": inner[:, i] for i in range(view.joints)}


def remove_frame(problem: Problem, residual: np.ndarray) -> np.ndarray:
    """Remove the tracker's frame, and reflector mounts, from a residual by unweighted least squares.

    A fit weights coordinates by their noise, so missing physics shifts the frame in favour of the quiet ones, which
    hides where the error comes from. Where nothing is missing, the unweighted fit would only carry noise from the loud
    coordinates into the quiet ones; a Hausman test decides.

    Args:
        problem: n rows.
        residual: (n, 3) mm, NaN where not observed.

    Returns:
        (n, 3) mm; unchanged where the removed part is no more than noise. A frame that is trusted, or held by base
        reflectors, is not removed.
    """
    seen = problem.used & np.isfinite(residual).all(axis=1)
    columns = list[np.ndarray]()
    if problem.frames and problem.base is None:
        place = problem.view.p[torch.as_tensor(seen)]
        columns += by_own(rigid_columns(place, place.mean(dim=0)).numpy(), problem.frame[seen])
    if problem.mounts:
        columns += by_own(mount_slopes(problem.view)[seen], problem.mount[seen])
    together = np.concatenate(columns, axis=2) if columns else np.zeros((int(seen.sum()), 3, 0))
    if not together.shape[2] or seen.sum() < together.shape[2] + ENOUGH:
        return residual
    basis = orthonormal_basis(together.reshape(-1, together.shape[2]))
    taken, noise = taken_part(basis, residual[seen]), problem.noise
    if noise is not None and passes_hausman(basis, taken, noise.covariance):
        return residual
    levelled = residual.copy()
    levelled[seen] -= taken
    return levelled


def orthonormal_basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the range of columns, (3 n, m) -> (3 n, r)."""
    scale = np.sqrt(np.square(columns).sum(axis=0))
    basis, size, _ = np.linalg.svd(columns / np.where(scale > 0, scale, 1.0), full_matrices=False)
    return np.asarray(basis[:, size > 1e-6 * size.max()])


def passes_hausman(basis: np.ndarray, taken: np.ndarray, covariance: np.ndarray) -> bool:
    """Hausman test: whether unweighted and weighted estimates of the frame differ by no more than noise.

    Both are consistent where the model lacks nothing.

    Source: Hausman, Econometrica 46 (1978); the sum of squares by Satterthwaite's approximation.

    Args:
        basis: orthonormal basis of the shifts by frame and mounts, (3 n, r).
        taken: what the unweighted fit removes from the residual of the weighted one, (n, 3) mm.
        covariance: noise of one reading, (3, 3) mm^2.
    """
    rows = basis.reshape(-1, 3, basis.shape[1])
    plain = np.einsum("nip,ij,njq->pq", rows, covariance, rows, optimize=True)
    weighed = np.einsum("nip,ij,njq->pq", rows, np.linalg.pinv(covariance), rows, optimize=True)
    apart = plain - np.linalg.pinv(weighed)
    total, squares = float(np.trace(apart)), float(np.square(apart).sum())
    if total <= 1e-9 * float(np.trace(plain)):
        return False
    return bool(chi2_sf(float(np.square(taken).sum()) * total / squares, total**2 / squares) > CHANCE)


def taken_part(basis: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Projection of an error on a basis by least squares, residuals clipped at `FAR` (two steps).

    Args:
        basis: orthonormal, (3 n, r).
        error: (n, 3) mm.

    Returns:
        (n, 3) mm.
    """
    taken = np.zeros_like(error)
    for _ in range(2):
        left = error - taken
        middle = np.median(left, axis=0)
        reach = FAR * max(float(median_sigma(left - middle)), 1e-12)
        wanted = taken + middle + np.clip(left - middle, -reach, reach)
        taken = (basis @ (basis.T @ wanted.ravel())).reshape(-1, 3)
    return taken


def joint_residual(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Joint errors that cause tool errors, to first order.

    Args:
        jacobian: dp/dq, (n, 3, k).
        residual: (n, 3) mm.

    Returns:
        (n, k) mm or rad: exact where k = 3 and all poses are regular, else by the pseudo-inverse.
    """
    if jacobian.shape[1] == jacobian.shape[2] and len(jacobian):
        size = np.abs(jacobian).max(axis=(1, 2)) ** 3
        if (np.abs(np.linalg.det(jacobian)) > 1e-9 * size).all():
            return np.linalg.solve(jacobian, residual[:, :, None])[:, :, 0]
    return np.einsum("nkc,nc->nk", np.linalg.pinv(jacobian, rcond=1e-6), residual)


def lone_joints(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Tool errors projected on the direction in which each joint alone moves the tool, over the joint's rms lever.

    Unlike joint errors by the inverse Jacobian they have the same noise in all poses, singular ones included.

    Args:
        jacobian: dp/dq, (n, 3, k).
        residual: (n, 3) mm.

    Returns:
        (n, k) rad.
    """
    lever = np.linalg.norm(jacobian, axis=1)  # shape: (n, k)
    usual = np.sqrt(np.square(lever).mean(axis=0)) if len(lever) else lever.sum(axis=0)
    usual = np.maximum(usual, SHORT * usual.max(initial=1e-9))
    return np.einsum("nck,nc->nk", jacobian, residual) / np.maximum(lever, SHORT * usual) / usual


def context_views(problem: Problem) -> dict[str, np.ndarray]:
    """Context variables that vary in a run.

    Args:
        problem: n rows.

    Returns:
        (n,) each: 'b1'.. mm or 'q1'.. rad, 'direction1'.. (+1, -1), 'speed1'.. mm/s or rad/s with its sign,
        'payload' kg, 'temperature' deg C, 'time' s (the row number where there is no clock), 'x', 'y', 'z' mm of the
        target, 'run', and further columns that the user named, by their titles.
    """
    view, table, used = problem.view, problem.table, problem.used
    letter = problem.file.machine.letter
    views: dict[str, np.ndarray] = {}
    for i in range(view.joints):
        views[f"{letter}{i + 1}"] = view.q.numpy()[:, i]
    for i in range(view.joints):
        views[f"direction{i + 1}"] = view.direction.numpy()[:, i]
    if "speed" in view.varies:
        views |= {f"speed{i + 1}": view.velocity.numpy()[:, i] for i in range(view.joints)}
    if "payload" in view.varies and table.payload_kg is not None:
        views["payload"] = np.asarray(table.payload_kg, dtype=float)
    if "temperature" in view.varies and table.temp_c is not None:
        views["temperature"] = np.asarray(table.temp_c, dtype=float)
    views["time"] = view.clock.numpy()
    views |= dict(zip(AXES, problem.target.T, strict=True))
    views["run"] = np.asarray(table.run, dtype=float)
    views |= watched_values(table)
    return {name: values for name, values in views.items() if _varies(name, values[used])}


def path_views(problem: Problem) -> dict[str, np.ndarray]:
    """Variables that an unknown term may depend on: `context_views`, and the tool's moves.

    Args:
        problem: n rows.

    Returns:
        As `context_views`, and 'way x'.., components of the tool's unit direction of arrival; 'turn x'.., of its
        direction of departure less that; 'step' mm, length of the move to the row; 'pause' s, its duration with any
        rest before it; 'feed' mm/s; of an arm 'gravity x'.., its components along the axes of the tool; 'force1'.. N
        or 'torque1'.. N m, the load of each joint.
    """
    came, turns = ways_of(problem.view.p.numpy(), problem.view.starts.numpy())
    named = {
        f"{what} {axis}": way[:, i] for what, way in (("way", came[0]), ("turn", turns)) for i, axis in enumerate(AXES)
    }
    named |= moves_of(problem) | hanging_of(problem) | loads_of(problem)
    if problem.table.feed_mm_s is not None:
        named["feed"] = np.asarray(problem.table.feed_mm_s, dtype=float)
    return {name: way for name, way in named.items() if _varies(name, way[problem.used])} | context_views(problem)


def hanging_of(problem: Problem) -> dict[str, np.ndarray]:
    """Components of gravity along the axes of an arm's tool, (n,) each: what hangs on it bends and falls by these.

    Args:
        problem: the run.

    Returns:
        'gravity x'.., of a unit vector; none of a machine whose tool only translates.
    """
    if problem.file.machine.kind != "serial":
        return {}
    return {name: value_of(problem.view, name).numpy() for name in GRAVITY}


def loads_of(problem: Problem) -> dict[str, np.ndarray]:
    """What platform, links and payload load each joint with, (n,) each; a bearing with play changes sides with it.

    Args:
        problem: the run.

    Returns:
        'force1'.. N of sliders, 'torque1'.. N m of an arm's joints, positive toward growing joint values, where it
        varies. A column of the user's with the same title takes its place.
    """
    every = [load_name(problem, joint) for joint in range(problem.view.joints)]
    found = {each: value_of(problem.view, each).numpy() for each in every if each not in problem.table.watched}
    return {each: values for each, values in found.items() if np.ptp(values) > LEAST_LOAD * np.abs(values).max()}


def load_name(problem: Problem, joint: int) -> str:
    """What the load of a joint, from 0, is called: 'force1' or, of an arm, 'torque1'."""
    return f"{'torque' if problem.file.machine.kind == 'serial' else 'force'}{joint + 1}"


def moves_of(problem: Problem) -> dict[str, np.ndarray]:
    """Lengths and durations of the moves to the rows, where they vary enough to show a settling error.

    Args:
        problem: the run.

    Returns:
        'step', (n,) mm, and 'pause', (n,) s where there is a clock; NaN before the first move of a run. A column of the
        user's with the same title takes its place.
    """
    view, found = problem.view, {}
    far, since = last_moves(view.p.numpy(), view.time.numpy(), view.starts.numpy())
    for name, values in (("step", far), ("pause", since)):
        known = np.sort(values[np.isfinite(values)])
        varies = len(known) >= 2 * FEW_MOVES and known[-FEW_MOVES] > WIDE * known[FEW_MOVES - 1]
        if varies and name not in problem.table.watched:
            found[name] = values
    return found


def unit_of(problem: Problem, name: str) -> str:
    """The unit of a variable that a residual may depend on.

    Args:
        problem: the run.
        name: as `path_views` has it.

    Returns:
        'mm', 'rad', 'mm/s', 'rad/s', 'kg', 'C', 's', 'N', 'N m'; '' of directions, runs, row numbers and columns
        that the user named.
    """
    if name in problem.table.watched:
        return ""
    angle = "rad" if problem.file.machine.kind == "serial" else "mm"
    own = {
        "payload": "kg",
        "temperature": "C",
        "feed": "mm/s",
        "pause": "s",
        "reversal": angle,
        **dict.fromkeys((*AXES, "step"), "mm"),
    }
    own["time"] = "s" if "time" in problem.view.varies else ""
    if name in own:
        return own[name]
    if load := LOAD.fullmatch(name):
        return {"force": "N", "torque": "N m"}[load[1]]
    return angle if is_joint(name) else f"{angle}/s" if name.startswith("speed") else ""


def is_joint(name: str) -> bool:
    """Whether a variable is a slider height or a joint angle: 'b2', 'q5'."""
    return name[:1] in ("b", "q") and name[1:].isdigit()


def is_direction(name: str) -> bool:
    """Whether a variable is a joint's direction of arrival, 'direction2', and no column of the user's named so."""
    return name.startswith("direction") and name[9:].isdigit()


def own_joint(residual: str, on: str) -> bool:
    """Whether a joint-space residual belongs to the joint that a variable speaks of: 'slider 2' and 'direction2'."""
    joint = re.fullmatch(r"(?:slider|joint) (\d+)", residual)
    variable = re.fullmatch(r"(?:b|q|direction|speed|force|torque)(\d+)", on)
    return joint is not None and variable is not None and joint[1] == variable[1]


def _varies(name: str, values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    if len(known) < 2 * LEAST_ROWS or np.ptp(known) <= 1e-6:
        return False
    if is_direction(name) or name == "run":
        return bool((np.unique(known, return_counts=True)[1] >= LEAST_ROWS).sum() >= 2)
    return True
