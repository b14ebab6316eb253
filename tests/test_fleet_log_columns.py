"""The columns of a log: titles, units and cells are taken as those of a run, or refused in words."""

from dataclasses import fields
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd
import pytest
import torch
from test_fleet_log import made
from test_fleet_store import MACHINE

import ptt
from ptt.errors import InputError
from ptt.fleet.log import read_log
from ptt.fleet.sound import require_sound
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.run.table import Table, make_table
from ptt.run.written import table_to_frame

ARM = Path(__file__).resolve().parents[1] / "data" / "machines" / "ur10.toml"
TRIPOD = load_machine(MACHINE)
ALL = "LIMIT 100000"


def log_of(frame: pd.DataFrame, folder: Path) -> Path:
    """Its Parquet, as a logger writes it."""
    connection = duckdb.connect()
    connection.register("rows", frame)
    connection.execute(f"COPY rows TO '{folder}/log.parquet' (FORMAT parquet)")
    return folder / "log.parquet"


def assert_same(log: Table, run: Table) -> None:
    for name in (each.name for each in fields(Table) if each.name not in ("source", "understood", "run_sha256")):
        np.testing.assert_equal(getattr(log, name), getattr(run, name), err_msg=name)


def test_every_unit_of_the_file_format_is_that_of_a_run(tmp_path):
    angles = np.random.default_rng(1).uniform(-1.0, 1.0, (60, 6))
    place = build_mechanism(load_machine(ARM).machine).forward(torch.as_tensor(angles)).numpy()
    frame = table_to_frame(make_table(place, angles, place + 0.01, joint_prefix="q", time_s=60.0 * np.arange(60.0)))
    radians, other = [f"q{joint}_cmd_rad" for joint in range(1, 7)], {"x_meas": "x_meas_um", "time_s": "time_min"}
    frame = frame.assign(feed_mm_min=600.0 + np.arange(60), temp_f=68.0, tau2=1.0, x_meas=1e3 * frame["x_meas"])
    frame["time_s"] /= 60.0
    frame[radians] = np.degrees(frame[radians])
    frame = frame.rename(columns={**{title: title.replace("rad", "deg") for title in radians}, **other})
    frame.to_csv(tmp_path / "run.csv", index=False)
    log = read_log(load_machine(ARM), log_of(frame, tmp_path), ALL)
    np.testing.assert_allclose(log.command, angles, atol=1e-12)
    np.testing.assert_allclose(log.feed_mm_s, 10.0 + np.arange(60) / 60.0)
    assert_same(log, ptt.read(tmp_path / "run.csv", ARM).table)


def test_joints_that_the_machine_does_not_have_are_no_commands_and_it_is_said(tmp_path):
    """Angles of a tripod's motors, and a fourth direction."""
    frame = table_to_frame(made(60))
    frame = frame.assign(**{f"q{joint}_cmd_rad": frame[f"b{joint}_cmd"] / 5.0 for joint in (1, 2, 3)}, dir1=1, dir4=1)
    path, notes = log_of(frame, tmp_path), list[str]()
    log = read_log(TRIPOD, path, ALL)
    np.testing.assert_array_equal(log.command, frame[["b1_cmd", "b2_cmd", "b3_cmd"]])
    assert log.joint_prefix == "b" and log.direction.shape == (60, 3)
    require_sound(TRIPOD, path, path, note=notes.append)
    assert "first 60 rows: not used: q1_cmd_rad, q2_cmd_rad, q3_cmd_rad (this machine's joints are b1..)" in notes
    with pytest.raises(InputError, match=r"missing: b2_cmd .*; give the column its title, see docs/files.md"):
        read_log(TRIPOD, log_of(frame.drop(columns="b2_cmd"), tmp_path), ALL)


@pytest.mark.parametrize(
    ("title", "said"),
    [
        ("time", "column time: its title states no unit; name it time_s or time_ms"),
        ("feed", "column feed: its title states no unit; name it feed_mm_s or feed_mm_min"),
        ("payload_st", "column payload_st: 'st' is not a known unit of payload; name it payload_kg or payload_g"),
        ("x_meas_um", "columns x_meas and x_meas_um hold the same; remove or rename one"),
    ],
)
def test_a_quantity_that_would_be_left_out_is_refused_with_the_way_out(title, said, tmp_path):
    path = log_of(table_to_frame(made(60)).drop(columns="time_s").assign(**{title: 1.0}), tmp_path)
    for read in (lambda: read_log(TRIPOD, path, ALL), lambda: require_sound(TRIPOD, path, path)):
        with pytest.raises(InputError, match=said):
            read()


def test_names_that_begin_alike_and_whole_numbers_with_an_empty_cell_are_taken(tmp_path):
    frame = table_to_frame(made(60)).drop(columns="temp_c").assign(temp_air=20.0, temp_oil=30.0)
    counts = pd.array([1, None, *[3] * 58], dtype="Int64")
    log = read_log(TRIPOD, log_of(frame.assign(repeat=counts, name=counts, counter=counts), tmp_path), ALL)
    assert log.temp_c is None and log.name[:3].tolist() == ["1", "", "3"]
    np.testing.assert_array_equal(log.repeat[:3], [1.0, np.nan, 3.0])


def test_a_clock_in_another_unit_that_goes_back_is_refused_by_its_title(tmp_path):
    clock = np.r_[np.arange(30.0), np.arange(30.0)]
    path = log_of(table_to_frame(made(60)).drop(columns="time_s").assign(time_ms=clock), tmp_path)
    with pytest.raises(InputError, match=r"row 32, column time_ms: time goes back \(from 29 to 0 ms\)"):
        require_sound(TRIPOD, path, path)
