"""Readings without any noise, or with no more than their last digit: sound machines are sound, faults are named."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptt.again.recheck import recheck
from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.fitting.solve import fit
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.noise import least_variance
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

BENCH = bench()
GRID = np.stack(np.meshgrid([-60.0, 0.0, 60.0], [-60.0, 0.0, 60.0], [-45.0, 0.0, 45.0]), axis=-1).reshape(-1, 3)


def read_exactly(target: np.ndarray, hidden: tuple[str, list[float]] | None, step: float | None = None) -> Problem:
    """Readings of a machine in which one effect is hidden, to the last bit or in steps of mm; commands to 1 nm."""
    file = replace(BENCH, tracker=BENCH.tracker.model_copy(update={"frame": "trusted", "sigma_mm": None}))
    sent = np.round(build_mechanism(file.machine).inverse(torch.as_tensor(target)).numpy(), 6)
    table = make_table(target, sent, measured=target)
    if hidden is not None:
        shift = library()[hidden[0]](), torch.tensor(hidden[1], dtype=torch.float64)
        exact = predict([shift], build_problem(file, table).view)
        table = replace(table, measured=exact.reading.numpy())
    if step is not None:
        table = replace(table, measured=np.round(table.measured / step) * step)
    return build_problem(file, table)


def test_readings_that_equal_their_targets_are_of_a_sound_machine() -> None:
    random = np.random.default_rng(0)
    problem = read_exactly(np.round(random.uniform(-50.0, 50.0, (150, 3)), 1), None)
    found = diagnose(Model(BENCH), problem)
    assert found.verdict == "nothing-missing"
    assert 0.0 < found.noise.total < 1e-3


@pytest.mark.parametrize("step", [None, 1e-3])
def test_a_fault_without_noise_is_named_alone(step: float | None) -> None:
    random = np.random.default_rng(1)
    hidden = ("homing-offset", [0.03, -0.02, 0.05])
    problem = read_exactly(random.uniform(-50.0, 50.0, (150, 3)), hidden, step)
    found = diagnose(Model(BENCH), problem)
    assert (found.verdict, found.suggested[0][0], len(found.suggested)) == ("missing", "homing-offset", 1)


@pytest.mark.long
def test_repeats_that_read_exactly_alike_end_in_a_verdict() -> None:
    """Without scatter nothing is learned from repeats; what everything at once leaves of them is nothing at all."""
    problem = read_exactly(np.tile(GRID, (10, 1)), ("homing-offset", [0.03, -0.02, 0.05]), 1e-3)
    found = diagnose(Model(BENCH), problem)
    assert found.verdict == "missing" and "homing-offset" in found.suggested[0]
    assert found.noise.total == pytest.approx(5e-4, rel=0.1)


@pytest.mark.parametrize(("poses", "visits"), [(27, 10), (60, 3)])
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_what_rounding_leaves_at_a_pose_is_no_fault(poses: int, visits: int, seed: int) -> None:
    """It comes back with every visit, of a sound machine as of one that is solved already."""
    target = np.tile(np.random.default_rng(seed).uniform(-50.0, 50.0, (poses, 3)), (visits, 1))
    assert diagnose(Model(BENCH), read_exactly(target, None, 1e-3)).verdict == "nothing-missing"


def test_a_machine_that_is_read_again_without_noise_is_the_same() -> None:
    hidden = ("homing-offset", [0.03, -0.02, 0.05])
    first, later = (
        read_exactly(np.tile(np.random.default_rng(seed).uniform(-50.0, 50.0, (60, 3)), (3, 1)), hidden, 1e-3)
        for seed in (0, 1)
    )
    solved = fit(Model(first.file) + library()["homing-offset"](), first).model
    assert recheck(solved, later).verdict == "same"


def test_the_last_digit_of_a_reading_is_its_least_noise() -> None:
    random = np.random.default_rng(2)
    read = random.uniform(-50.0, 50.0, (40, 3))
    assert least_variance(np.round(read, 3)) == pytest.approx(1e-6 / 12.0)
    assert least_variance(read) == least_variance(np.round(read, 1)) == 1e-8  # no tracker reads to 0.1 mm
    assert least_variance(read, 1e-10) == 1e-10
    assert least_variance(np.round(read, 2), 1e-10) == pytest.approx(1e-4 / 12.0)
