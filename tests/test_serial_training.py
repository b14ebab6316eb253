"""The network over an arm's joints: taken where it holds out better, saved, and asked at the nominal joint commands."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import typer
from typer.testing import CliRunner

from nets import RbfSettings
from ptt.commands.main import app
from ptt.commands.train import train as train_command
from ptt.correct.compensate import compensate
from ptt.correct.training.compensator import load_compensator, save_compensator
from ptt.correct.training.protocols import random_protocol
from ptt.correct.training.rest import correction_of, spaces_of
from ptt.correct.training.train import Training, train
from ptt.machine import MachineFile, load_machine, save_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.rig.serial_arm import ArmFaults, ArmRig
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.written import write_table

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
ROWS, SIGMA = 400, 0.005
SETTINGS = RbfSettings(centre_counts=(64, 128), spreads=(2.0, 4.0), ridges=(1e-6, 1e-4), restarts=1)


def file_of() -> MachineFile:
    file = load_machine(MACHINES / "assembly_robot.toml")
    own = {"sigma_mm": SIGMA, "frame": "trusted", "tool": "trusted"}
    return replace(file, tracker=file.tracker.model_copy(update=own))


def draw(count: int, seed: int, share: float = 0.7) -> np.ndarray:
    """Joint values spread over the middle of the limits, rad."""
    low, high = build_mechanism(file_of().machine).limits().clamp(-2.0, 2.0).numpy()
    return (low + high) / 2 + share * (high - low) / 2 * np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 4))


def uneven() -> ArmRig:
    """Joints that err once a turn: a matter of the posture, not of the place."""
    random = np.random.default_rng(2)
    faults = replace(ArmFaults.none(4), wobble=random.choice([-1.0, 1.0], (4, 1, 2)) * 4e-4)
    return ArmRig(file_of().machine, faults, np.zeros(3), np.eye(4), SIGMA)


@pytest.fixture(scope="module")
def run() -> Problem:
    q = draw(ROWS, 1)
    readings = uneven().measure(q, np.zeros(ROWS), np.full(ROWS, 20.0), 3)
    return build_problem(file_of(), make_table(None, q, readings, joint_prefix="q"))


@pytest.fixture(scope="module")
def trained(run: Problem) -> Training:
    return train(Model(run.file), run, settings=SETTINGS, protocol=random_protocol(run))


def test_joints_hold_out_better_where_the_error_is_one_of_posture(trained: Training) -> None:
    assert set(trained.spaces_um) == {"tool", "joints"} and trained.space == "joints"
    assert trained.spaces_um["joints"] < 0.6 * trained.spaces_um["tool"]
    assert trained.heldout_um["rbf"]["total"] == pytest.approx(trained.spaces_um["joints"])
    assert trained.rbf.network.input_mean.shape == (4,)


def test_a_three_ptt_and_targets_without_joints_have_tool_space_only(run: Problem) -> None:
    assert spaces_of(run) == ("tool", "joints")
    assert spaces_of(replace(run, table=replace(run.table, command=None))) == ("tool",)


def test_commands_from_a_network_over_joints_mend_the_arm(trained: Training) -> None:
    fresh = draw(60, 8, 0.5)
    wanted = build_mechanism(file_of().machine).forward(torch.tensor(fresh)).numpy()
    correct = correction_of(trained.rbf.network, "joints")
    sent = compensate(Model(file_of()), make_table(None, fresh), correction=correct).q
    quiet = replace(uneven(), sigma_mm=0.0)
    before, after = (
        np.sqrt(np.square(quiet.measure(q, np.zeros(60), np.full(60, 20.0), 0) - wanted).sum(axis=1).mean())
        for q in (fresh, sent)
    )
    assert after < 0.4 * before, (before, after)


def test_folder_and_predict_keep_the_space(trained: Training, tmp_path: Path) -> None:
    folder = save_compensator(tmp_path / "c", trained, [])
    notes = json.loads((folder / "compensator.json").read_text())
    assert notes["rbf"]["inputs"] == "joints" and len(notes["domain_rad"]["low"]) == 4 and "domain_mm" not in notes
    assert load_compensator(folder).space == "joints"
    fresh = draw(20, 9, 0.5)
    write_table(make_table(None, fresh, joint_prefix="q"), tmp_path / "targets.csv")
    out = tmp_path / "commands.csv"
    command = ["predict", str(tmp_path / "targets.csv"), "--model", str(folder), "--out", str(out), "--json"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    sent = np.genfromtxt(out, delimiter=",", names=True)
    correct = correction_of(trained.rbf.network, "joints")
    wanted = compensate(Model(file_of()), make_table(None, fresh), correction=correct).q
    np.testing.assert_allclose(np.column_stack([sent[f"q{i + 1}"] for i in range(4)]), wanted, atol=1e-9)


def test_predict_asks_for_joint_commands_that_a_network_needs(trained: Training, tmp_path: Path) -> None:
    folder = save_compensator(tmp_path / "c", trained, [])
    place = build_mechanism(file_of().machine).forward(torch.tensor(draw(12, 4, 0.5))).numpy()
    write_table(make_table(place, joint_prefix="q"), tmp_path / "targets.csv")
    command = ["predict", str(tmp_path / "targets.csv"), "--model", str(folder), "--out", str(tmp_path / "o.csv")]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 2 and "q1_cmd_rad" in result.output


@pytest.mark.long
def test_train_tells_the_space(run: Problem, tmp_path: Path) -> None:
    write_table(run.table, tmp_path / "run.csv")
    save_machine(file_of(), tmp_path / "m.toml")
    command = [str(tmp_path / "run.csv"), "--machine", str(tmp_path / "m.toml"), "--out", str(tmp_path / "c")]
    own = typer.Typer()
    own.command()(train_command)
    result = CliRunner().invoke(own, [*command, "--hold-out", "random", "--json"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)["rbf"]
    assert told["inputs"] == "joints" and told["heldout_by_inputs_um"]["joints"] < told["heldout_by_inputs_um"]["tool"]
