"""Rounded commands: joint values logged with fewer digits than the targets from which they were computed."""

import numpy as np
import torch

from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.workspace import translation_rank
from ptt.run.noise import step_of
from ptt.run.table import Table

FINE = 1e-3  # mm: rounding to a micrometre leaves 0.3 um rms, less than any tracker resolves
NEAR = 0.5 + 1e-3  # largest rounding error in steps
PLANNED = 0.05  # mm or degrees: coarser steps are those in which commands were planned
SEEN = 0.3  # ratio of rounding error to noise from which it shows in many readings
LEAST = 0.05  # rms in steps: rounding errors have 0.29, commands that were planned in steps none


def rounded_to(file: MachineFile, table: Table) -> float:
    """The step to which joint commands were rounded, where the targets determine them more finely.

    A controller sends what it computes; a log with two decimals is off by 3 um rms, the same at each visit to a pose,
    unlike noise.

    Args:
        file: the machine.
        table: n rows, targets in the base frame.

    Returns:
        mm or degrees; zero where commands are as fine as the targets, where they differ from them by more than rounding
        (a correction that was sent), or where either is missing.
    """
    return _finer(file, table)[0]


def unrounded(file: MachineFile, table: Table) -> Table:
    """The table with the joint values of its targets, where its commands are these but for rounding.

    Args:
        file: the machine.
        table: n rows, targets in the base frame.

    Returns:
        The table; unchanged where `rounded_to` is zero.
    """
    command = _finer(file, table)[1]
    return table if command is None else table.replace(command=command)


def unrounded_by(file: MachineFile, table: Table, step: float) -> Table:
    """Some rows of a run with the joint values of its targets, its step of rounding known; arguments as `unrounded`.

    Args:
        file: the machine.
        table: n rows, targets in the base frame.
        step: `rounded_to` of the whole run, mm or degrees.

    Returns:
        The table; rows whose commands are further from their targets than that keep them, and so do all for a step of
        zero.
    """
    known = _known(table)
    if table.command is None or not (step and known.any()):
        return table
    move, length = _least_moves(file, table.command[known], table.target[known], step)
    command, near = table.command.copy(), length <= NEAR
    command[np.flatnonzero(known)[near]] += move[near]
    return table.replace(command=command)


def left_by_rounding(file: MachineFile, table: Table, jacobian: np.ndarray) -> tuple[float, float]:
    """Rounding error of joint commands that the targets do not determine more finely.

    Targets alone are as a rule planned in the steps in which they are written.

    Args:
        file: the machine.
        table: n rows, targets in the base frame.
        jacobian: (n, 3, k) of the drawing.

    Returns:
        The step, mm or degrees, and the rms displacement of the tool by rounding to it, mm; zeros where the step is so
        coarse that joints will have been planned in it.
    """
    if table.command is None:
        return 0.0, 0.0
    step = _step(file, table.command[np.isfinite(table.command).all(axis=1)])
    if not step <= PLANNED:
        return 0.0, 0.0
    size = np.radians(step) if file.machine.kind == "serial" else step
    return step, float(size * np.sqrt(np.nanmean(np.square(jacobian).sum(axis=(1, 2))) / 12.0))


def _step(file: MachineFile, q: np.ndarray) -> float:
    """The step of some commands (m, k), in mm or degrees; zero where they have none."""
    return step_of(np.degrees(q) if file.machine.kind == "serial" else q)


def _finer(file: MachineFile, table: Table) -> tuple[float, np.ndarray | None]:
    """The step, and joint values (n, k) mm or rad of the targets; zero and None where commands are not rounded."""
    if table.command is None:
        return 0.0, None
    known = _known(table)
    if not known.any():
        return 0.0, None
    q, target = table.command[known], table.target[known]
    arm, step = file.machine.kind == "serial", _step(file, q)
    if step <= (0.0 if arm else FINE) or step_of(target) > (FINE if arm else 0.5 * step):
        return 0.0, None
    move, length = _least_moves(file, q, target, step)
    if not (length <= NEAR).all() or np.sqrt(np.mean(length**2)) < LEAST:
        return 0.0, None
    command = table.command.copy()
    command[known] = q + move
    return step, command


def _known(table: Table) -> np.ndarray:
    """Rows (n,) that have both commands and targets."""
    told = np.isfinite(table.target).all(axis=1)
    return np.asarray(told if table.command is None else told & np.isfinite(table.command).all(axis=1))


def _least_moves(file: MachineFile, q: np.ndarray, target: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """The least moves (m, k) of joints q to their targets, and their rms over the joints in steps, (m,)."""
    size = np.radians(step) if file.machine.kind == "serial" else step
    mechanism = build_mechanism(file.machine)
    at = torch.as_tensor(q)
    lacks = torch.as_tensor(target) - mechanism.forward(at)
    # The least-norm step of a redundant arm: the rounding errors have at least that length.
    move = least_move(mechanism.jacobian(at), lacks, translation_rank(mechanism)).numpy()
    return move, np.linalg.norm(move, axis=1) / (size * np.sqrt(q.shape[1]))
