"""Rows of a list of targets that are no plain targets: base reflectors, commands without a place, readings beside."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from test_commands_main import error_line, invoke
from test_compensate import PLAY

import ptt
from ptt.correct.compensate import compensate
from ptt.door import streaming
from ptt.machine import save_machine
from ptt.run.table import make_table
from ptt.run.written import write_table

DATA = Path(__file__).resolve().parents[1] / "data"
SENT = ["b1", "b2", "b3"]
PLACE, COMMAND, READ = (
    [title.format(each) for each in names]
    for title, names in (("{}_cmd", "xyz"), ("b{}_cmd", "123"), ("{}_meas", "xyz"))
)


@pytest.fixture
def model(tmp_path) -> Path:
    save_machine(PLAY.file, tmp_path / "m.toml")
    return tmp_path / "m.toml"


def predicted(rows: pd.DataFrame, model: Path, *more: object) -> tuple[dict, pd.DataFrame, str]:
    given, out = model.parent / "t.csv", model.parent / "s.csv"
    rows.to_csv(given, index=False)
    result = invoke("predict", given, "--model", model, "--out", out, *more, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout), pd.read_csv(out, keep_default_na=False, na_values=[""]), result.stderr


@pytest.mark.parametrize("long", [False, True])
def test_rows_of_base_reflectors_pass_without_commands_and_change_no_other(model, monkeypatch, long):
    if long:
        monkeypatch.setattr(streaming, "LONG", 0)
    targets = pd.read_csv(DATA / "targets.csv")[["x_cmd", "y_cmd", "z_cmd"]].iloc[:30].assign(role="pose")
    base = pd.DataFrame({"role": ["base"] * 3})
    _, plain, _ = predicted(targets, model)
    data, mixed, _ = predicted(pd.concat([base, targets[:12], base, targets[12:], base]), model)
    assert (data["rows"], data["sent"], data["base_rows"], data["in_domain"]) == (30, 30, 9, 30)
    assert len(mixed) == 39 and (mixed["role"] == "base").sum() == 9
    blank = mixed[mixed["role"] == "base"].drop(columns="role")
    assert blank.isna().all(axis=None)
    there = mixed[mixed["role"] == "pose"].reset_index(drop=True)
    np.testing.assert_array_equal(there[[*SENT, "reversal1"]], plain[[*SENT, "reversal1"]])
    assert (there["status"] == "ok").all() and there["in_domain"].all()


def test_commands_of_a_plan_with_base_reflectors_are_driven_by_the_rig(tmp_path, model):
    rig = DATA / "rigs" / "experiment1.toml"
    names = pd.read_csv(DATA / "experiment1.csv").query("role == 'base'")["name"].unique()
    poses = pd.read_csv(DATA / "targets.csv")[["name", "role", *PLACE]].iloc[:20]
    base = pd.DataFrame({"name": names, "role": "base"})
    predicted(pd.concat([base, poses, base]), model)
    args = ["simulate", rig, tmp_path / "t.csv", "--sliders", tmp_path / "s.csv", "--out", tmp_path / "r.csv"]
    assert invoke(*args).exit_code == 0
    run, sent = pd.read_csv(tmp_path / "r.csv"), pd.read_csv(tmp_path / "s.csv")
    assert set(run.loc[run["role"] == "base", "name"]) == set(names)
    poses = run["role"].ne("base") & run["name"].isin(poses["name"])
    np.testing.assert_allclose(run.loc[poses, "b1_cmd"].iloc[:20], sent["b1"].dropna(), atol=1e-9)


def test_loads_that_reflectors_do_not_state_are_no_empty_cells(model):
    targets = pd.read_csv(DATA / "targets.csv")[PLACE].iloc[:20].assign(role="pose", payload_kg=2.0)
    loaded = ptt.load(DATA / "machine.toml").physics + ptt.effects.ColumnBend()
    term = loaded.terms[0]
    save_machine(PLAY.file, model)
    bent = model.read_text() + '\n[[effect]]\nname = "column-bend"\n[effect.parameters]\n'
    bent += "".join(f"{each.name} = {{ value = [0.01, 0.0] }}\n" for each in term.effect.parameters)
    model.write_text(bent)
    _, plain, _ = predicted(targets, model)
    _, mixed, _ = predicted(pd.concat([targets[:5], pd.DataFrame({"role": ["base"]}), targets[5:]]), model)
    np.testing.assert_array_equal(mixed[mixed["role"] == "pose"][SENT], plain[SENT])


@pytest.mark.parametrize("long", [False, True])
def test_commands_of_sliders_alone_ask_for_where_the_drawing_puts_the_tool(model, monkeypatch, long):
    if long:
        monkeypatch.setattr(streaming, "LONG", 0)
    targets = pd.read_csv(DATA / "targets.csv")[PLACE].iloc[:30]
    drawn = ptt.predict(ptt.load(DATA / "machine.toml"), targets.to_numpy()).b
    _, plain, _ = predicted(targets, model)
    _, commanded, said = predicted(pd.DataFrame(drawn, columns=COMMAND), model)
    np.testing.assert_allclose(commanded[SENT], plain[SENT], atol=1e-9)
    np.testing.assert_allclose(commanded[PLACE], targets, atol=1e-9)
    assert "30 rows have joint commands and no x_cmd, y_cmd, z_cmd: the target is where the drawing puts" in said


def test_a_target_that_is_missing_beside_others_is_stated_in_their_frame(model):
    targets = pd.read_csv(DATA / "targets.csv")[PLACE].iloc[:30].to_numpy()
    shift = np.array([100.0, -50.0, 20.0])
    drawn = ptt.predict(ptt.load(DATA / "machine.toml"), targets).b
    rows = pd.DataFrame(np.hstack([targets - shift, drawn]), columns=[*PLACE, *COMMAND])
    rows.loc[7, PLACE] = np.nan
    _, plain, _ = predicted(pd.DataFrame(targets, columns=PLACE), model)
    _, moved, _ = predicted(rows, model)
    np.testing.assert_allclose(moved[SENT], plain[SENT], atol=1e-6)
    np.testing.assert_allclose(moved.loc[7, PLACE].astype(float), targets[7] - shift, atol=1e-6)


def test_postures_of_an_arm_have_base_reflectors_between_them_too(tmp_path):
    drawing = DATA / "machines" / "ur10.toml"
    joints = np.linspace(0.1, 0.5, 60).reshape(10, 6) + np.array([0.0, -1.5, 1.2, 0.0, 0.4, 0.0])
    write_table(make_table(None, joints, joint_prefix="q"), tmp_path / "t.csv")
    plain = ptt.predict(drawing, tmp_path / "t.csv")
    rows = pd.read_csv(tmp_path / "t.csv").assign(role="pose")
    mixed = ptt.predict(drawing, pd.concat([rows[:4], pd.DataFrame({"role": ["base"]}), rows[4:]]))
    np.testing.assert_array_equal(np.delete(mixed.q, 4, axis=0), plain.q)
    assert np.isnan(mixed.q[4]).all() and mixed.status[4] == "" and not mixed.sent[4]
    assert mixed.to_dict()["base_rows"] == 1 and mixed.plot().axes


def test_commands_of_an_arm_have_the_place_that_they_are_to_reach(tmp_path):
    """Read back, corrected commands alone would tell another target."""
    drawing = DATA / "machines" / "ur10.toml"
    joints = np.linspace(0.1, 0.5, 60).reshape(10, 6) + np.array([0.0, -1.5, 1.2, 0.0, 0.4, 0.0])
    write_table(make_table(None, joints, joint_prefix="q"), tmp_path / "t.csv")
    told = ptt.predict(drawing, tmp_path / "t.csv")
    place = ptt.load(drawing).mechanism.forward(torch.as_tensor(joints)).numpy()
    np.testing.assert_allclose(told.to_frame()[["x_cmd", "y_cmd", "z_cmd"]], place, atol=1e-6)
    assert any(line.startswith("10 rows have joint commands and no x_cmd") for line in told.notes)


@pytest.mark.parametrize("long", [False, True])
def test_readings_that_were_copied_from_the_targets_are_replaced_and_no_others(tmp_path, model, monkeypatch, long):
    if long:
        monkeypatch.setattr(streaming, "LONG", 0)
    run, out = pd.read_csv(DATA / "experiment1.csv").query("role == 'pose'").iloc[:40], tmp_path / "s.csv"
    args = ["predict", tmp_path / "t.csv", "--model", model, "--out", out]
    predicted(run, model)
    first = out.read_bytes()
    assert invoke(*args).exit_code == 0 and out.read_bytes() == first
    frame = pd.read_csv(out)
    for other in (
        frame.assign(x_meas=frame["x_meas"] + 1e-3),
        pd.concat([frame, frame[-1:]]),
    ):  # read at these commands
        other.to_csv(out, index=False)
        kept = out.read_bytes()
        assert error_line(invoke(*args)).endswith("s.csv: holds readings; nothing was written; name another file")
        assert out.read_bytes() == kept
    run.to_csv(out, index=False)  # the same readings in a run, whose other columns are not copied
    assert "holds readings" in error_line(invoke(*args))


def test_commands_with_rows_left_out_say_nothing_of_these():
    targets = make_table(pd.read_csv(DATA / "targets.csv")[PLACE].iloc[:5].to_numpy())
    commands = compensate(PLAY, targets)
    from ptt.correct.commands import without

    rows = np.arange(5) == 2
    blank = without(commands, rows)
    assert np.isnan(blank.q[2]).all() and blank.status[2] == "" and sum(blank.counts.values()) == 4
    np.testing.assert_array_equal(blank.q[~rows], commands.q[~rows])
    assert without(commands, rows & False) is commands
