import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptt.commands.main import run
from ptt.machine import load_machine
from ptt.model.chain import predict
from ptt.model.entries import read_model
from ptt.run.table import make_table
from ptt.run.viewing import build_view

# torch itself still scripts its forward-mode formulas on first use
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


PLANAR = """
[[effect]]
name = "dh-offsets"
[effect.parameters]
da_mm = {value = [0.3, -0.2, 0.1, 0.2]}
dalpha_rad = {value = [0.0, 2e-4, 0.0, 0.0]}
dd_mm = {value = [0.05, 0.0, 0.0, 0.0]}
dtheta_rad = {value = [1e-3, -2e-3, 1e-3, 0.0]}
"""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_an_arm_that_stays_in_a_plane_is_corrected_in_it_and_what_lies_across_stays(tmp_path: Path, capsys) -> None:
    """Four parallel axes: no joint moves the tool along them, and J J^T has no inverse."""
    lengths = ((0.0, 130.0), (350.0, 0.0), (340.0, -20.0), (70.0, 0.0))
    joints = "".join(f"[[machine.joint]]\na_mm = {a}\nd_mm = {d}\nlimits_deg = [-170.0, 170.0]\n" for a, d in lengths)
    head = '[machine]\nkind = "serial"\nconvention = "modified"\ntool_mm = [50.0, 0.0, 0.0]\n'
    (tmp_path / "m.toml").write_text(head + joints + PLANAR)
    turns = np.random.default_rng(1).uniform(0.3, 1.2, (12, 4))
    pd.DataFrame(turns, columns=[f"q{j}_cmd_rad" for j in (1, 2, 3, 4)]).to_csv(tmp_path / "t.csv", index=False)
    out, model = tmp_path / "s.csv", read_model(load_machine(tmp_path / "m.toml"))
    assert run(["predict", str(tmp_path / "t.csv"), "--model", str(tmp_path / "m.toml"), "--out", str(out)]) == 0
    sent = pd.read_csv(out)
    assert set(sent["status"]) <= {"ok", "uncertain"}
    file = model.file
    wanted = build_view(file, make_table(None, command=turns)).p
    view = build_view(file, make_table(None, command=sent[["q1", "q2", "q3", "q4"]].to_numpy()))
    missed = (predict([(term.effect, term.theta) for term in model.terms], view).p - wanted).numpy()
    assert np.abs(missed[:, :2]).max() < 1e-6 and 0.03 < np.abs(missed[:, 2]).max() < 0.3
    assert "no joint moves the tool that way" in capsys.readouterr().err
    made = ["export", "--model", str(tmp_path / "m.toml"), "--to", "c", "--out", str(tmp_path / "c")]
    assert run(made) == 0
    build = ["gcc", "-std=c99", "-O2", "-Werror", "ptt_model.c", "ptt_selftest.c", "-lm"]
    subprocess.run(build, cwd=tmp_path / "c", check=True)
    assert subprocess.run(["./a.out"], cwd=tmp_path / "c", check=False).returncode == 0


def test_an_arm_that_stays_in_a_plane_has_commands_without_effects(tmp_path: Path, capsys) -> None:
    joints = "".join(
        f"[[machine.joint]]\na_mm = {length}\nlimits_deg = [-170.0, 170.0]\n" for length in (350.0, 340.0, 70.0)
    )
    (tmp_path / "m.toml").write_text(f'[machine]\nkind = "serial"\nconvention = "standard"\n{joints}')
    turns = np.random.default_rng(1).uniform(0.3, 1.5, (6, 3))
    pd.DataFrame(turns, columns=[f"q{j}_cmd_rad" for j in (1, 2, 3)]).to_csv(tmp_path / "t.csv", index=False)
    out = tmp_path / "s.csv"
    assert run(["predict", str(tmp_path / "t.csv"), "--model", str(tmp_path / "m.toml"), "--out", str(out)]) == 0
    assert set(pd.read_csv(out)["status"]) == {"ok"}
    told = capsys.readouterr().out
    assert "6 rows (6 ok)" in told and "largest static correction 0.0 um" in told


@pytest.mark.parametrize("frame", ["trusted", "fitted"])
def test_an_arm_that_is_read_in_its_plane_alone_errs_nowhere_across_it(frame: str, tmp_path: Path, capsys) -> None:
    """Across the plane every reading is exactly zero, and so is the error: no scale, no logarithm, no dependence."""
    joints = "".join(f"[[machine.joint]]\na_mm = {a}\nlimits_deg = [-150, 150]\n" for a in (400, 300))
    head = '[machine]\nkind = "serial"\nconvention = "standard"\n'
    model, file = str(tmp_path / "m.toml"), str(tmp_path / "run.csv")
    Path(model).write_text(f'{head}{joints}[tracker]\nframe = "{frame}"\nsigma_mm = 0.003\n')
    random = np.random.default_rng(0)
    turns = random.uniform(-1.2, 1.2, (120, 2))
    angle = np.cumsum(turns + np.array([4e-4, -7e-4]), axis=1)
    place = np.column_stack([np.cos(angle) @ [400.0, 300.0], np.sin(angle) @ [400.0, 300.0]])
    place = place + random.normal(0.0, 0.003, place.shape)
    rows = np.column_stack([turns, place, np.zeros(len(turns))])
    pd.DataFrame(rows, columns=["q1_cmd_rad", "q2_cmd_rad", "x_meas", "y_meas", "z_meas"]).to_csv(file, index=False)
    assert run(["compare", file, "--model", model, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["rms_um"]["z"] < 1e-6 and told["depends_on"]
    assert "z" not in {one["residual"] for one in told["depends_on"]}
    made = ["--out", str(tmp_path / "m2.toml"), "--plots", str(tmp_path)]
    assert run(["add", file, "homing-offset", "--model", model, *made]) == 0
    assert (tmp_path / "ladder.png").read_bytes()[:4] == b"\x89PNG"
    capsys.readouterr()
    assert run(["diagnose", file, "--model", model, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["suggested"] == [["homing-offset"]]
