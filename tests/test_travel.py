"""The way to a row: turns on it, directions of arrival, views of straight moves."""

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from ptt.correct.compensate import compensate
from ptt.effects.reversal import Backlash
from ptt.machine import MachineFile, load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.run.direction import travel_direction
from ptt.run.table import make_table
from ptt.run.travel import OVERTRAVEL, arrival_direction, run_starts
from ptt.run.view import PER_ROW, View
from ptt.run.viewing import build_view


def test_a_joint_that_stands_through_a_run_does_not_arrive_as_the_next_run_moves():
    q = np.array([[0.0], [0.0], [5.0], [4.0]])
    starts = run_starts(np.array([0, 0, 1, 1]))
    assert arrival_direction(q, q, starts).ravel().tolist() == [1.0, 1.0, -1.0, -1.0]


def test_a_turn_on_the_way_decides():
    q = np.array([[0.0], [1.0], [2.0], [2.0]])
    turning_point = np.array([[0.0], [1.5], [2.0], [2.0]])
    assert arrival_direction(q, turning_point, run_starts(np.zeros(4))).ravel().tolist() == [1.0, -1.0, 1.0, 1.0]


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


def straight_bench() -> MachineFile:
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
    return replace(file, machine=file.machine.model_copy(update={"moves": "straight"}))


def test_a_slider_turns_on_a_straight_move_where_it_does_and_not_at_a_point_that_was_looked_at():
    file = straight_bench()
    mechanism = build_mechanism(file.machine)
    poses = np.random.default_rng(5).uniform(-55.0, 55.0, (300, 3))
    view = build_view(file, make_table(poses))
    share = torch.linspace(0.0, 1.0, 2001, dtype=torch.float64)[None, :, None]
    begin, end = (torch.as_tensor(ends)[:, None] for ends in (poses[:-1], poses[1:]))
    way = mechanism.inverse((begin + share * (end - begin)).reshape(-1, 3)).reshape(299, 2001, 3).numpy()
    step = np.sign(np.diff(way, axis=1))
    against = step != step[:, -1:]
    last = step.shape[1] - 1 - np.argmax(against[:, ::-1], axis=1)
    turn = np.where(against.any(axis=1), np.take_along_axis(way, last[:, None] + 1, axis=1)[:, 0], way[:, -1])
    assert against.any(axis=1).sum() > 50
    np.testing.assert_allclose(view.turning_point[1:], turn, rtol=0.0, atol=0.003)
    clear = np.abs(turn - way[:, -1]) > 1e-4
    np.testing.assert_array_equal(view.direction[1:].numpy()[clear], step[:, -1][clear])


def test_a_command_that_turns_back_by_less_than_the_gap_still_puts_the_tool_where_it_should_be():
    file = straight_bench()
    gap = torch.tensor([0.9, 0.6, 0.8], dtype=torch.float64)
    theta = torch.cat([gap, torch.ones(1)])
    model = Model(file, (Term(Backlash(), theta),))
    poses = np.random.default_rng(6).uniform(-55.0, 55.0, (400, 3))
    sent = compensate(model, make_table(poses))
    view = build_view(file, make_table(None, sent.q))
    back = (view.q - view.turning_point).abs()
    assert ((back > 1e-3) & (back < gap)).sum() >= 5
    reached = predict([(Backlash(), theta)], view).p.numpy()
    assert np.mean(np.abs(reached - poses).max(axis=1) < 1e-6) > 0.995


def test_a_first_row_is_entered_as_the_second_sets_off_though_the_joint_turns_on_the_way() -> None:
    q = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])
    turning_point = np.array([[0.0, 0.0], [-0.5, 1.0], [2.0, 0.0]])  # joint 1 goes down half a millimetre first
    direction = arrival_direction(q, turning_point, np.array([True, False, False]))
    np.testing.assert_array_equal(direction, [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])


def test_an_arm_keeps_its_posture_on_a_straight_move():
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machines" / "ur10.toml")
    far = replace(file, machine=file.machine.model_copy(update={"moves": "straight"}))
    posture = np.array([0.3, -2.1, 1.9, -1.4, -1.5, 2.4])  # far from the middle of the travel
    commands = posture + np.cumsum(np.random.default_rng(8).normal(0.0, 0.03, (40, 6)), axis=0)
    table = make_table(None, command=commands)
    straight, even = build_view(far, table), build_view(file, table)
    assert (straight.turning_point - straight.q).abs().max() < 0.06  # a move or two off its end, same posture
    clear = (np.abs(np.diff(commands, axis=0)) > 0.02)[:, :3]  # the last three joints hardly move the tool
    agree = (straight.direction == even.direction).numpy()[1:, :3][clear]
    assert agree.mean() > 0.95


def test_a_stated_direction_that_the_rows_show_changes_nothing() -> None:
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
    rng = np.random.default_rng(3)
    target = np.repeat(rng.uniform(-40.0, 40.0, (30, 3)), 3, axis=0)  # each pose is read three times
    table = make_table(target, run=np.repeat([0, 1], 45))
    shown = build_view(file, table)
    stated = build_view(file, table.replace(direction=shown.direction.numpy()))
    later = ~stated.starts
    assert torch.equal(stated.direction, shown.direction)
    assert torch.equal(stated.turning_point[later], shown.turning_point[later])


def test_a_joint_goes_past_a_pose_once_however_often_it_is_read() -> None:
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
    table = make_table(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 9.0], [0.0, 0.0, 9.0], [0.0, 0.0, 9.0]]))
    view = build_view(file, table.replace(direction=np.array([1.0, -1.0, -1.0, 1.0])[:, None].repeat(3, axis=1)))
    past = (view.turning_point - view.q)[1:, 0]
    assert past.tolist() == [OVERTRAVEL, 0.0, -OVERTRAVEL]  # up from above, stands, and from below at last
