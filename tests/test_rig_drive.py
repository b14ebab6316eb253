"""Drives of the rig: play, friction, screws, controller, motion between rows."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_rig_bench import BENCH, bench, table, truth, volume

from ptt.challenge.challenge import bench as bench_machine
from ptt.rig import parse_rig, simulate
from ptt.rig.drive import friction, play, windup
from ptt.rig.motion import run_path, slider_speed, travel_direction
from ptt.rig.nominal import ideal_machine, nominal_sliders
from ptt.rig.targets import make_loop

COMMAND = ["b1_cmd", "b2_cmd", "b3_cmd"]


def column(*values: float) -> np.ndarray:
    return np.array(values, dtype=float)[:, None]


def test_play_by_hand() -> None:
    path = column(0.0, 1.0, 2.0, 1.95, 1.5, 1.6, 1.7, 1.8)
    want = column(0.0, 0.9, 1.9, 1.9, 1.6, 1.6, 1.6, 1.7)
    np.testing.assert_allclose(play(path, np.array([0.2])), want, atol=1e-12)


def test_play_without_gap_is_the_path() -> None:
    path = volume(50)
    assert np.array_equal(play(path, np.zeros(3)), path)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-10, 10), min_size=2, max_size=40), st.floats(0.0, 3.0), st.integers(2, 5))
def test_play_laws(points: list[float], gap: float, parts: int) -> None:
    """Never further off than half the gap; visiting points in between on the way changes nothing."""
    path = column(*points)
    out = play(path, np.array([gap]))
    assert np.abs(out - path).max() <= gap / 2 + 1e-12
    fine = np.interp(np.linspace(0, len(path) - 1, (len(path) - 1) * parts + 1), np.arange(len(path)), path[:, 0])
    np.testing.assert_allclose(play(fine[:, None], np.array([gap]))[::parts], out, atol=1e-12)


def test_play_of_a_gap_that_changes() -> None:
    path = column(0.0, 5.0, 5.0, 4.0)
    gap = column(0.0, 0.0, 0.4, 0.4)
    np.testing.assert_allclose(play(path, gap), column(0.0, 5.0, 5.0, 4.2), atol=1e-12)


def test_windup_changes_over_exponentially() -> None:
    path = column(0.0, 100.0, 99.0, 97.0, 97.0)
    want = [0.0, -0.5, 0.5 - np.exp(-1 / 2), 0.5 - np.exp(-3 / 2), 0.5 - np.exp(-3 / 2)]
    np.testing.assert_allclose(windup(path, np.array([0.5]), np.array([2.0]))[:, 0], want, atol=1e-12)


def test_windup_does_not_depend_on_the_sampling() -> None:
    coarse = column(0.0, 3.0, 1.0, 2.5)
    fine = np.interp(np.linspace(0, 3, 301), np.arange(4), coarse[:, 0])[:, None]
    one, many = (windup(path, np.array([0.4]), np.array([1.5])) for path in (coarse, fine))
    np.testing.assert_allclose(many[::100], one, atol=1e-12)


def test_friction_saturates_and_dissipates() -> None:
    swing = 5.0 * np.sin(np.linspace(0.0, 6.0 * np.pi, 601))[:, None]
    lag = friction(swing, np.array([0.3]), np.array([1.0]))
    assert np.abs(lag).max() == pytest.approx(0.3)
    up, down = swing[200:400], -lag[200:400]
    # A loop of Coulomb friction alone would enclose 4 x 0.3 x 5; gradual slip rounds its corners.
    assert float(np.sum(0.5 * (down[1:] + down[:-1]) * np.diff(up, axis=0))) > 4.0


def test_friction_begins_stiffly() -> None:
    lag = friction(column(0.0, 0.1, 10.0, 9.9), np.array([0.3]), np.array([1.0]))[:, 0]
    assert -lag[1] == pytest.approx(0.3 * 0.1 * np.mean([4.0, 2.0, 4 / 3, 1.0]))
    assert lag[2] == pytest.approx(-0.3)
    assert lag[3] > lag[2]


def test_backlash_takes_half_the_gap_against_travel() -> None:
    heights = np.array([250.0, 260.0, 270.0, 260.0, 250.0, 260.0])
    sent = pd.DataFrame(np.repeat(heights[:, None], 3, axis=1), columns=COMMAND)
    result = simulate(bench(drive={"backlash_mm": [0.04, 0.06, 0.02]}), sent, noise=False)
    direction = np.array([1, 1, 1, -1, -1, 1])[:, None]
    want = heights[:, None] - 0.5 * direction * np.array([0.04, 0.06, 0.02])
    np.testing.assert_allclose(result.slider_actual, want, atol=1e-12)


def test_first_row_arrives_as_the_second_moves() -> None:
    for step in (1.0, -1.0):
        sent = pd.DataFrame(280.0 + np.outer([0.0, 0.0, step], np.ones(3)), columns=COMMAND)
        got = simulate(bench(drive={"backlash_mm": 0.1}), sent, noise=False).slider_actual
        np.testing.assert_allclose(got[0], 280.0 - 0.05 * step, atol=1e-12)


def test_compensation_of_the_whole_gap_removes_it() -> None:
    poses = volume(80)
    clean = truth(bench(), poses)
    gap = [0.05, 0.03, 0.08]
    mended = bench(drive={"backlash_mm": gap}, controller={"backlash_mm": gap})
    np.testing.assert_allclose(truth(mended, poses), clean, atol=1e-9)
    assert np.abs(truth(bench(drive={"backlash_mm": gap}), poses) - clean).max() > 0.03


def test_straight_moves_reverse_on_the_way() -> None:
    """From y = -50 to y = 50 slider 1 ends where it began: alone it stands still, under a straight tool it swings."""
    poses = np.array([[0.0, -50.0, -10.0], [0.0, -50.0, 0.0], [0.0, 50.0, 0.0]])
    alone, straight = (
        simulate(bench({"moves": moves}, drive={"backlash_mm": 0.1}), table(poses), noise=False).slider_actual
        for moves in ("sliders", "straight")
    )
    assert alone[2, 0] == pytest.approx(alone[1, 0], abs=1e-12)
    assert straight[2, 0] - alone[2, 0] == pytest.approx(0.1, abs=1e-9)  # it arrives from above now
    np.testing.assert_allclose(straight[:2], alone[:2], atol=1e-9)


def test_once_per_turn_and_curve() -> None:
    heights = np.linspace(200.0, 210.0, 41)
    sent = pd.DataFrame(np.repeat(heights[:, None], 3, axis=1), columns=COMMAND)
    drive = {
        "turn_um": [5.0, 0.0, 0.0],
        "turn_phase_rad": [0.4, 0.0, 0.0],
        "turn2_um": [0.0, 2.0, 0.0],
        "curve_parabola_um": [0.0, 0.0, 9.0],
        "curve_span_mm": [200.0, 210.0],
    }
    error = simulate(bench(drive=drive), sent, noise=False).slider_actual - heights[:, None]
    np.testing.assert_allclose(error[:, 0], 0.005 * np.cos(2 * np.pi * heights / 5.0 - 0.4), atol=1e-9)
    np.testing.assert_allclose(error[:, 1], 0.002 * np.cos(4 * np.pi * heights / 5.0), atol=1e-9)
    part = (heights - 205.0) / 5.0
    np.testing.assert_allclose(error[:, 2], 0.009 * (1.5 * part**2 - 0.5), atol=1e-9)


def test_screw_map_is_followed() -> None:
    knots = [150.0, 200.0, 250.0, 300.0, 420.0]
    drive = {"map_height_mm": knots, "map_um": [[1.0, -4.0, 6.0, 2.0, 0.0], [0.0] * 5, [0.0] * 5]}
    sent = pd.DataFrame([[200.0] * 3, [250.0] * 3], columns=COMMAND)
    error = simulate(bench(drive=drive), sent, noise=False).slider_actual - sent.to_numpy()
    np.testing.assert_allclose(error, [[-0.004, 0.0, 0.0], [0.006, 0.0, 0.0]], atol=1e-9)


def test_screw_map_stays_as_at_its_ends_beyond_them() -> None:
    drive = {"map_height_mm": [200.0, 210.0, 220.0, 230.0], "map_um": [[1.0, 5.0, -5.0, 2.0], [0.0] * 4, [0.0] * 4]}
    sent = pd.DataFrame([[190.0] * 3, [330.0] * 3], columns=COMMAND)
    error = simulate(bench(drive=drive), sent, noise=False).slider_actual - sent.to_numpy()
    np.testing.assert_allclose(error, [[0.001, 0.0, 0.0], [0.002, 0.0, 0.0]], atol=1e-9)


def test_lag_follows_speed_and_is_gone_at_standstill() -> None:
    poses, lag = make_loop(180), [0.02, 0.01, 0.03]
    slow, fast = (
        simulate(
            bench(drive={"following_s": lag}, conditions={"moving": True, "feed_mm_s": feed}), table(poses), noise=False
        )
        for feed in (10.0, 30.0)
    )
    command = slow.frame[COMMAND].to_numpy()
    inner = slice(2, -2)
    np.testing.assert_allclose(
        (fast.slider_actual - command)[inner], 3.0 * (slow.slider_actual - command)[inner], atol=2e-5
    )
    time = slow.frame["time_s"].to_numpy()
    centred = (command[2:] - command[:-2]) / (time[2:] - time[:-2])[:, None]
    np.testing.assert_allclose((slow.slider_actual - command)[1:-1], -centred * lag, atol=3e-4)
    assert np.abs(slow.slider_actual - command).max() > 0.1
    still = simulate(bench(drive={"following_s": lag}), table(poses), noise=False)
    np.testing.assert_allclose(still.slider_actual, command, atol=1e-12)


def test_speed_at_a_sharp_turn_is_that_of_the_arrival() -> None:
    time = np.arange(7.0)
    there = np.array([0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0])
    command, tool = np.repeat(there[:, None], 3, 1), np.outer(there, [1.0, 0.0, 0.0])
    speed = slider_speed(command, tool, time, np.zeros(7, dtype=bool))
    np.testing.assert_allclose(speed[:, 0], [1, 1, 1, 1, -1, -1, -1], atol=1e-12)


def test_every_run_is_led_in_and_out_by_itself() -> None:
    """The jump back to where the next run begins is part of neither."""
    time, run = np.arange(8.0), np.repeat([0, 1], 4)
    command = np.repeat(np.array([0.0, 2.0, 4.0, 6.0] * 2)[:, None], 3, 1)
    tool = np.outer(command[:, 0], [1.0, 0.0, 0.0])
    still = np.zeros(8, dtype=bool)
    np.testing.assert_allclose(slider_speed(command, tool, time, still, run), 2.0, atol=1e-12)
    assert np.abs(slider_speed(command, tool, time, still) - 2.0).max() > 1.0


def test_a_lap_is_led_in_where_another_ended() -> None:
    """The pose in which laps meet is told twice, at once: at each feed its speed is that of its own lap."""
    there = np.array([0.0, 1.0, 2.0, 3.0])
    command, rate = np.repeat(np.append(there, 3.0 + there)[:, None], 3, 1), np.repeat([1.0, 4.0], 4)
    tool = np.outer(command[:, 0], [1.0, 0.0, 0.0])
    time = np.cumsum(np.maximum(np.diff(command[:, 0], prepend=0.0) / rate, 1e-3))
    speed = slider_speed(command, tool, time, np.zeros(8, dtype=bool))
    np.testing.assert_allclose(speed, np.tile(rate[:, None], 3), atol=1e-9)


def test_standstill_keeps_the_direction() -> None:
    path = column(0.0, 0.0, 1.0, 1.0, 0.5, 0.5)
    np.testing.assert_array_equal(travel_direction(path)[:, 0], [0, 0, 1, 1, -1, -1])


def test_each_run_is_homed_anew() -> None:
    rig = bench(drive={"homing_scatter_mm": 0.1}, conditions={"cycles": 3, "run_per_cycle": True})
    result = simulate(rig, table(volume(5)), noise=False)
    shift = (result.slider_actual - result.frame[COMMAND].to_numpy()).reshape(3, 5, 3)
    np.testing.assert_allclose(shift, np.repeat(shift[:, :1], 5, axis=1), atol=1e-12)
    assert len(np.unique(shift[:, 0].round(9), axis=0)) == 3


def test_one_number_stands_for_all_legs() -> None:
    assert parse_rig({"machine": BENCH, "drive": {"homing_mm": 0.2}}).drive.homing_mm == (0.2, 0.2, 0.2)


def test_a_straight_path_passes_every_turn_of_its_sliders() -> None:
    drawing = ideal_machine(bench_machine().machine)
    tool = np.random.default_rng(0).uniform(-60.0, 60.0, (100, 3))
    command = nominal_sliders(drawing, tool)
    path = run_path(drawing, tool, command, np.zeros(100, dtype=int), straight=True, lead_in=1.0)
    turned = 0
    for row in range(1, 100):
        between = tool[row - 1] + np.linspace(0.0, 1.0, 5001)[:, None] * (tool[row] - tool[row - 1])
        height = nominal_sliders(drawing, between)
        seen = np.vstack([command[row - 1], path.slider[path.row == row]])
        np.testing.assert_allclose(seen.max(axis=0), height.max(axis=0), atol=1e-5)
        np.testing.assert_allclose(seen.min(axis=0), height.min(axis=0), atol=1e-5)
        ends = np.sort(command[[row - 1, row]], axis=0)
        turned += int(((height.max(axis=0) > ends[1] + 0.01) | (height.min(axis=0) < ends[0] - 0.01)).sum())
    assert turned > 10
