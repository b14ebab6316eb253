"""Empty cells of clock, warmth, load, feed and run: filled where they go on, else left aside or refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

import ptt
from ptt.door.model import load
from ptt.door.run import read_targets
from ptt.errors import TableError
from ptt.run.blanks import fill_blanks, has_blanks, without_empty
from ptt.run.reading import read_table
from ptt.run.table import Table
from ptt.run.viewing import build_view

ROWS = 12
MODEL = load(Path(__file__).resolve().parents[1] / "data" / "machine.toml")


@pytest.fixture
def frame() -> pd.DataFrame:
    row = np.arange(ROWS)
    columns = {
        f"{axis}_{kind}": 10.0 * np.sin(row + shift) for shift, axis in enumerate("xyz") for kind in ("cmd", "meas")
    }
    run = np.where(row < 6, "a", "b")
    return pd.DataFrame({"run": run, "time_s": 10.0 * row**2, "temp_c": 20.0 + 0.1 * row**2, **columns})


def written(frame: pd.DataFrame, folder: Path) -> Table:
    frame.to_csv(folder / "run.csv", index=False)
    return read_table(folder / "run.csv")


def read(frame: pd.DataFrame, folder: Path) -> tuple[Table, list[str]]:
    return fill_blanks(written(frame, folder))


def test_clock_and_warmth_go_on_between_two_values_of_a_run(frame, tmp_path):
    whole, lines = read(frame, tmp_path)
    assert lines == []
    frame.loc[[2, 3], "temp_c"] = np.nan  # warmth follows the clock here, so that both values come back
    frame.loc[[5, 6], "temp_c"] = np.nan  # at the ends of two runs: nothing goes on from one to the next
    table, lines = read(frame, tmp_path)
    np.testing.assert_allclose(table.temp_c[2:4], whole.temp_c[2:4])
    np.testing.assert_allclose(table.temp_c[5:7], whole.temp_c[[4, 7]])
    assert np.isfinite(table.measured).all()
    assert "temp_c is empty in 4 rows: interpolated, by the clock" in lines
    frame.loc[8, "time_s"] = np.nan
    assert read(frame, tmp_path)[0].time_s[8] == pytest.approx(0.5 * (whole.time_s[7] + whole.time_s[9]))


def test_warmth_goes_on_from_row_to_row_where_the_clock_was_restarted(frame, tmp_path):
    """By a clock that falls, the empty cell between 27 and 29 deg C became 22."""
    whole = frame.assign(run="a", time_s=10.0 * (np.arange(ROWS) % 6), temp_c=20.0 + np.arange(ROWS))
    whole.assign(temp_c=whole.temp_c.where(~whole.index.isin([2, 8]))).to_csv(tmp_path / "run.csv", index=False)
    table, lines = fill_blanks(read_table(tmp_path / "run.csv", set_values={"order": "rows"}))
    np.testing.assert_allclose(table.temp_c, whole.temp_c)
    assert "temp_c is empty in 2 rows: interpolated, row by row" in lines


def test_loads_of_joints_stay_while_a_reflector_is_read_and_are_no_guess_at_a_pose(frame, tmp_path):
    row = np.arange(ROWS)
    frame = frame.assign(**{f"tau{joint}": joint + 0.1 * row for joint in (1, 2, 3)}, role="pose")
    frame.loc[[0, 7], "role"] = "base"
    frame.loc[[0, 7], ["x_cmd", "y_cmd", "z_cmd"]] = np.nan
    frame.loc[[0, 4, 7], ["tau1", "tau2", "tau3"]] = np.nan
    table, lines = read(frame, tmp_path)
    np.testing.assert_allclose(table.torque[[0, 4, 7], 0], 1.0 + 0.1 * np.array([1, 3, 6]))
    assert np.flatnonzero(np.isnan(table.measured).any(axis=1)).tolist() == [4]
    assert [line for line in lines if "tau1" in line] == [
        "loads of joints (tau1, ...) are empty in 1 row with a reading: left aside"
    ]


@pytest.mark.parametrize("column", ["payload_kg", "feed_mm_s"])
def test_a_reading_under_a_load_or_feed_that_nobody_wrote_down_is_left_aside(frame, tmp_path, column):
    frame[column] = np.where(np.arange(ROWS) < 8, 1.0, 4.0)
    frame.loc[[0, 5], column] = np.nan
    frame.loc[5, ["x_meas", "y_meas", "z_meas"]] = np.nan  # a row without a reading misses nothing
    table, lines = read(frame, tmp_path)
    assert np.isnan(table.measured[[0, 5]]).all() and np.isfinite(np.delete(table.measured, [0, 5], axis=0)).all()
    assert np.isfinite(getattr(table, column)).all()
    assert any(line.startswith(f"{column} is empty in 1 row with a reading: left aside") for line in lines)
    frame[column] = 2.0
    frame.loc[4, column] = np.nan
    table, lines = read(frame, tmp_path)
    assert (getattr(table, column) == 2.0).all() and np.isfinite(table.measured[4]).all()


def test_a_column_without_any_value_is_as_it_was(frame, tmp_path):
    table, lines = read(frame.assign(payload_kg=np.nan), tmp_path)
    assert np.isfinite(table.measured).all() and lines == []


def test_a_run_without_any_value_of_what_another_has_keeps_its_readings_and_it_is_said(frame, tmp_path):
    frame["payload_kg"] = np.where(np.arange(ROWS) % 2, 1.0, 4.0)
    frame.loc[6:, ["payload_kg", "temp_c"]] = np.nan
    table, lines = read(frame, tmp_path)
    assert np.isfinite(table.measured).all() and np.isnan(table.payload_kg[6:]).all()
    assert lines == [
        f"{name} is empty in all of run 'b': what depends on it is not examined" for name in ("temp_c", "payload_kg")
    ]


def test_a_row_that_does_not_say_its_run_is_refused_and_one_that_comes_back_is_told(frame, tmp_path):
    frame.loc[4, "run"] = None
    with pytest.raises(TableError, match="row 6, column run: no run, although other rows have one"):
        written(frame, tmp_path)
    frame["run"] = None
    assert written(frame, tmp_path).run_label == ("",)
    frame["run"] = list("aaaabbaabbbb")
    told = "run 'a' resumes after rows of another run; travel begins anew there, 2 times in all"
    assert told in written(frame, tmp_path).understood.lines


def with_reflectors(frame: pd.DataFrame) -> pd.DataFrame:
    """The same with three reflectors read first, in the middle and at last, of which only name and place are noted."""
    base = pd.DataFrame({"name": ["r1", "r2", "r3"], "role": "base", **{f"{axis}_meas": 1.0 for axis in "xyz"}})
    return pd.concat([base, frame[:3], base, frame[3:], base], ignore_index=True)


def test_a_reflector_that_names_no_run_is_of_the_run_that_it_was_read_in(frame, tmp_path):
    table, lines = read(with_reflectors(frame), tmp_path)
    assert table.run_label == ("a", "b") and lines == []
    assert table.run.tolist() == [0] * 12 + [1] * 9
    assert np.isfinite(table.time_s).all() and (np.diff(table.time_s) >= 0.0).all()
    assert not any("resumes" in line or "between two runs" in line for line in table.understood.lines)


def test_reflectors_between_two_runs_are_of_the_one_before_and_it_is_said(frame, tmp_path):
    base = with_reflectors(frame)[:3]
    table = written(pd.concat([frame[:6], base, frame[6:]], ignore_index=True), tmp_path)
    assert table.run.tolist() == [0] * 9 + [1] * 6
    told = "row 8 and 2 more of base reflectors between two runs: taken as of 'a', the one before"
    assert told in table.understood.lines


@pytest.mark.parametrize("label", [None, "reflectors"])
def test_reflectors_apart_leave_what_effects_see_as_it_is(frame, tmp_path, label):
    """The machine stands meanwhile: before its first pose where this will be."""
    frame = frame.assign(payload_kg=2.0, run="a")
    whole, apart = with_reflectors(frame), frame
    whole["run"] = whole["run"].fillna(label) if label else whole["run"]
    views = [build_view(MODEL.file, read(each, tmp_path)[0]) for each in (whole, apart)]
    pose = torch.tensor((whole["role"] != "base").tolist())
    for name in ("q", "p", "payload", "warmth", "time"):
        assert torch.isfinite(getattr(views[0], name)).all(), name
        torch.testing.assert_close(getattr(views[0], name)[pose], getattr(views[1], name))


def test_a_file_of_reflectors_beside_a_run_is_no_set_up_of_the_machine(frame, tmp_path):
    with_reflectors(frame)[:3].drop(columns=["run", "time_s", "temp_c"]).to_csv(tmp_path / "base.csv", index=False)
    frame.to_csv(tmp_path / "run.csv", index=False)
    run = ptt.read(tmp_path / "run.csv", MODEL, also=[tmp_path / "base.csv"])
    assert np.isfinite(run.table.time_s).all()
    assert {each.mistake for each in ptt.check(MODEL, run).findings} == {"base-reflectors"}  # it has others


def test_targets_are_filled_as_a_run_is_and_a_column_without_a_value_is_as_none(frame, tmp_path):
    frame = frame.drop(columns=[f"{axis}_meas" for axis in "xyz"])
    frame.to_csv(tmp_path / "t.csv", index=False)
    whole = read_targets(tmp_path / "t.csv", MODEL).table
    frame.loc[[2, 3], "temp_c"], frame["payload_kg"] = np.nan, np.nan
    frame.to_csv(tmp_path / "t.csv", index=False)
    targets = read_targets(tmp_path / "t.csv", MODEL)
    np.testing.assert_allclose(targets.table.temp_c, whole.temp_c)
    assert has_blanks(targets.table) and not has_blanks(without_empty(targets.table))
    assert "temp_c is empty in 2 rows: interpolated, by the clock" in targets.notes
