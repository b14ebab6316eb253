"""Zeros and frozen readings of a tracker without its beam are no readings; the same digits at one pose are."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptt.door.model import load
from ptt.door.options import ReadOptions
from ptt.door.reading import read_rows
from ptt.run.lost import without_lost
from ptt.run.table import Table, make_table

DATA = Path(__file__).resolve().parents[1] / "data"
STRETCH = slice(20, 35)
READ = ["x_meas", "y_meas", "z_meas"]


@pytest.fixture
def frame() -> pd.DataFrame:
    return pd.read_csv(DATA / "sealed_three" / "run.csv")


def read(frame: pd.DataFrame, folder: Path) -> tuple[Table, list[str]]:
    frame.to_csv(folder / "run.csv", index=False)
    notes = list[str]()
    machine = load(DATA / "sealed_three" / "machine.toml").file
    return read_rows(folder / "run.csv", machine, ReadOptions(json=True), note=notes.append), notes


@pytest.mark.parametrize("zeros", [True, False])
def test_a_stretch_of_zeros_or_of_one_frozen_reading_is_no_reading_and_is_said(frame, tmp_path, zeros):
    whole, _ = read(frame, tmp_path)
    frame.loc[20:34, READ] = 0.0 if zeros else frame.loc[19, READ].to_numpy()
    table, notes = read(frame, tmp_path)
    lost = np.zeros(table.rows, dtype=bool)
    lost[STRETCH if zeros else slice(19, 35)] = True
    assert np.isnan(table.measured[lost]).all()
    np.testing.assert_array_equal(table.measured[~lost], whole.measured[~lost])
    (line,) = [note for note in notes if "no reading" in note]
    said = "15 rows between 22 and 36 read exactly 0, 0, 0" if zeros else "16 rows between 21 and 36 repeat a reading"
    assert line.startswith(said) and line in table.understood.lines


def test_the_same_digits_at_one_pose_are_readings(tmp_path):
    """A frame with its origin at home, read to a tenth of a millimetre, has home at zero each time."""
    target = np.array([[0.0, 0.0, 0.0], [30.0, -20.0, 10.0], [-40.0, 5.0, 0.0]] * 4)
    table = make_table(target, measured=np.round(target + 0.01, 1))
    assert without_lost(table) is table
    base = make_table(np.full_like(target, np.nan), measured=np.ones_like(target), role=np.full(len(target), "base"))
    assert without_lost(base) is base


@pytest.mark.parametrize(("digits", "lost"), [(4, True), (3, True), (1, False)])
def test_a_reading_that_stays_while_the_machine_goes_on_by_small_steps_is_none(digits, lost):
    """Noise changes a fine last digit at every row; a coarse one may stay while a slider hangs in its play."""
    target = 100.0 + np.column_stack([np.arange(40) * 0.5, np.zeros(40), np.arange(40) * 0.2])
    noise = np.random.default_rng(3).normal(0.0, 0.005, target.shape)
    measured = np.round(target + noise, digits)
    measured[20:23] = measured[19]
    table = without_lost(make_table(target, measured=measured))
    assert np.flatnonzero(np.isnan(table.measured).all(axis=1)).tolist() == ([19, 20, 21, 22] if lost else [])
    measured[19:24] = 0.0
    assert np.isnan(without_lost(make_table(target, measured=measured)).measured[19:24]).all() == lost


def test_an_arm_that_is_told_by_its_joints_alone_has_frozen_readings_too():
    joints = np.linspace(0.0, 1.0, 8)[:, None] * np.ones(6)
    measured = np.random.default_rng(1).normal(size=(8, 3))
    measured[3:6] = measured[3]
    table = without_lost(make_table(None, joints, measured, joint_prefix="q"))
    assert np.flatnonzero(np.isnan(table.measured).all(axis=1)).tolist() == [3, 4, 5]


def test_a_reflector_on_the_axis_of_a_joint_that_turns_alone_stays_where_it_is():
    joints = np.tile([0.2, 0.4, -0.3, 0.1, 0.5, 0.0], (30, 1))
    joints[5:25, 5] = np.linspace(0.0, 0.6, 20)
    joints[25:] += np.linspace(0.1, 0.5, 5)[:, None]
    measured = np.random.default_rng(1).normal(size=(30, 3))
    measured[5:25] = measured[5]
    assert not np.isnan(without_lost(make_table(None, joints, measured, joint_prefix="q")).measured).any()


def test_the_last_digit_of_inches_is_one_too():
    target = 100.0 + np.column_stack([np.arange(60) * 0.06, np.zeros(60), np.zeros(60)])
    inches = np.round((target + np.random.default_rng(3).normal(0.0, 0.02, target.shape)) / 25.4, 2)
    assert not np.isnan(without_lost(make_table(target, measured=25.4 * inches)).measured).any()
