"""A thermometer that shows steps: warmth goes on between them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ptt
from ptt.run.display import between_steps
from ptt.run.table import Table, make_table

ROWS = 240
CLOCK = 30.0 * np.arange(ROWS) + 5.0 * np.sin(np.arange(ROWS))
WARMTH = 18.3 + 4.0 * (1.0 - np.exp(-CLOCK / 3000.0))


def shown(warmth: np.ndarray, step: float) -> np.ndarray:
    return step * np.round(warmth / step)


def a_table(warmth: np.ndarray, run: np.ndarray | None = None) -> Table:
    poses = np.random.default_rng(1).uniform(-40.0, 40.0, (len(warmth), 3))
    table = make_table(poses, measured=poses, time_s=CLOCK[: len(warmth)], temp_c=warmth)
    return table if run is None else table.replace(run=run, run_label=tuple("ab"[: run.max() + 1]))


@pytest.mark.parametrize("step", [0.1, 0.5, 1.0, 5.0 / 9.0])
def test_warmth_goes_on_between_the_steps_of_a_display(step):
    read = shown(WARMTH, step)
    table, lines = between_steps(a_table(read))
    assert np.abs(table.temp_c - read).max() <= 0.5 * step + 1e-12
    assert np.std(table.temp_c - WARMTH) < 0.5 * np.std(read - WARMTH)
    assert len(lines) == 1 and f"steps of {step:.3g} K" in lines[0]


def test_a_day_that_warms_and_cools_is_followed_and_never_by_more_than_half_a_step():
    day = 21.0 + 2.0 * np.sin(CLOCK / 1200.0)
    read = shown(day, 0.5)
    table, _ = between_steps(a_table(read))
    assert np.abs(table.temp_c - read).max() <= 0.25 + 1e-12
    assert np.std(table.temp_c - day) < 0.7 * np.std(read - day)


def test_what_is_no_display_is_left_as_it_is():
    scattered = np.round(WARMTH + np.random.default_rng(2).normal(0.0, 0.05, ROWS), 2)
    chamber = np.repeat([20.0, 25.0, 30.0, 35.0], 60)
    for warmth in (np.round(WARMTH, 4), scattered, chamber, np.repeat([20.0, 20.5], 120), np.full(ROWS, 21.0)):
        table, lines = between_steps(a_table(warmth))
        np.testing.assert_array_equal(table.temp_c, warmth)
        assert lines == []


def test_nothing_goes_on_from_one_run_to_the_next_and_blanks_stay():
    run = np.repeat([0, 1], 120)
    warmth = np.r_[shown(WARMTH[:120], 0.5), np.full(120, 25.0)]
    warmth[7] = np.nan
    table, _ = between_steps(a_table(warmth, run))
    assert (table.temp_c[120:] == 25.0).all() and np.isnan(table.temp_c[7])
    known = np.isfinite(warmth[:120])
    assert np.std((table.temp_c[:120] - WARMTH[:120])[known]) < 0.5 * np.std((warmth[:120] - WARMTH[:120])[known])


def test_a_run_is_read_so_and_targets_are_taken_at_their_word():
    folder = Path(__file__).resolve().parents[1] / "data" / "sealed_three"
    model = ptt.load(folder / "machine.toml")
    rows = pd.read_csv(folder / "run.csv")
    warmth = rows["temp_c"].to_numpy()
    rows["temp_c"] = shown(warmth, 0.5)
    read = ptt.read(rows, model).table.temp_c
    assert np.std(read - warmth) < 0.6 * np.std(rows["temp_c"] - warmth)
    wanted = rows.drop(columns=["x_meas", "y_meas", "z_meas"])
    np.testing.assert_array_equal(ptt.read_targets(wanted, model).table.temp_c, rows["temp_c"])
