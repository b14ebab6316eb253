"""The file of corrected commands: its columns, its statuses, and the pairs that it keeps."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_compensate import GAP, PLAY, landing, mixed
from told_models import with_effects
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.correct.compensate import compensate
from ptt.door.tally import tally
from ptt.machine import load_machine, save_machine
from ptt.rig import parse_rig, simulate
from ptt.run.reading import read_table
from ptt.run.table import make_table
from ptt.run.written import write_table

DATA = Path(__file__).resolve().parents[1] / "data"
FILE = load_machine(DATA / "machine.toml")
TARGETS = read_table(DATA / "targets.csv", purpose="targets")


def test_predict_writes_the_documented_columns_without_loss(tmp_path):
    save_machine(PLAY.file, tmp_path / "m.toml")
    out = tmp_path / "s.csv"
    args = ["predict", str(DATA / "targets.csv"), "--model", str(tmp_path / "m.toml"), "--out", str(out)]
    result = CliRunner().invoke(app, args)
    assert result.exit_code == 0 and "sent: exact inversion\n" in result.stdout
    frame, given = (pd.read_csv(path, dtype=str) for path in (out, DATA / "targets.csv"))
    added = ["b1", "b2", "b3", "reversal1", "reversal2", "reversal3", "in_domain", "status", "shift_um", "sigma_um"]
    assert list(frame) == [*given, *added]
    pd.testing.assert_frame_equal(frame[["name", "role"]], given[["name", "role"]])
    places = ["x_cmd", "y_cmd", "z_cmd"]
    np.testing.assert_array_equal(frame[places].astype(float), given[places].astype(float))
    commands = compensate(PLAY, TARGETS)
    np.testing.assert_array_equal(frame[["b1", "b2", "b3"]].astype(float), commands.q)
    np.testing.assert_array_equal(frame[["reversal1", "reversal2", "reversal3"]].astype(float), commands.reversal)
    read = read_table(out, purpose="sliders")
    np.testing.assert_array_equal(read.command, commands.q)


def test_targets_with_commands_keep_them_and_readings_at_what_was_sent_are_paired_with_it(tmp_path):
    run = pd.read_csv(DATA / "experiment1.csv").query("role != 'base'").iloc[:60]
    run.to_csv(tmp_path / "run.csv", index=False)
    save_machine(PLAY.file, tmp_path / "m.toml")
    out = tmp_path / "s.csv"
    args = ["predict", str(tmp_path / "run.csv"), "--model", str(tmp_path / "m.toml"), "--out", str(out)]
    assert CliRunner().invoke(app, args).exit_code == 0
    frame = pd.read_csv(out)
    assert set(run) <= set(frame)
    np.testing.assert_array_equal(frame["b1_cmd"], run["b1_cmd"])
    run[["name", "x_meas", "y_meas", "z_meas"]].to_csv(tmp_path / "readings.csv", index=False)
    sent = frame.drop(columns=["x_meas", "y_meas", "z_meas"])
    sent.to_csv(tmp_path / "sent.csv", index=False)
    paired = read_table(tmp_path / "readings.csv", targets=tmp_path / "sent.csv")
    np.testing.assert_array_equal(paired.command, sent[["b1", "b2", "b3"]])
    again = read_table(tmp_path / "sent.csv", purpose="targets")
    np.testing.assert_array_equal(again.command, sent[["b1_cmd", "b2_cmd", "b3_cmd"]])


def test_predict_writes_the_file_and_ends_with_3_where_a_row_is_not_sent(tmp_path):
    targets, bad = mixed()
    write_table(targets, tmp_path / "t.csv")
    save_machine(PLAY.file, tmp_path / "m.toml")
    out = tmp_path / "s.csv"
    args = ["predict", str(tmp_path / "t.csv"), "--model", str(tmp_path / "m.toml"), "--out", str(out)]
    result = CliRunner().invoke(app, [*args, "--json"])
    assert result.exit_code == 3
    data = json.loads(result.stdout)
    assert data["sent"] == 55 and sum(data["status"].values()) == 60
    (said,) = [line for line in result.stderr.splitlines() if "not sent" in line]
    assert "5 of 60 rows are not sent" in said and "out of reach (rows 2" in said
    frame = pd.read_csv(out)
    assert frame.loc[bad, ["b1", "b2", "b3"]].isna().all(axis=None)
    assert frame.loc[~bad, ["b1", "b2", "b3"]].notna().all(axis=None)
    assert frame.loc[bad, ["nearest1", "nearest2", "nearest3", "nearest_mm"]].notna().all(axis=None)
    rig = DATA / "rigs" / "experiment1.toml"
    again = ["simulate", str(rig), str(tmp_path / "t.csv"), "--sliders", str(out), "--out", str(tmp_path / "r.csv")]
    refused = CliRunner().invoke(app, again)
    assert refused.exit_code == 2 and "b1" in refused.stderr
    small = CliRunner().invoke(app, [*args, "--limit-mm", "0.01"])
    assert small.exit_code == 3 and "too large" in small.stderr


def test_what_is_sent_beside_unreachable_rows_puts_the_rigs_tool_right(tmp_path):
    """The rig's own slider zeros and play, not the effects that describe them, judge the commands."""
    targets, bad = mixed()
    drive = {"homing_mm": [0.3, -0.2, 0.1], "backlash_mm": GAP}
    rig = parse_rig({"machine": FILE.machine.model_dump(), "drive": drive})
    commands = compensate(PLAY, targets)
    path = pd.DataFrame(targets.target[~bad], columns=["x_cmd", "y_cmd", "z_cmd"])
    sliders = pd.DataFrame(commands.q[~bad], columns=["b1", "b2", "b3"])
    before, after = simulate(rig, path, noise=False), simulate(rig, path, sliders=sliders, noise=False)
    error = [1e3 * np.linalg.norm(run.truth - targets.target[~bad], axis=1) for run in (before, after)]
    assert error[0].mean() > 100.0 and error[1][1:].max() < 0.5  # um; the state before the first row is nobody's


@pytest.mark.parametrize(("gap", "said"), [(-0.1, True), (0.1, False)])
def test_a_reversal_that_leaves_no_command_is_told_row_by_row(gap: float, said: bool) -> None:
    """A controller that gives too much at a reversal jumps past the end of a short move; play can be led through."""
    model = with_effects(FILE, backlash={"gap_mm": [gap] * 3})
    height = np.array([0.0, 5.0, 10.0, 9.98, 5.0, 0.0, 0.02, 5.0])  # at the fourth and the seventh it turns, for 0.02
    table = make_table(np.column_stack([0.0 * height, 0.0 * height, height]))
    commands = compensate(model, table)
    short = np.isin(np.arange(8), [3, 6])
    np.testing.assert_array_equal(commands.missed > 1e-3, short & said)
    np.testing.assert_array_equal(commands.status == "uncertain", short & said)
    miss = np.linalg.norm(landing(model, table, commands.q) - table.target, axis=1)
    np.testing.assert_allclose(miss, commands.missed, atol=1e-6)
    lines = tally(table, commands).warnings("targets.csv", network=False)
    assert any("no command brings it to their end" in line for line in lines) is said
