"""Rounded commands: joints that a log writes with fewer digits than the targets that they were worked out for."""

import numpy as np
import torch

from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.least_move import least_move
from ptt.mechanisms.workspace import translation_rank
from ptt.run.noise import step_of
from ptt.run.table import Table

FINE = 1e-3  # mm: a last digit of a micrometre leaves 0.3 um, less than any tracker reads
NEAR = 0.5 + 1e-3  # of a step, by which a rounded number is off at the most
PLANNED = 0.05  # mm or degrees: coarser steps are those of a plan
SEEN = 0.3  # of the noise, from which what rounding leaves of commands shows in many readings
LEAST = 0.05  # of a step, root mean square: rounding is off by 0.29, and joints that were planned in steps by nothing


def rounded_to(file: MachineFile, table: Table) -> float:
    """The step that joint commands were rounded to, where the targets tell them finer.

    A controller commands what it works out, and a log of two decimals is off by 3 um of it, the same at each visit to a
    pose, as no noise is.

    Args:
        file: the machine.
        table: n rows, targets in the base frame.

    Returns:
        mm or degrees; zero where commands are as fine as the targets, or other ones (a correction that was sent), or
        there are none of either.
    """
    return _finer(file, table)[0]


def unrounded(file: MachineFile, table: Table) -> Table:
    """The table with joints as its targets ask for them, where its commands are these but for rounding.

    Args:
        file: the machine.
        table: n rows, targets in the base frame.

    Returns:
        The table; as it is where `rounded_to` is zero.
    """
    command = _finer(file, table)[1]
    return table if command is None else table.replace(command=command)


def left_by_rounding(file: MachineFile, table: Table, jacobian: np.ndarray) -> tuple[float, float]:
    """What rounding may have taken off joint commands that nothing tells finer.

    Targets alone are as a rule planned in the steps that they are written in.

    Args:
        file: the machine.
        table: n rows, targets in the base frame.
        jacobian: (n, 3, k) of the drawing.

    Returns:
        The step, mm or degrees, and how far rounding to it puts the tool aside, root mean square, mm; zeros where
        steps are so coarse that joints will have been planned in them.
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
    """The step, and joints (n, k) mm or rad that lead to the targets; zero and None where there is nothing to do."""
    if table.command is None:
        return 0.0, None
    known = np.isfinite(table.command).all(axis=1) & np.isfinite(table.target).all(axis=1)
    if not known.any():
        return 0.0, None
    q, target = table.command[known], table.target[known]
    arm, step = file.machine.kind == "serial", _step(file, q)
    if step <= (0.0 if arm else FINE) or step_of(target) > (FINE if arm else 0.5 * step):
        return 0.0, None
    size = np.radians(step) if arm else step
    mechanism = build_mechanism(file.machine)
    at = torch.as_tensor(q)
    lacks = torch.as_tensor(target) - mechanism.forward(at)
    # The least move: an arm of more than three joints has others, and that of a rounding is no longer than it is.
    move = least_move(mechanism.jacobian(at), lacks, translation_rank(mechanism)).numpy()
    length = np.linalg.norm(move, axis=1) / (size * np.sqrt(q.shape[1]))
    if not (length <= NEAR).all() or np.sqrt(np.mean(length**2)) < LEAST:
        return 0.0, None
    command = table.command.copy()
    command[known] = q + move
    return step, command
