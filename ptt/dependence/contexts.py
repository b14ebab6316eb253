"""What an error is looked at as, and what it may depend on: residuals in tool and joint space, and their context."""

import re

import numpy as np
import torch

from ptt.dependence.way import last_moves, ways_of
from ptt.run.frames import rigid_columns
from ptt.run.mounts import mount_slopes
from ptt.run.problem import Problem
from ptt.run.tails import chi2_sf, median_sigma
from ptt.run.watched import watched_values

ENOUGH = 12  # rows beyond the number of slopes before anything is taken out
FAR = 6.0  # robust standard deviations
CHANCE = 1e-3  # of a sound run that its frame is levelled
LEAST_ROWS = 3  # that each direction, level or run needs
COORDINATES = ("x", "y", "z")
WIDE = 1.5  # times the short moves or pauses of a run that long ones take, for that to be worth a look
SHORT = 0.05  # lever, as a share of the usual one (of the longest), below which a joint hardly moves the tool


def residual_views(problem: Problem, residual: np.ndarray) -> dict[str, np.ndarray]:
    """See a tool-space residual also as joint errors that would cause it.

    Args:
        problem: n rows.
        residual: (n, 3) mm, tool space, base frame; NaN where not observed.

    Returns:
        'x', 'y', 'z' (n,) mm, and 'slider 1'.. (n,) mm or 'joint 1'.. (n,) rad; NaN on rows that do not count. J e of
        the source paper; on an arm what each joint alone would have to do, see `lone_joints`.
    """
    view, serial = problem.view, problem.file.machine.kind == "serial"
    seen = problem.used & np.isfinite(residual).all(axis=1)
    inner = np.full((view.rows, view.joints), np.nan)
    inner[seen] = (lone_joints if serial else joint_residual)(view.jacobian.numpy()[seen], residual[seen])
    tool = np.where(seen[:, None], residual, np.nan)
    word = problem.file.machine.noun
    views = dict(zip(COORDINATES, tool.T, strict=True))
    return views | {f"{word} {i + 1}": inner[:, i] for i in range(view.joints)}


def level(problem: Problem, residual: np.ndarray) -> np.ndarray:
    """Take out of a residual what the tracker's frame could take, all coordinates alike.

    A fit weighs coordinates by their noise and leaves out far-off rows; what the model lacks then bends the frame for
    the sake of the quiet coordinates, and the bend would hide where the error comes from. Where nothing is lacking that
    would only carry the noise of loud coordinates into the quiet ones.

    Args:
        problem: n rows.
        residual: (n, 3) mm, NaN where not observed.

    Returns:
        (n, 3) mm; a frame that is trusted or held by base reflectors takes nothing. Reflector mounts take theirs. As it
        is where it would take no more than noise has it take.
    """
    seen = problem.used & np.isfinite(residual).all(axis=1)
    columns = list[np.ndarray]()
    if problem.frames and problem.base is None:
        place, member = problem.view.p[torch.as_tensor(seen)], problem.frame[seen]
        rigid = rigid_columns(place, place.mean(dim=0)).numpy()
        columns += [rigid * (member == frame)[:, None, None] for frame in np.unique(member)]
    if problem.mounts:
        turned, member = mount_slopes(problem.view)[seen], problem.mount[seen]
        columns += [turned * (member == mount)[:, None, None] for mount in np.unique(member)]
    together = np.concatenate(columns, axis=2) if columns else np.zeros((int(seen.sum()), 3, 0))
    if not together.shape[2] or seen.sum() < together.shape[2] + ENOUGH:
        return residual
    basis = orthonormal(together.reshape(-1, together.shape[2]))
    taken, noise = taken_part(basis, residual[seen]), problem.noise
    if noise is not None and is_by_chance(basis, taken, noise.covariance):
        return residual
    levelled = residual.copy()
    levelled[seen] -= taken
    return levelled


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Directions that columns (3 n, m) span, (3 n, r)."""
    scale = np.sqrt(np.square(columns).sum(axis=0))
    basis, size, _ = np.linalg.svd(columns / np.where(scale > 0, scale, 1.0), full_matrices=False)
    return np.asarray(basis[:, size > 1e-6 * size.max()])


def is_by_chance(basis: np.ndarray, taken: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether equal weights take no more of what a fit by the noise has left than noise alone has them take.

    Both fits are right where nothing is lacking; then they differ by what the noise makes of it.

    Source: Hausman, Econometrica 46 (1978); the sum of squares by Satterthwaite's approximation.

    Args:
        basis: orthonormal directions of frame and mounts, (3 n, r).
        taken: what equal weights take, (n, 3) mm.
        covariance: of one reading, (3, 3) mm^2.
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
    """What orthonormal directions can take of an error by least squares; far-off rows are cut down first.

    Args:
        basis: (3 n, r).
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
    """Joint errors behind tool errors.

    Args:
        jacobian: dp/dq, (n, 3, k).
        residual: (n, 3) mm.

    Returns:
        (n, k) mm or rad: the exact ones where k = 3 and the pose is regular, else the smallest least squares ones.
    """
    if jacobian.shape[1] == jacobian.shape[2] and len(jacobian):
        size = np.abs(jacobian).max(axis=(1, 2)) ** 3
        if (np.abs(np.linalg.det(jacobian)) > 1e-9 * size).all():
            return np.linalg.solve(jacobian, residual[:, :, None])[:, :, 0]
    return np.einsum("nkc,nc->nk", np.linalg.pinv(jacobian, rcond=1e-6), residual)


def lone_joints(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Tool errors along the way that each joint alone would move the tool, over the joint's usual lever.

    Unlike joint errors proper they are as noisy in one pose as in another: near singular poses blow nothing up.

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
    """Everything that a residual may depend on and that varies.

    Args:
        problem: n rows.

    Returns:
        (n,) each: 'b1'.. mm or 'q1'.. rad, 'direction1'.. (+1, -1), 'speed1'.. mm/s or rad/s with its sign,
        'payload' kg, 'temperature' deg C, 'time' s (the row's place in the whole table where there is no clock), 'x',
        'y', 'z' mm wanted, 'run', and the columns that a person wants watched, by their titles.
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
    views |= dict(zip(COORDINATES, problem.target.T, strict=True))
    views["run"] = np.asarray(table.run, dtype=float)
    views |= watched_values(table)
    return {name: values for name, values in views.items() if _varies(name, values[used])}


def path_views(problem: Problem) -> dict[str, np.ndarray]:
    """What an unknown may depend on: everything that a residual may, and the tool's moves.

    Args:
        problem: n rows.

    Returns:
        As `context_views`, and 'way x'.., components of the tool's way of arrival, -1 to 1, and 'turn x'.., of its way
        on less that; 'step' mm, how far it came, and 'pause' s, how long ago it left for there; 'feed' mm/s.
    """
    came, turns = ways_of(problem.view.p.numpy(), problem.view.starts.numpy())
    named = {
        f"{what} {axis}": way[:, i]
        for what, way in (("way", came[0]), ("turn", turns))
        for i, axis in enumerate(COORDINATES)
    }
    named |= moves_of(problem)
    if problem.table.feed_mm_s is not None:
        named["feed"] = np.asarray(problem.table.feed_mm_s, dtype=float)
    return {name: way for name, way in named.items() if _varies(name, way[problem.used])} | context_views(problem)


def moves_of(problem: Problem) -> dict[str, np.ndarray]:
    """Lengths and durations of the moves to the rows, where nine in ten differ enough for what settles to show it.

    Args:
        problem: the run.

    Returns:
        'step', (n,) mm, and 'pause', (n,) s where there is a clock; NaN before the first move of a run. A column of the
        same title that a person wants watched stands for its own.
    """
    view, found = problem.view, {}
    far, since = last_moves(view.p.numpy(), view.time.numpy(), view.starts.numpy())
    for name, values in (("step", far), ("pause", since)):
        low, high = np.nanpercentile(values, (5.0, 95.0)) if np.isfinite(values).any() else (0.0, 0.0)
        if high > WIDE * low and name not in problem.table.watched:
            found[name] = values
    return found


def unit_of(problem: Problem, name: str) -> str:
    """The unit of a variable that a residual may depend on.

    Args:
        problem: the run.
        name: as `path_views` has it.

    Returns:
        'mm', 'rad', 'mm/s', 'rad/s', 'kg', 'C', 's'; '' of directions, runs, rows without a clock and columns that a
        person wants watched.
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
        **dict.fromkeys((*COORDINATES, "step"), "mm"),
    }
    own["time"] = "s" if "time" in problem.view.varies else ""
    if name in own:
        return own[name]
    return angle if is_joint(name) else f"{angle}/s" if name.startswith("speed") else ""


def is_joint(name: str) -> bool:
    """Whether a variable is a slider height or a joint angle: 'b2', 'q5'."""
    return name[:1] in ("b", "q") and name[1:].isdigit()


def own_joint(residual: str, on: str) -> bool:
    """Whether a joint-space residual belongs to the joint that a variable speaks of: 'slider 2' and 'direction2'."""
    joint = re.fullmatch(r"(?:slider|joint) (\d+)", residual)
    variable = re.fullmatch(r"(?:b|q|direction|speed)(\d+)", on)
    return joint is not None and variable is not None and joint[1] == variable[1]


def _varies(name: str, values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    if len(known) < 2 * LEAST_ROWS or np.ptp(known) <= 1e-6:
        return False
    if name.startswith("direction") or name == "run":
        return bool((np.unique(known, return_counts=True)[1] >= LEAST_ROWS).sum() >= 2)
    return True
