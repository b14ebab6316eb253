"""A run in a store is read as every other verb reads it: its conditions, and columns that mean nothing."""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import invoke
from test_fleet_store import MACHINE

import ptt
from ptt.fleet.queue import next_task
from ptt.fleet.runs import open_task, read_task
from ptt.fleet.store import create_store
from ptt.run.table import Table, make_table
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
