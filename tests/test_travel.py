import re
from dataclasses import fields
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ptt.machine import load_machine
from ptt.run.backlash.reversal import travel_direction
from ptt.run.table import make_table
from ptt.run.travel import arrival_direction, run_starts
from ptt.run.view import PER_ROW, View
from ptt.run.viewing import build_view


def test_a_joint_that_stands_through_a_run_does_not_arrive_as_the_next_run_moves():
    q = np.array([[0.0], [0.0], [5.0], [4.0]])
    starts = run_starts(np.array([0, 0, 1, 1]))
    assert arrival_direction(q, q, starts).ravel().tolist() == [1.0, 1.0, -1.0, -1.0]


def test_a_turn_on_the_way_decides():
    q = np.array([[0.0], [1.0], [2.0], [2.0]])
    turning = np.array([[0.0], [1.5], [2.0], [2.0]])
    assert arrival_direction(q, turning, run_starts(np.zeros(4))).ravel().tolist() == [-1.0, -1.0, 1.0, 1.0]


@given(st.lists(st.integers(-2, 2), min_size=1, max_size=12), st.data())
def test_without_turns_the_order_of_the_commands_decides(heights, data):
    q = np.array(heights, dtype=float)[:, None]
    run = np.sort(data.draw(st.lists(st.integers(0, 2), min_size=len(q), max_size=len(q))))
    starts = run_starts(run)
    np.testing.assert_array_equal(arrival_direction(q, q, starts), travel_direction(q, starts))


def test_one_pose_at_a_told_feed_stands_still():
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
    for feed in (50.0, None):
        view = build_view(file, make_table([[0.0, 0.0, 5.0]], feed_mm_s=feed))
        assert view.velocity.tolist() == [[0.0, 0.0, 0.0]]


def test_every_field_of_a_view_that_has_an_entry_a_row_is_cut_with_the_rows():
    attributes = (View.__doc__ or "").partition("Attributes:")[2]
    told = re.findall(r"^ {8}(\w+): (.*?)(?=^ {8}\w|\Z)", attributes, re.S | re.M)
    assert {name for name, words in told} >= {field.name for field in fields(View) if field.init}
    assert {name for name, words in told if "(n," in words} == {*PER_ROW, "number"}
