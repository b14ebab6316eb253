"""Error reduction, eq. 21 of the source paper: P_g = (A_b - A_a)/A_b x 100 %, A the mean absolute error of one axis."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ptt.errors import TableError, TooFewError
from ptt.judge.gross import gross_rows
from ptt.judge.match import match_rows, targets_of
from ptt.machine import MachineFile
from ptt.run.axes import AXES
from ptt.run.base_frame import into_base
from ptt.run.direction import travel_direction
from ptt.run.frames import align
from ptt.run.mounts import mount_of_rows, mount_slopes, mounts_beside
from ptt.run.noise import Noise, given_noise
from ptt.run.problem import build_problem
from ptt.run.same_pose import count_places, same_places
from ptt.run.table import Table
from ptt.run.travel import run_starts

SIDES = ("before", "after")
GOALS = {"x": 90.0, "y": 90.0, "z": 80.0}  # percent, of the source paper
MEAN_OF_NORMAL = float(np.sqrt(2.0 / np.pi))  # mean size of a normal error, in standard deviations
SURE = 3.0  # standard deviations
LEAST_ROWS = 4  # a rigid motion is found from three; with no more it would take every error away

Datum = Literal["absolute", "first"]


@dataclass(frozen=True)
class Errors:
    """Errors of the rows of one run, n rows.

    Attributes:
        raw: measured less target, frames as they come, (n, 3) mm; NaN where not observed or no pose.
        aligned: the same after the frame policy, (n, 3) mm.
        frame: the policy, in words.
        noise: of one reading, by repeats, std columns or the machine file; None where nothing tells it.
    """

    raw: np.ndarray
    aligned: np.ndarray
    frame: str
    noise: Noise | None = None


@dataclass(frozen=True)
class Evaluation:
    """What a compensation did.

    Attributes:
        before: errors of the rows that count, (m, 3) mm.
        after: errors of the same poses afterwards, (m, 3) mm.
        protocol: which rows, frame and z datum, and whether measured or computed.
        raw: errors (m, 3) before and after, without frame alignment; None where there is no such thing.
        goals: percent by which the error of each axis should fall.
        noise: noise floor of the readings afterwards.
        unmatched: rows of either run without a counterpart.
        matched: rows of either run that belong together, (m,) each; empty where computed.
        gross: rows of either run whose reading is no machine's; they count all the same.
        without: errors before and after without those rows and their counterparts, (r, 3) mm each; None where there are
            no such rows, or no others.
    """

    before: np.ndarray
    after: np.ndarray
    protocol: dict[str, Any]
    raw: tuple[np.ndarray, np.ndarray] | None = None
    noise: Noise | None = None
    unmatched: dict[str, list[str]] = field(default_factory=dict)
    goals: Mapping[str, float] = field(default_factory=lambda: GOALS)
    matched: tuple[np.ndarray, np.ndarray] = field(default_factory=lambda: (np.zeros(0, int), np.zeros(0, int)))
    gross: Mapping[str, list[int]] = field(default_factory=dict)
    without: tuple[np.ndarray, np.ndarray] | None = None

    def to_dict(self) -> dict[str, Any]:
        """Figures for JSON: axes, total, protocol; length, unaligned, noise_um, unmatched, outlier_rows beside them."""
        data = compare_errors(self.before, self.after, self.goals) | {"protocol": self.protocol}
        data["rest_is_noise"] = {axis: self.rest_is_noise(index) for index, axis in enumerate(AXES)}
        if self.raw is not None:
            data["unaligned"] = compare_errors(*self.raw, self.goals)
        data["noise_um"] = None if self.noise is None else self.noise.to_dict()
        data["unmatched"] = self.unmatched
        data["outlier_rows"] = {side: list(rows) for side, rows in self.gross.items()}
        return data

    def rest_is_noise(self, axis: int) -> bool | None:
        """Whether the error that remains on an axis is no more than readings scatter; None where nobody knows that."""
        if self.noise is None:
            return None
        wide = self.noise.sigma[axis] * MEAN_OF_NORMAL  # relative variance: of a mean of sizes, of a standard deviation
        doubt = np.sqrt((1.0 / MEAN_OF_NORMAL**2 - 1.0) / len(self.after) + 0.5 / self.noise.freedom)
        return bool(np.abs(self.after[:, axis]).mean() <= wide * (1.0 + SURE * doubt))


def compare_errors(before: np.ndarray, after: np.ndarray, goals: Mapping[str, float] = GOALS) -> dict[str, Any]:
    """Mean absolute error per axis before and after, and its reduction.

    Args:
        before: (m, 3) mm.
        after: (m, 3) mm.
        goals: percent per axis.

    Returns:
        'axes' -> x, y, z -> before_um, after_um, reduction_percent, goal_percent, goal_met; alike without goal 'total',
        the root of the axes' summed squares, and 'length', of the error vector's length in each row.
    """
    first, second = (1e3 * np.abs(errors).mean(axis=0) for errors in (before, after))
    axes: dict[str, Any] = {}
    for index, axis in enumerate(AXES):
        axes[axis] = _reduction(float(first[index]), float(second[index])) | {"goal_percent": goals[axis]}
        gained = axes[axis]["reduction_percent"]
        axes[axis]["goal_met"] = gained is not None and gained >= goals[axis]
    total = _reduction(float(np.linalg.norm(first)), float(np.linalg.norm(second)))
    lengths = (1e3 * float(np.linalg.norm(errors, axis=1).mean()) for errors in (before, after))
    return {"axes": axes, "total": total, "length": _reduction(*lengths)}


def errors_of(
    table: Table, file: MachineFile | None, frame: str | None = None, rows: np.ndarray | None = None
) -> Errors:
    """Errors of a run's poses.

    Args:
        table: n rows.
        file: the machine, whose tracker policy counts; None: the best rigid motion.
        frame: 'trusted', 'fitted', 'fitted-per-run' or 'measured' instead of the machine's.
        rows: that count, (n,) bool; None for all.

    Returns:
        The errors; targets that are not given are what the commands ask of the drawing.

    Raises:
        TableError: too few readings, no targets, base reflectors missing.
    """
    policy = frame or (file.tracker.frame if file is not None else "fitted")
    target = targets_of(table, file)
    pose = (table.role != "base") & np.isfinite(target).all(axis=1) & np.isfinite(table.measured).all(axis=1)
    if file is None and not np.isfinite(target).any():
        fix = "add x_cmd, y_cmd, z_cmd, or name with --model the machine that says where its commands go"
        raise TableError("no targets", where=table.source, fix=fix)
    if rows is not None:
        pose &= rows
    if not pose.any():
        raise TableError("no row has both a target and a reading", where=table.source, fix="check columns and roles")
    raw = np.where(pose[:, None], table.measured - target, np.nan)
    moved, words = _align(table, file, target, pose, policy)
    aligned = np.where(pose[:, None], moved - target, np.nan)
    return Errors(raw, aligned, words, _noise(table, target, moved, file))


def evaluate_pair(
    before: Table,
    after: Table,
    file: MachineFile | None = None,
    *,
    frame: str | None = None,
    z_datum: Datum = "absolute",
    rows: np.ndarray | None = None,
) -> Evaluation:
    """Compare two runs of the same poses, both treated alike.

    Args:
        before: run without compensation.
        after: run with it.
        file: the machine, whose tracker policy counts; None: the best rigid motion for each run.
        frame: policy instead of the machine's.
        z_datum: 'first' refers z errors to the first pose of each run, as the source paper does.
        rows: rows of `before` that count, (n,) bool; None for all. Frames are found from all rows that both runs have.

    Returns:
        The evaluation.

    Raises:
        TableError: no pose in common, or a run that cannot be evaluated.
    """
    one, two = errors_of(before, file, frame), errors_of(after, file, frame)
    first, second, unmatched = match_rows(before, after, _found(one), _found(two))
    if not len(first) or (rows is not None and not rows[first].any()):
        fix = "run both on the same targets, or name the points alike"
        raise TableError(f"no pose in common with {before.source}", where=after.source, fix=fix)
    wanted, whole = targets_of(before, file), (one, two)
    _require_poses(before, after, count_places(wanted[first]), frame or (file.tracker.frame if file else "fitted"))
    if z_datum == "absolute":  # else the first pose of each run counts, whether or not the other has it
        one, two = (
            _of_shared(errors, table, file, frame, own, bool(unmatched[side]))
            for errors, table, own, side in zip(whole, (before, after), (first, second), SIDES, strict=True)
        )
    if rows is not None:
        first, second = first[rows[first]], second[rows[first]]
    every, places = (first, second), wanted[first]
    off = gross_rows(before, whole[0].aligned)[first], gross_rows(after, whole[1].aligned)[second]
    gross = {side: index[found].tolist() for side, index, found in zip(SIDES, every, off, strict=True) if found.any()}
    sound = ~(off[0] | off[1])

    def chosen(errors: str, kept: np.ndarray | slice = slice(None)) -> tuple[np.ndarray, np.ndarray]:
        sides = zip((one, two), (before, after), every, strict=True)
        own, other = (_refer_z(getattr(each, errors), table, at[kept], z_datum) for each, table, at in sides)
        return own, other

    protocol = {
        "rows": len(first),
        "poses": count_places(places),
        "frame": one.frame,
        "z_datum": z_datum,
        "measured": True,
        "held_out": None,
        "before": before.source,
        "after": after.source,
    }
    without = chosen("aligned", sound) if gross and sound.any() else None
    return Evaluation(
        *chosen("aligned"), protocol, chosen("raw"), two.noise, unmatched, matched=every, gross=gross, without=without
    )


def _of_shared(
    errors: Errors, table: Table, file: MachineFile | None, frame: str | None, own: np.ndarray, more: bool
) -> Errors:
    """Errors in the frame of the rows that both runs have: what one alone has would turn it, and its errors with it."""
    with suppress(TooFewError):  # a run of its own frame may have next to none of them
        return errors_of(table, file, frame, np.isin(np.arange(table.rows), own)) if more else errors
    return errors


def _require_poses(before: Table, after: Table, poses: int, policy: str) -> None:
    """Refuse a comparison at fewer poses than a frame that the readings tell would take up."""
    if policy in ("fitted", "fitted-per-run") and poses < LEAST_ROWS:
        what = f"only {poses} pose{'' if poses == 1 else 's'} in common with {before.source}"
        fix = f"run both on the same targets: a fitted frame needs {LEAST_ROWS} poses; or give --frame trusted"
        raise TableError(what, where=after.source, fix=fix)


def _reduction(before: float, after: float) -> dict[str, Any]:
    gained = 100.0 * (before - after) / before if before > 0.0 else None
    return {"before_um": before, "after_um": after, "reduction_percent": gained}


def _align(
    table: Table, file: MachineFile | None, target: np.ndarray, pose: np.ndarray, policy: str
) -> tuple[np.ndarray, str]:
    if policy == "measured" and file is None:
        raise TableError("no machine file states the base reflectors", where="--frame measured", fix="add --model")
    free = policy in ("fitted", "fitted-per-run")
    frame = table.run if policy == "fitted-per-run" else np.zeros(table.rows, dtype=int)
    for index in np.unique(frame[pose]) if free else ():
        if count_places(target[pose & (frame == index)]) < LEAST_ROWS:
            fix = f"measure at least {LEAST_ROWS} poses, or use --frame trusted"
            raise TooFewError("too few poses to find the tracker's frame", where=table.source, fix=fix)
    reading = build_problem(file, table).measured if policy == "measured" and file else table.measured
    seats = seats_of(table, file, target, reading, pose, frame, free=free)
    beside = "" if seats is None else ", the reflector's seat on the tool subtracted"
    seat = np.zeros_like(target) if seats is None else seats
    if not free:
        own = "trusted: none" if policy == "trusted" else "measured: base reflectors"
        return reading - seat, own + beside
    rotations, shifts = np.tile(np.eye(3), (int(frame.max()) + 1, 1, 1)), np.zeros((int(frame.max()) + 1, 3))
    for index in np.unique(frame[pose]):
        here = pose & (frame == index)
        rotations[index], shifts[index] = align((target + seat)[here], table.measured[here])
    motion = "best rigid motion of each run" if policy == "fitted-per-run" else "best rigid motion"
    words = f"{policy}: {motion}{beside}, before and after alike"
    return into_base(table.measured, frame, rotations, shifts) - seat, words


def seats_of(
    table: Table, file: MachineFile | None, target: np.ndarray, reading: np.ndarray, pose: np.ndarray,
    frame: np.ndarray, *, free: bool,
) -> np.ndarray | None:  # fmt: skip
    """How far an arm's reflector stands from the tool point where nobody knows where on the tool it sits.

    Args:
        table: n rows.
        file: the machine; None where nobody tells it.
        target: (n, 3) mm.
        reading: (n, 3) mm.
        pose: rows that count, (n,) bool.
        frame: (n,) int, tracker frame of each row.
        free: whether the frames are unknown.

    Returns:
        (n, 3) mm in the base frame; None where the reflector is at the tool point, by the machine file or by nobody's
        word.
    """
    mount = None if file is None else mount_of_rows(file, table)
    if file is None or mount is None or (mount < 0).all():
        return None
    by_mount = mount_slopes(build_problem(file, table).view)
    mounts = mounts_beside(target, by_mount, reading, pose, mount, frame, free=free)
    return np.asarray(np.einsum("nij,nj->ni", by_mount, mounts[mount]))


def _noise(table: Table, target: np.ndarray, measured: np.ndarray, file: MachineFile | None) -> Noise | None:
    asked = table.target if table.command is None else table.command
    direction = travel_direction(asked, run_starts(table.run)).astype(float)
    if table.direction is not None and table.direction.shape == direction.shape:
        direction = np.where(np.abs(table.direction) > 0.0, table.direction, direction)
    sigma = None if file is None else file.tracker.sigma_mm
    # As in a problem: encoders that report where an arm stands differ from repeat to repeat, and so does its place.
    scatter = measured - target if table.joint_prefix == "q" else measured
    return given_noise(table, scatter, direction, sigma)


def _found(errors: Errors) -> np.ndarray:
    return np.isfinite(errors.aligned).all(axis=1)


def _refer_z(errors: np.ndarray, table: Table, index: np.ndarray, z_datum: Datum) -> np.ndarray:
    """Errors of rows `index`, z less the mean z error of the run's first pose where asked."""
    usable = np.isfinite(errors).all(axis=1) & (table.role == "pose")
    return refer_z(errors, table.target, usable, z_datum)[index]


def refer_z(errors: np.ndarray, target: np.ndarray, usable: np.ndarray, z_datum: Datum) -> np.ndarray:
    """Errors with z as the datum has it.

    Args:
        errors: (n, 3) mm.
        target: (n, 3) mm.
        usable: rows of which one is the first, (n,) bool.
        z_datum: 'first' takes the mean z error of the first pose, all its readings together, off all of them.

    Returns:
        (n, 3) mm.
    """
    if z_datum != "first":
        return errors
    rows = np.flatnonzero(usable)
    same = rows[same_places(target[rows]) == 0]
    return errors - np.array([0.0, 0.0, errors[same, 2].mean()])
