"""Errors of runs whose targets are stated in a workpiece's frame: counted in the base frame, as the tracker's are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from ptt.errors import TableError
from ptt.judge.before_after import compare_pair
from ptt.judge.evaluate import evaluate_pair
from ptt.judge.run_errors import errors_of
from ptt.machine import MachineFile, load_machine
from ptt.machine_schema import TargetsSpec
from ptt.mechanisms import build_mechanism
from ptt.run.table import Table, concat_tables, make_table

DATA = Path(__file__).resolve().parents[1] / "data"
ORIGIN, TURN = np.array([120.0, -60.0, 40.0]), Rotation.from_euler("z", 50.0, degrees=True).as_matrix()
ALONG_X = np.array([0.2, 0.0, 0.0])  # mm, in the base frame
NOISE = 2e-3  # mm
STATED = TargetsSpec(origin_mm=tuple(ORIGIN), turn_deg=(0.0, 0.0, 50.0))


def bench(frame: str, targets: TargetsSpec | None = None) -> MachineFile:
    file = load_machine(DATA / "sealed_one" / "machine.toml")
    tracker = file.tracker.model_copy(update={"frame": frame})
    return replace(file, tracker=tracker, targets=targets or TargetsSpec())


def run_of(error: np.ndarray, *, lifted: np.ndarray | float = 0.0, seed: int = 1) -> Table:
    """Readings in the base frame, off by an error; targets of a workpiece; commands that are lifted by a correction."""
    random = np.random.default_rng(3)
    place = random.uniform(-40.0, 40.0, (48, 3))
    mechanism = build_mechanism(bench("trusted").machine)
    command = mechanism.inverse(torch.as_tensor(place + lifted)).numpy()
    reading = place + error + NOISE * np.random.default_rng(seed).normal(size=place.shape)
    return make_table((place - ORIGIN) @ TURN, command, reading, source=f"{seed}.csv")


def some_bare(table: Table) -> Table:
    """Every fourth row with commands alone."""
    return table.replace(target=np.where(np.arange(table.rows)[:, None] % 4 == 0, np.nan, table.target))


def all_bare(table: Table) -> Table:
    return table.replace(target=np.full_like(table.target, np.nan))


@pytest.mark.parametrize("stated", [STATED, None])
@pytest.mark.parametrize("bare", [lambda table: table, some_bare, all_bare])
@pytest.mark.parametrize("policy", ["trusted", "fitted"])
def test_the_frame_of_the_targets_is_no_error(policy: str, bare, stated: TargetsSpec | None) -> None:
    aligned = errors_of(bare(run_of(ALONG_X)), bench(policy, stated)).aligned
    left = ALONG_X if policy == "trusted" else np.zeros(3)
    np.testing.assert_allclose(aligned.mean(axis=0), left, atol=NOISE)
    assert np.abs(aligned - left).max() < 6.0 * NOISE


def test_runs_in_two_workpieces_share_the_trackers_frame() -> None:
    one, two = run_of(ALONG_X), run_of(ALONG_X, seed=2)
    both = concat_tables([one, two.replace(target=two.target + np.array([70.0, 0.0, 10.0]))])
    assert np.abs(errors_of(both, bench("fitted")).aligned).max() < 6.0 * NOISE


@pytest.mark.parametrize("stated", [STATED, None])
@pytest.mark.parametrize("bare", [lambda table: table, some_bare, all_bare])
@pytest.mark.parametrize("off", [ALONG_X, 10.0 * ALONG_X])
def test_a_correction_of_the_commands_is_no_frame(off: np.ndarray, bare, stated: TargetsSpec | None) -> None:
    """The machine is off by the same everywhere; the run after has that taken off its commands and is right."""
    file = bench("trusted", stated)
    before, after = run_of(off), bare(run_of(np.zeros(3), lifted=-off, seed=2))
    for pair in (evaluate_pair(before, after, file), compare_pair(before, after, file)):
        data = pair.to_dict()
        fall = data["axes"]["x"]["reduction_percent"] if "axes" in data else data["reduction_percent"]["x"]
        assert fall > 95.0


@pytest.mark.parametrize("with_commands", [True, False])
def test_commands_of_targets_in_the_base_frame_may_be_corrected_by_millimetres(with_commands: bool) -> None:
    file, off = bench("trusted"), 10.0 * ALONG_X
    runs = run_of(off), run_of(np.zeros(3), lifted=-off, seed=2)
    before, after = (table.replace(target=table.target @ TURN.T + ORIGIN) for table in runs)
    before = before if with_commands else before.replace(command=None)
    assert evaluate_pair(before, after, file).to_dict()["axes"]["x"]["reduction_percent"] > 95.0


def test_readings_in_the_frame_of_the_targets_are_no_trusted_ones() -> None:
    table = run_of(np.zeros(3))
    there = table.replace(measured=(table.measured - ORIGIN) @ TURN)
    for file in (bench("trusted"), bench("trusted", STATED)):
        with pytest.raises(TableError, match=r"trusted.*frame of the targets"):
            errors_of(there, file)
    assert np.abs(errors_of(there, bench("fitted")).aligned).max() < 6.0 * NOISE
