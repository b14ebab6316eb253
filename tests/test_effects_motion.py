"""Effects of the way that led to a row: play, slips, wind-up, following and screws, worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from small_files import BARE
from test_effects_physics import POSES, heights, tensor
from torch.testing import assert_close

from ptt.effects import library
from ptt.effects.bench import sample_view
from ptt.effects.memory import entry_after, gradual_reversal, play
from ptt.machine import parse_machine
from ptt.model.chain import differentiate
from ptt.run.table import make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


def test_play_on_a_hand_sequence(bench):
    command = [280.0, 281.0, 280.96, 280.88, 281.0, 281.0, 281.02]
    view = build_view(bench, make_table(None, heights(*command)))
    expected = [-0.05, -0.05, -0.01, 0.05, -0.05, -0.05, -0.05]  # arrives as the second moves; 0.04 back, then 0.12
    assert_close(
        library()["backlash"]().shift(tensor([0.1, 0.1, 0.1, 1.0]), view)[:, 1], tensor(expected), atol=1e-12, rtol=0.0
    )


def test_play_begins_anew_with_each_run(bench):
    view = build_view(bench, make_table(None, heights(280, 281, 290, 289, 288), run=np.array([0, 0, 1, 1, 1])))
    expected = [-0.05, -0.05, 0.05, 0.05, 0.05]
    assert_close(
        library()["backlash"]().shift(tensor([0.1, 0.1, 0.1, 1.0]), view)[:, 0], tensor(expected), atol=1e-12, rtol=0.0
    )


@settings(deadline=None, max_examples=40)
@given(st.lists(st.floats(-0.2, 0.2), min_size=2, max_size=40), st.floats(0.0, 0.3), st.floats(0.05, 3.0), st.data())
def test_state_handed_on_gives_the_whole_run(steps, gap, length, data):
    view = build_view(parse_machine(BARE), make_table(None, heights(*(280.0 + np.cumsum(steps)))))
    cut = data.draw(st.integers(1, len(steps) - 1))
    late = view.of_rows(torch.arange(cut, len(steps)))
    late = replace(late, entries=(entry_after(view.of_rows(torch.arange(cut))),))
    gaps, lengths = tensor([gap] * 3), tensor([length] * 3)
    assert_close(play(late, gaps), play(view, gaps)[cut:], atol=1e-10, rtol=0.0)
    assert_close(gradual_reversal(late, lengths), gradual_reversal(view, lengths)[cut:], atol=1e-10, rtol=0.0)


def test_a_gap_below_zero_throws_the_slider_ahead_at_once(bench):
    view = build_view(bench, make_table(None, heights(280.0, 281.0, 280.96, 280.88, 281.0, 281.0)))
    shift = library()["backlash"]().shift(tensor([-0.1, 0.1, 0.0, 1.0]), view)
    assert_close(shift[:, 0], tensor([0.05, 0.05, -0.05, -0.05, 0.05, 0.05]), atol=1e-12, rtol=0.0)
    assert_close(shift[:3, 1], tensor([-0.05, -0.05, -0.01]), atol=1e-12, rtol=0.0)
    assert shift[:, 2].abs().max() == 0.0
    _, slope = differentiate(library()["backlash"](), tensor([0.0, 0.0, 0.0, 1.0]), view)
    assert_close(slope[:, 0, 0], -0.5 * view.direction[:, 0])  # the same from both sides


def test_slip_begins_after_its_moment(bench):
    view = build_view(bench, make_table(POSES, time_s=[0.0, 100.0, 200.0, 400.0]))
    shift = library()["homing-slip"]().shift(tensor([0.1, 0.0, -0.05, 100.0]), view)
    assert_close(shift, tensor(np.array([0, 0, 1, 1])[:, None] * np.array([0.1, 0.0, -0.05])))
    blind = build_view(bench, make_table(POSES))
    shift = library()["homing-slip"]().shift(tensor([0.1, 0.0, -0.05, 2.0]), blind)
    assert_close(shift[:, 0], tensor([0.0, 0.0, 0.0, 0.1]))


def test_slip_and_knock_try_the_same_moments():
    view = sample_view("three-ptt")
    slip, knock = library()["homing-slip"](), library()["setup-jump"]()
    moments = [float(trial["after"]) for trial in slip.search(view)]
    assert moments == [float(trial["after"]) for trial in knock.search(view)]
    inner = [float(trial["after"]) for trial in slip.refine(view, slip.search(view)[20])]
    assert inner == sorted(set(view.time[(view.time >= moments[18]) & (view.time <= moments[22])].tolist()))


def test_a_straight_drift_stays_straight():
    view, effect = sample_view("three-ptt"), library()["tracker-drift"]()
    straight = effect.search(view)[0]
    assert [float(trial["settling"]) for trial in effect.refine(view, straight)] == [float(straight["settling"])]


def test_windup_turns_over_with_travel(bench):
    view = build_view(bench, make_table(None, heights(240, 320, 317, 316, 319)))
    at_317 = -1.0 + 2.0 * np.exp(-3.0 / 2.0)
    at_316 = -1.0 + (1.0 + at_317) * np.exp(-1.0 / 2.0)
    at_319 = 1.0 - (1.0 - at_316) * np.exp(-3.0 / 2.0)
    friction = np.array([1.0, 1.0, at_317, at_316, at_319])
    shift = library()["windup"]().shift(tensor([0.01, 0.01, 0.01, 9.0, 9.0, 2.0]), view)
    assert_close(shift[:, 2], tensor(-0.01 * friction), atol=1e-12, rtol=0.0)


def test_windup_is_tried_over_lengths_that_rows_near_a_reversal_show(bench):
    near = build_view(bench, make_table(None, heights(300, 302, 302.1, 301.9, 301, 299, 298.9, 299.1)))
    far = build_view(bench, make_table(None, heights(240, 320, 250, 310, 260)))
    short, long = ([float(trial["length"][0]) for trial in library()["windup"]().search(view)] for view in (near, far))
    assert short[0] == pytest.approx(2.0) and min(short) < 0.1
    assert min(long) > 5.0 and long[0] == min(long) and max(long) == max(short)  # next to the usual


def test_following_error_is_velocity_times_lag(bench):
    table = make_table(None, heights(280, 290, 300, 290, 280), feed_mm_s=20.0)
    shift = library()["following-error"]().shift(tensor([0.03, 0.0, 0.01, 0.0]), build_view(bench, table))
    expected = np.array([-0.6, -0.6, -0.6, 0.6, 0.6])  # 20 mm/s up, still so where it turns, 20 mm/s down
    assert_close(shift, tensor(np.stack([expected, 0.0 * expected, expected / 3.0], axis=1)), atol=1e-9, rtol=0.0)


def test_a_corner_after_a_move_as_short_as_the_lag_is_rounded_off(bench):
    table = make_table(None, heights(280, 280.5, 281, 280.5, 280), feed_mm_s=20.0)
    shift = library()["following-error"]().shift(tensor([0.03, 0.0, 0.0, 0.0]), build_view(bench, table))
    assert_close(shift[:, 0], tensor([-0.6, -0.6, 0.0, 0.6, 0.6]), atol=1e-9, rtol=0.0)


def test_a_feed_is_that_of_its_row_however_short_the_move(bench):
    table = make_table(None, heights(280, 281, 282, 283), feed_mm_s=[20.0, 20.0, 10.0, 30.0])
    shift = library()["following-error"]().shift(tensor([0.01, 0.0, 0.0, 0.0]), build_view(bench, table))
    assert_close(shift[:, 0], tensor([-0.2, -0.2, -0.1, -0.3]), atol=1e-9, rtol=0.0)


def test_a_clock_tells_no_corner_where_a_way_goes_on_faster(bench):
    table = make_table(None, heights(280, 290, 305, 327.5), time_s=[0.0, 1.0, 2.0, 3.0])
    shift = library()["following-error"]().shift(tensor([0.01, 0.0, 0.0, 0.0]), build_view(bench, table))
    assert_close(shift[:, 0], tensor([-0.1, -0.125, -0.1875, -0.225]), atol=1e-9, rtol=0.0)


@pytest.mark.parametrize(
    ("pace", "expected"),
    [(0, [10.0, 10.0, 20.0, -20.0]), (1, [10.0, 50.0 / 3.0, 20.0 / 3.0, -20.0]), (2, [10.0, 10.0, 20.0, -20.0])],
)
def test_a_row_may_mean_the_speed_of_the_move_there_or_of_both_sides(bench, pace, expected):
    table = make_table(None, heights(280, 290, 300, 280), feed_mm_s=[10.0, 10.0, 20.0, 20.0])
    shift = library()["following-error"]().shift(tensor([0.01, 0.0, 0.0, pace]), build_view(bench, table))
    assert_close(shift[:, 0], -0.01 * tensor(expected), atol=1e-9, rtol=0.0)


def test_a_row_read_at_standstill_does_not_know_that_it_will_move(bench):
    table = make_table(None, heights(280, 290, 290, 300, 310), time_s=[0.0, 1.0, 4.0, 5.0, 6.0])
    shift = library()["following-error"]().shift(tensor([0.01, 0.0, 0.0, 0.0]), build_view(bench, table))
    assert_close(shift[:, 0], tensor([-0.1, -0.1, 0.0, -0.1, -0.1]), atol=1e-9, rtol=0.0)


@pytest.mark.parametrize(
    ("label", "period"), [("", 5.0), ("harmonic 2", 2.5), ("harmonic 0", 5.0), ("second screw", 5.0)]
)
def test_once_per_rev_and_its_harmonics(bench, label, period):
    view = build_view(bench, make_table(None, heights(280.0, 281.3, 283.9, 287.77)))
    effect = library()["once-per-rev"](label)
    assert effect.search(view)[0]["period"].tolist() == [period]
    theta = [0.01, 0.02, 0.0, 0.003, 0.0, -0.001, *effect.search(view)[0]["period"].tolist()]
    phase = 2.0 * np.pi * view.q.numpy() / period
    expected = np.array([0.01, 0.02, 0.0]) * np.cos(phase) + np.array([0.003, 0.0, -0.001]) * np.sin(phase)
    assert_close(effect.shift(tensor(theta), view), tensor(expected))


def test_once_per_rev_says_when_all_heights_are_whole_leads(bench):
    effect = library()["once-per-rev"]()
    assert "commensurate" in effect.needs(build_view(bench, make_table(None, heights(*range(260, 310, 5)))))
    assert effect.needs(build_view(bench, make_table(None, heights(*np.arange(260, 310, 3.7))))) is None
