"""A network over an arm's joint commands is asked at postures, and where there are none that is said."""

from pathlib import Path

import numpy as np
import pytest
import torch

import ptt
from nets import train_rbf
from ptt.challenge.challenge import new_challenge
from ptt.commands.main import run
from ptt.correct import blocks
from ptt.correct.training.compensator import Compensator, write_compensator
from ptt.door import streaming
from ptt.machine import MachineFile, load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.table import make_table
from ptt.run.written import write_table

ARM = Path(__file__).resolve().parents[1] / "data" / "arm" / "machine.toml"
NOTES = {
    "format": 1,
    "trained_on": [],
    "heldout_rms_um": {},
    "protocol": "none",
    "rbf": {"centres": 1, "learned": [True] * 3, "share": 0.5, "inputs": "joints"},
}


def poses(file: MachineFile) -> np.ndarray:
    arm = build_mechanism(file.machine)
    return np.asarray(arm.home()) + np.random.default_rng(0).uniform(-0.3, 0.3, (60, arm.joints))


def compensator(file: MachineFile, folder: Path) -> Path:
    q = poses(file)
    network = train_rbf(q, 0.01 * np.sin(q[:, :3]), np.arange(len(q)) % 6).network
    write_compensator(folder / "compensator", Compensator(Model(file), network, NOTES))
    return folder / "compensator"


@pytest.mark.parametrize("long", [False, True])
def test_places_alone_are_refused_in_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys, long: bool) -> None:
    file = load_machine(ARM)
    place = build_mechanism(file.machine).forward(torch.as_tensor(poses(file))).numpy()
    np.savetxt(tmp_path / "t.csv", place, delimiter=",", header="x_cmd,y_cmd,z_cmd", comments="", fmt="%.3f")
    if long:
        monkeypatch.setattr(streaming, "LONG", 0)
    words = ["predict", tmp_path / "t.csv", "--model", compensator(file, tmp_path), "--out", tmp_path / "o.csv"]
    assert run([str(word) for word in words]) == 2
    assert "trained on joint commands and these targets have none" in capsys.readouterr().err


def test_blocks_know_which_of_their_postures_the_network_was_trained_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, model = load_machine(ARM), ptt.load(compensator(load_machine(ARM), tmp_path))
    arm = build_mechanism(file.machine)
    q = np.asarray(arm.home()) + np.random.default_rng(1).uniform(-0.2, 0.2, (90, arm.joints))
    q[50:] += 0.5
    write_table(make_table(arm.forward(torch.as_tensor(q)).numpy(), q, joint_prefix="q"), tmp_path / "t.csv")
    whole = ptt.predict(model, tmp_path / "t.csv", anyway=True).commands
    assert model.compensator.network is not None
    np.testing.assert_array_equal(whole.in_domain, model.compensator.network.inside(q))
    assert whole.in_domain[:50].any() and not whole.in_domain[50:].any()
    monkeypatch.setattr(blocks, "ROWS", 20)
    monkeypatch.setattr(blocks, "NEIGHBOUR_ROWS", 5)
    parts = ptt.predict(model, tmp_path / "t.csv", anyway=True).commands
    np.testing.assert_array_equal(parts.in_domain, whole.in_domain)
    np.testing.assert_array_equal(parts.status, whole.status)


def test_an_opened_seal_measures_its_commands(tmp_path: Path, capsys) -> None:
    made = new_challenge(tmp_path / "challenge", "single", seed=3, machine=load_machine(ARM)).to_dict()
    folder = compensator(load_machine(made["machine"]), tmp_path)
    assert run(["challenge", "reveal", str(tmp_path / "challenge"), "--model", str(folder)]) == 0
    assert "after  x" in capsys.readouterr().out
