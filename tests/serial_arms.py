"""Arms with revolute joints: the ones of the data and planar ones, poses of theirs, and how close is close.

A fixture is imported under its own name (`arm as arm`): no line calls it, pytest finds it in the test file.
"""

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.machine import load_machine
from ptt.mechanisms.serial import Serial

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
PRESETS = ("kuka_iiwa", "assembly_robot", "ur10")


def preset(name: str) -> Serial:
    return Serial.from_spec(load_machine(MACHINES / f"{name}.toml").machine)


@pytest.fixture(params=PRESETS)
def arm(request) -> Serial:
    return preset(request.param)


def some_joints(arm: Serial, n: int, seed: int = 0) -> torch.Tensor:
    low, high = arm.limits().clamp(-2 * torch.pi, 2 * torch.pi)
    return low + (high - low) * torch.rand(n, arm.joints, dtype=torch.float64, generator=generator(seed))


def some_errors(arm: Serial, n: int, seed: int = 1, size: float = 0.01) -> torch.Tensor:
    return size * torch.randn(n, len(arm.slots), dtype=torch.float64, generator=generator(seed))


def generator(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def close(actual, expected, tolerance: float) -> None:
    actual, expected = (torch.as_tensor(value, dtype=torch.float64) for value in (actual, expected))
    torch.testing.assert_close(actual, expected, rtol=0.0, atol=tolerance)


def planar(lengths: tuple[float, ...], convention: str = "standard") -> Serial:
    k = len(lengths)
    a, tool = (lengths, 0.0) if convention == "standard" else ((0.0, *lengths[:-1]), lengths[-1])
    zero = (0.0,) * k
    return Serial("planar", convention, a, zero, zero, zero, (tool, 0.0, 0.0), ((-math.inf, math.inf),) * k)


# One factor of a chain that is worked out beside the library.
def elementary(kind: str, axis: int, value: float) -> np.ndarray:
    matrix = np.eye(4)
    if kind == "shift":
        matrix[axis, 3] = value
        return matrix
    u, v = (axis + 1) % 3, (axis + 2) % 3
    matrix[u, u] = matrix[v, v] = math.cos(value)
    matrix[v, u], matrix[u, v] = math.sin(value), -math.sin(value)
    return matrix
