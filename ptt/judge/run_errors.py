"""Errors of a run's poses, measured less target, in the frame that the tracker's policy asks for."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ptt.effects import Library, library
from ptt.errors import TableError, TooFewError
from ptt.judge.match import targets_of
from ptt.machine import MachineFile
from ptt.model.chain import trace
from ptt.model.entries import read_model
from ptt.run.base_frame import into_base, refuse_untrue
from ptt.run.direction import travel_direction
from ptt.run.frames import align
from ptt.run.given_noise import given_noise
from ptt.run.mounts import mount_of_rows, mount_slopes, mounts_beside
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.same_pose import count_places, same_places
from ptt.run.table import Table
from ptt.run.target_frame import target_frames
from ptt.run.travel import run_starts
from ptt.run.wanted import placed

LEAST_ROWS = 4  # poses: a rigid motion needs three, and fitted to three alone it would absorb most of their errors

Datum = Literal["absolute", "first"]
Turns = tuple[np.ndarray, np.ndarray]  # rotation of each tracker frame from the base frame to it, and frame of each row


@dataclass(frozen=True)
class Errors:
    """Errors of the rows of one run, n rows.

    Attributes:
        raw: measured less target as stated, without alignment, (n, 3) mm; NaN where not observed, and on base
            reflectors.
        aligned: measured less target after the frame policy, in the base frame, (n, 3) mm.
        frame: the policy, in words.
        noise: noise floor from repeats, std columns or the machine file; None where nothing tells it.
    """

    raw: np.ndarray
    aligned: np.ndarray
    frame: str
    noise: Noise | None = None


def errors_of(
    table: Table, file: MachineFile | None, frame: str | None = None, rows: np.ndarray | None = None,
    known: Library | None = None,
) -> Errors:  # fmt: skip
    """Errors of a run's poses.

    Args:
        table: n rows.
        file: the machine, whose tracker policy counts; None: the best rigid motion.
        frame: 'trusted', 'fitted', 'fitted-per-run' or 'measured' instead of the machine's.
        rows: that count, (n,) bool; None for all.
        known: effects by name, which turn an arm's tool; None for the library.

    Returns:
        The errors; missing targets are the forward kinematics of the commands by the drawing.

    Raises:
        TableError: too few readings, no targets, base reflectors missing, or readings that are trusted to be in the
            base frame and are in that of the targets.
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
    stated = table.target if file is None else placed(file, table).target
    raw = np.where(pose[:, None], table.measured - stated, np.nan)
    if file is not None and policy == "trusted":
        refuse_untrue(table, target, target_frames(file, table, corrected=True), pose)
    moved, words, turns = _align(table, file, target, pose, policy, known)
    aligned = np.where(pose[:, None], moved - target, np.nan)
    return Errors(raw, aligned, words, _noise(table, target, moved, file, turns))


def refer_z(errors: np.ndarray, target: np.ndarray, usable: np.ndarray, z_datum: Datum) -> np.ndarray:
    """Refer z errors to a datum.

    Args:
        errors: (n, 3) mm.
        target: (n, 3) mm.
        usable: rows that may be the datum, (n,) bool.
        z_datum: 'first' subtracts the mean z error over all readings of the first usable pose; 'absolute' nothing.

    Returns:
        (n, 3) mm.
    """
    if z_datum != "first":
        return errors
    rows = np.flatnonzero(usable)
    same = rows[same_places(target[rows]) == 0]
    return errors - np.array([0.0, 0.0, errors[same, 2].mean()])


def _align(
    table: Table, file: MachineFile | None, target: np.ndarray, pose: np.ndarray, policy: str, known: Library | None
) -> tuple[np.ndarray, str, Turns]:
    """Readings in the base frame, (n, 3) mm, what was taken off them in words, and how each frame is turned."""
    if policy == "measured" and file is None:
        raise TableError("no machine file states the base reflectors", where="--frame measured", fix="add --model")
    free = policy in ("fitted", "fitted-per-run")
    frame = table.run if policy == "fitted-per-run" else np.zeros(table.rows, dtype=int)
    for index in np.unique(frame[pose]) if free else ():
        if count_places(target[pose & (frame == index)]) < LEAST_ROWS:
            fix = f"measure at least {LEAST_ROWS} poses, or use --frame trusted"
            raise TooFewError("too few poses to find the tracker's frame", where=table.source, fix=fix)
    reading, turns = table.measured, (np.eye(3)[None], np.zeros(table.rows, dtype=int))
    if policy == "measured" and file:
        problem = build_problem(file, table)
        reading, turns = problem.measured, (problem.rotation, problem.frame)
    seats = seats_of(table, file, target, reading, pose, frame, free=free, known=known)
    words = frame_words(policy, seated=seats is not None)
    seat = np.zeros_like(target) if seats is None else seats
    if not free:
        return reading - seat, words, turns
    rotations, shifts = np.tile(np.eye(3), (int(frame.max()) + 1, 1, 1)), np.zeros((int(frame.max()) + 1, 3))
    for index in np.unique(frame[pose]):
        here = pose & (frame == index)
        rotations[index], shifts[index] = align((target + seat)[here], table.measured[here])
    return into_base(table.measured, frame, rotations, shifts) - seat, words, (rotations, frame)


def frame_words(policy: str, *, seated: bool) -> str:
    """What is taken off the readings before they are compared with targets.

    Args:
        policy: 'fitted', 'fitted-per-run', 'measured' or 'trusted'.
        seated: whether the offset of an arm's reflector from the tool point is as well.
    """
    beside = ", the reflector's seat on the tool subtracted" if seated else ""
    if policy in ("trusted", "measured"):
        return f"{'trusted: none' if policy == 'trusted' else 'measured: base reflectors'}{beside}"
    motion = "best rigid motion of each run" if policy == "fitted-per-run" else "best rigid motion"
    return f"{policy}: {motion}{beside}, before and after alike"


def seats_of(
    table: Table, file: MachineFile | None, target: np.ndarray, reading: np.ndarray, pose: np.ndarray,
    frame: np.ndarray, *, free: bool, known: Library | None = None,
) -> np.ndarray | None:  # fmt: skip
    """Fitted offset of an arm's reflector from the tool point, where its seat on the tool is unknown.

    How the tool is turned follows the machine file's effects: at a reflector 30 mm aside a milliradian is 30 um.

    Args:
        table: n rows.
        file: the machine, or None.
        target: of the tool point, (n, 3) mm.
        reading: of the reflector, (n, 3) mm.
        pose: rows that count, (n,) bool.
        frame: (n,) int, tracker frame of each row.
        free: whether the frames are unknown.
        known: effects by name; None for the library.

    Returns:
        Offsets in the base frame, (n, 3) mm; None where none is fitted: no machine file, or one that states the seat.
    """
    mount = None if file is None else mount_of_rows(file, table)
    if file is None or mount is None or (mount < 0).all():
        return None
    by_mount = _axes_of_tool(file, table, library() if known is None else known)
    mounts = mounts_beside(target, by_mount, reading, pose, mount, frame, free=free)
    return np.asarray(np.einsum("nij,nj->ni", by_mount, mounts[mount]))


def _axes_of_tool(file: MachineFile, table: Table, known: Library) -> np.ndarray:
    """Axes of the tool's frame at each row, (n, 3, 3), under the effects of the machine file that are known."""
    view = build_problem(file, table).view
    entries = tuple(entry for entry in file.effect if entry.name in known)
    if not entries:
        return mount_slopes(view)
    terms = read_model(replace(file, effect=entries), known, checked=True).terms
    return np.asarray(trace([(term.effect, term.theta) for term in terms], view).by_slot[..., -3:].numpy())


def _noise(
    table: Table, target: np.ndarray, measured: np.ndarray, file: MachineFile | None, turns: Turns
) -> Noise | None:
    asked = table.target if table.command is None else table.command
    direction = travel_direction(asked, run_starts(table.run)).astype(float)
    if table.direction is not None and table.direction.shape == direction.shape:
        direction = np.where(np.abs(table.direction) > 0.0, table.direction, direction)
    sigma = None if file is None else file.tracker.sigma_mm
    # Encoder readings as commands differ from repeat to repeat, and so do their targets; as in `build_problem`.
    scatter = measured - target if table.joint_prefix == "q" else measured
    return given_noise(table, scatter, direction, sigma, *turns)
