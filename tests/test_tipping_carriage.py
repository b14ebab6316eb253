"""Carriages that shift sideways: as their drive pulls them the other way, or once a turn of a bent screw."""

import numpy as np
import pytest
import torch
from conftest import BENCH
from scipy.optimize import fsolve

from ptt.diagnosis.diagnose import diagnose
from ptt.machine import parse_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

SHIFT = np.array([-0.025, 0.04, 0.03])  # mm to each side
OUT = np.array([[np.cos(azimuth), np.sin(azimuth), 0.0] for azimuth in np.radians([0.0, 120.0, 240.0])])
ASIDE = np.cross([0.0, 0.0, 1.0], OUT)


def closed(height: np.ndarray, shift: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Where three links of 300 mm hold the platform whose sliders stand at a height (3,), and aside by shift (3,)."""
    foot = 200.0 * OUT + shift[:, None] * ASIDE + height[:, None] * [0.0, 0.0, 1.0] - 100.0 * OUT
    return np.asarray(fsolve(lambda p: np.linalg.norm(foot - p, axis=1) - 300.0, near, xtol=1e-10))


def test_rails_that_shift_with_the_direction_are_no_towers_that_lean_though_nothing_states_the_noise() -> None:
    """Of random poses a slider that came from below stands high, so that the shift looks like a lean in part."""
    machine, random = parse_machine(BENCH, "bench.toml"), np.random.default_rng(11)
    target = random.uniform([-60.0, -60.0, -50.0], [60.0, 60.0, 50.0], (240, 3))
    height = build_mechanism(machine.machine).inverse(torch.as_tensor(target)).numpy()
    came = np.sign(np.diff(height, axis=0, prepend=height[:1] - (height[1:2] - height[:1])))
    there = np.array([closed(*row) for row in zip(height, came * SHIFT, target, strict=True)])
    read = there + random.normal(0.0, 0.001, there.shape)
    found = diagnose(Model(machine), build_problem(machine, make_table(target, measured=read)))
    assert found.verdict == "unknown" and not found.suggested
    assert {item.on for item in found.depends_on} <= {"direction1", "direction2", "direction3"}
    assert "as if rail" in found.words and found.noise.total < 0.004


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_a_bent_screw_that_pushes_its_carriage_aside_is_no_error_of_each_turn(seed: int) -> None:
    """It goes round: outward and to the side a quarter of a turn apart."""
    machine, random = parse_machine(BENCH, "bench.toml"), np.random.default_rng(seed)
    target = random.uniform([-60.0, -60.0, -50.0], [60.0, 60.0, 50.0], (200, 3))
    height = build_mechanism(machine.machine).inverse(torch.as_tensor(target)).numpy()
    turn = 2.0 * np.pi * height[:, 1] / machine.machine.screw_lead_mm
    read = target.copy()
    for row, (place, near) in enumerate(zip(height, target, strict=True)):
        foot = 100.0 * OUT + place[:, None] * [0.0, 0.0, 1.0]
        foot[1] += 0.02 * (np.cos(turn[row]) * OUT[1] + np.sin(turn[row]) * ASIDE[1])
        read[row] = fsolve(lambda p, foot=foot: np.linalg.norm(foot - p, axis=1) - 300.0, near, xtol=1e-10)
    read += random.normal(0.0, 0.002, read.shape)
    found = diagnose(Model(machine), build_problem(machine, make_table(target, measured=read)))
    assert found.verdict == "unknown" and not found.suggested
    assert {item.on for item in found.depends_on} == {"b2"} and found.noise.total < 0.005
