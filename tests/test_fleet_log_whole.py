"""What a run of all rows is treated with before a fit, part by part: the same rows come of it, or it is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from test_fleet_log import made
from test_fleet_log_columns import log_of
from test_fleet_store import MACHINE

from ptt.errors import InputError
from ptt.fleet import log_whole
from ptt.fleet.fit_log import fit_file
from ptt.fleet.log import enter_part, hand_on, open_log, read_part
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.run.base_frame import into_base
from ptt.run.conditions import settle_conditions
from ptt.run.lost import without_lost
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.written import table_to_frame

ROWS, SIZE = 3000, 700
FILE = load_machine(MACHINE)


@pytest.fixture
def frame() -> pd.DataFrame:
    """A run on the move whose targets have all their digits."""
    return table_to_frame(made(ROWS))


def both(frame: pd.DataFrame, folder: Path) -> tuple[Problem, list[Problem]]:
    """The problem of all rows as every verb poses it, and those of a log's parts."""
    frame.to_csv(folder / "run.csv", index=False)
    table, _ = settle_conditions(without_lost(read_table(folder / "run.csv")))
    log, parts, state = open_log(FILE, log_of(frame, folder), SIZE), list[Problem](), None
    for part in log.parts:
        rows = read_part(log, part)
        parts.append(enter_part(rows, part, state))
        state = hand_on(rows, part, state)
    whole = build_problem(FILE, table)
    shared = into_base(whole.table.measured, whole.frame, log.whole.rotation, log.whole.shift)  # its first estimate
    return replace(whole, measured=shared), parts


def assert_same(whole: Problem, parts: list[Problem]) -> None:
    for name in ("q", "p", "warmth", "payload", "time"):
        joined = torch.cat([getattr(part.view, name) for part in parts])
        torch.testing.assert_close(joined, getattr(whole.view, name), rtol=1e-10, atol=1e-9, equal_nan=True)
    for name in ("used", "measured"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_allclose(joined, getattr(whole, name), rtol=1e-10, atol=1e-9)


def test_rounded_commands_are_those_that_the_targets_ask_for_in_every_part(frame, tmp_path):
    titles, targets = ["b1_cmd", "b2_cmd", "b3_cmd"], np.array(frame[["x_cmd", "y_cmd", "z_cmd"]])
    exact = build_mechanism(FILE.machine).inverse(torch.tensor(targets)).numpy()
    frame[titles] = np.round(exact, 2)
    whole, parts = both(frame, tmp_path)
    np.testing.assert_allclose(torch.cat([part.view.q for part in parts]), exact, atol=1e-5)
    assert_same(whole, parts)
    frame.loc[1500, titles] += 0.4  # sent otherwise: the command counts there, in a row that no sample of a log sees
    log = open_log(FILE, log_of(frame, tmp_path), SIZE)
    odd = replace(log, rounded=0.01)
    q = enter_part(read_part(odd, log.parts[2]), log.parts[2], None).view.q[1500 - log.parts[2][0]].numpy()
    np.testing.assert_array_equal(q, frame.loc[1500, titles])


def test_a_fit_says_that_rounded_commands_are_not_taken_at_their_word(frame, tmp_path):
    titles = ["b1_cmd", "b2_cmd", "b3_cmd"]
    frame[titles] = frame[titles].round(2)
    model, notes = tmp_path / "m.toml", list[str]()
    model.write_text(MACHINE.read_text() + '\n[[effect]]\nname = "homing-offset"\n')
    fit_file(log_of(frame[:600], tmp_path), model, tmp_path / "out.toml", note=notes.append)
    assert "joint commands are those of the targets, rounded to 0.01 mm; the targets tell finer and count" in notes


@pytest.mark.parametrize("clock", [True, False])
def test_conditions_are_filled_as_in_the_whole(frame, tmp_path, clock):
    frame = frame.assign(payload_kg=3.0, feed_mm_s=20.0)
    frame.loc[560:630, "temp_c"] = frame.loc[[0, 1, 2990, 2999], "temp_c"] = np.nan
    frame.loc[[3, 599, 600, 1400], "time_s"] = frame.loc[1190:1210, "payload_kg"] = np.nan
    frame.loc[10, ["x_meas", "y_meas", "z_meas"]] = np.nan
    assert_same(*both(frame if clock else frame.drop(columns="time_s"), tmp_path))


@pytest.mark.parametrize("clock", [True, False])
def test_a_display_goes_from_step_to_step_over_the_ends_of_parts(frame, tmp_path, clock):
    """It stands for longer than any part's neighbours."""
    row = np.arange(ROWS)
    frame["temp_c"] = 0.5 * np.round((21.0 + 2.0 * np.sin(row / 700.0) - row / 900.0) / 0.5)
    frame["time_s"] = np.cumsum(1.0 + 0.5 * np.sin(row / 50.0))
    shown, frame = frame["temp_c"].to_numpy(), frame if clock else frame.drop(columns="time_s")
    whole, parts = both(frame, tmp_path)
    assert np.abs(whole.table.temp_c - shown).max() > 0.2
    assert_same(whole, parts)


def test_a_display_that_changes_all_the_time_is_taken_as_shown(frame, tmp_path, monkeypatch):
    frame["temp_c"] = 20.0 + 0.1 * (np.arange(ROWS) // 5 % 4)
    path = log_of(frame, tmp_path)
    assert open_log(FILE, path, SIZE).display is not None
    monkeypatch.setattr(log_whole, "MOST_CHANGES", 500)
    assert open_log(FILE, path, SIZE).display is None


def test_readings_of_a_lost_beam_are_left_out_at_the_end_of_a_part_too(frame, tmp_path):
    frame.loc[590:610, ["x_meas", "y_meas", "z_meas"]] = np.array(frame.loc[589, ["x_meas", "y_meas", "z_meas"]])
    whole, parts = both(frame, tmp_path)
    assert not whole.used[590:611].any()
    assert_same(whole, parts)


GAP = slice(600, 850)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"temp_c": GAP}, "column temp_c: is empty in 251 rows, 251 of them one after another; a log is filled over"),
        ({"time_s": slice(0, 250)}, "column time_s: is empty in 251 rows"),
        ({"payload_kg": slice(5, 6)}, "column payload_kg: is empty in 2 rows and not the same in all others"),
        ({"tau1": slice(5, 6)}, "column tau1: is empty in 2 rows and not the same"),
    ],
)
def test_empty_cells_that_a_part_cannot_fill_are_refused_but_not_where_the_log_is_one_part(
    change, said, frame, tmp_path
):
    frame = frame.assign(payload_kg=np.arange(ROWS) % 2, tau1=1.0)
    for title, rows in change.items():
        frame[title] = frame[title].astype(float)
        frame.loc[rows, title] = np.nan
    path = log_of(frame, tmp_path)
    with pytest.raises(InputError, match=said):
        open_log(FILE, path, SIZE)
    assert open_log(FILE, path, ROWS).rows == ROWS


def test_a_log_whose_rows_all_come_again_is_refused(frame, tmp_path):
    twice = pd.concat([frame[:1000]] * 2, ignore_index=True)
    path = log_of(twice, tmp_path)
    with pytest.raises(InputError, match="all rows come again after 1000 rows, as copies; keep the first 1000 rows"):
        open_log(FILE, path, SIZE)
    twice.loc[1999, "x_meas"] += 1e-6
    assert open_log(FILE, log_of(twice, tmp_path), SIZE).rows == 2000
