"""The bench with a stated noise of its tracker, and runs of it whose joints err by what a test says."""

from dataclasses import replace

import numpy as np
import torch

from ptt.challenge.challenge import bench
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

NOISE = 0.004  # mm, one coordinate


def stated(frame: str = "fitted") -> MachineFile:
    file = bench()
    return replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": NOISE, "frame": frame}))


def run_of(
    file: MachineFile, target: np.ndarray, q_error: np.ndarray, seed: int, read: float = 1.0, **columns: object
) -> Problem:
    """A run of joints that err by so much, (n, 3) mm, read with noise and so many times too long."""
    robot = build_mechanism(file.machine)
    joints = robot.inverse(torch.as_tensor(target))
    reached = read * robot.forward(joints + torch.as_tensor(q_error)).numpy()
    noisy = reached + np.random.default_rng(seed).normal(0.0, NOISE, target.shape)
    return build_problem(file, replace(make_table(target, joints.numpy(), **columns), measured=noisy))


def up_and_down(rows: int) -> np.ndarray:
    """A helix that turns over in z half way, where the second run begins."""
    turn = np.linspace(0.0, 5.0 * np.pi, rows)
    height = 40.0 - 80.0 * np.abs(np.linspace(-1.0, 1.0, rows))
    return np.column_stack([50.0 * np.cos(turn), 50.0 * np.sin(turn), height])
