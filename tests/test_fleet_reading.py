"""A run in a store is read as every other verb reads it: its conditions, and columns that mean nothing."""

from functools import partial
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd
import pytest
import torch
from command_line import invoke
from test_fleet_store import MACHINE

import ptt
from ptt.fleet.queue import next_task
from ptt.fleet.readings import read_columns
from ptt.fleet.runs import open_task, read_task
from ptt.fleet.store import create_store
from ptt.mechanisms import build_mechanism
from ptt.run.from_columns import columns_to_table
from ptt.run.table import Table, make_table
from ptt.run.watched import watch, watched_values
from ptt.run.written import table_to_frame

fleet = partial(invoke, "fleet")
ROWS = 120


@pytest.fixture
def frame() -> pd.DataFrame:
    """A run in which it gets warmer."""
    random, row = np.random.default_rng(5), np.arange(ROWS)
    poses = np.round(random.uniform(-50.0, 50.0, (ROWS, 3)), 3)
    read = poses + 0.003 * random.normal(size=poses.shape)
    return table_to_frame(make_table(poses, None, read, time_s=15.0 * row, temp_c=np.round(20.0 + 8.0 * row / ROWS, 3)))


def both(frame: pd.DataFrame, folder: Path, *options: object, **reading: object) -> tuple[Table, Table, object]:
    """A run as `ptt.read` reads it, as the store gives it back, and the problem that this is."""
    path = folder / "run.csv"
    frame.to_csv(path, index=False)
    store = create_store(folder / "store")
    added = fleet("add", store.folder, "mill", path, "--model", MACHINE, "--date", "2026-01-01", *options)
    assert added.exit_code == 0, added.stderr
    task = next_task(store, "mill")
    assert task is not None
    table, _ = read_task(task)
    return ptt.read(path, MACHINE, **reading).table, table, open_task(task, table).problem


@pytest.mark.parametrize("step", [None, 0.5])
def test_conditions_are_those_that_every_verb_takes_and_it_is_said(frame, tmp_path, step):
    if step is not None:
        frame["temp_c"] = step * np.round(frame["temp_c"] / step)
    frame.loc[50, ["temp_c", "time_s"]] = np.nan
    read, kept, problem = both(frame, tmp_path)
    for name in ("temp_c", "time_s"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(read, name), err_msg=name)
    assert {"temperature", "time"} <= set(problem.view.varies)
    again = fleet("add", tmp_path / "store", "mill", tmp_path / "run.csv")
    assert "temp_c is empty in 1 row: interpolated" in again.stderr


IGNORED = {"time_s": "ignore", "payload_kg": "ignore"}


def test_columns_that_mean_nothing_come_back_as_such_whatever_their_titles(frame, tmp_path):
    """Angles of motors of a tripod, a fourth direction, a clock and a load that the user said to ignore."""
    poses = np.array(frame[["x_cmd", "y_cmd", "z_cmd"]])
    sliders = build_mechanism(ptt.load(MACHINE).file.machine).inverse(torch.tensor(poses)).numpy()
    for joint in range(3):
        frame[f"b{joint + 1}_cmd"], frame[f"q{joint + 1}_cmd_rad"] = sliders[:, joint], sliders[:, joint] / 5.0
    frame = frame.assign(dir4=1.0, payload_kg=3.0, line=7, flow_l=np.arange(ROWS) % 5)
    frame.loc[100:, "time_s"] = 0.0
    (tmp_path / "map.toml").write_text("[columns]\n" + "".join(f'{title} = "ignore"\n' for title in IGNORED))
    answers = {"columns": IGNORED}
    read, kept, _ = both(frame, tmp_path, "--map", tmp_path / "map.toml", map=answers)
    assert kept.joint_prefix == "b" and kept.time_s is None and kept.payload_kg is None and kept.direction is None
    np.testing.assert_array_equal(kept.command, sliders)
    assert {"q1_cmd_rad", "dir4", "time_s", "line"} <= set(kept.extra) == set(read.extra)
    for title, values in read.extra.items():
        np.testing.assert_array_equal(kept.extra[title], values, err_msg=title)
    np.testing.assert_array_equal(watched_values(watch(kept, ["flow_l"]))["flow_l"], np.arange(ROWS) % 5)


def test_a_store_of_an_earlier_program_is_read_with_its_texts_as_the_users_own(tmp_path):
    """It kept them under their bare titles."""
    table = make_table(np.ones((4, 3)), np.ones((4, 3)), np.ones((4, 3)))
    old = table_to_frame(table).assign(machine="m", run_sha256="abc", line=table.line, time_s="9", q1_cmd_rad="x")
    duckdb.connect().register("old", old).execute(f"COPY old TO '{tmp_path}/old.parquet' (FORMAT parquet)")
    back = columns_to_table(read_columns(tmp_path / "old.parquet"), "run.csv", "abc")
    assert back.joint_prefix == "b" and back.time_s is None and back.command is not None
    assert {title: list(values) for title, values in back.extra.items()} == {
        "time_s": ["9"] * 4,
        "q1_cmd_rad": ["x"] * 4,
    }
