"""Poses of a design: within reach, balanced, from either side, in a short order; and what rows add to a contest."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from conftest import BENCH
from hypothesis import given, settings
from hypothesis import strategies as st
from test_design import inside

from ptt.errors import WorkspaceError
from ptt.machine import MachineFile, parse_machine
from ptt.plan.contest import open_contest
from ptt.plan.space import build_space, can_drive, directions, draw_poses
from ptt.plan.visits import both_ways, in_driving_order, table_of
from ptt.run.viewing import build_view

# --- space and visits


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10**6), half=st.floats(20.0, 120.0))
def test_poses_lie_in_the_box_the_travel_and_away_from_singularities(seed: int, half: float) -> None:
    file = parse_machine(BENCH, "bench.toml")
    space = build_space(file, (half, half, half))
    q = draw_poses(space, 40, np.random.default_rng(seed))
    p = space.mechanism.forward(q)
    assert (p.abs() <= half + 1e-9).all()
    inside(file, p.numpy())
    assert can_drive(space, q).all()


def test_a_box_that_cannot_be_reached_is_refused(bench: MachineFile) -> None:
    high = bench.machine.model_copy(update={"slider_travel_mm": (500.0, 600.0)})  # home is at 283 mm
    with pytest.raises(WorkspaceError, match=r"box"):
        draw_poses(build_space(replace(bench, machine=high), (10.0, 10.0, 10.0)), 50, np.random.default_rng(0))


def test_slider_heights_meet_every_phase_of_the_screw(bench: MachineFile) -> None:
    q = draw_poses(build_space(bench), 200, np.random.default_rng(0)).numpy()
    phase = np.floor((q % 5.0) / 5.0 * 8).astype(int)
    counts = np.array([np.bincount(column, minlength=8) for column in phase.T])
    assert counts.min() >= 10  # 25 each if even


def test_directions_come_in_opposite_pairs() -> None:
    ways = directions(3)
    assert len({tuple(way) for way in ways}) == 8
    np.testing.assert_array_equal(ways[::2], -ways[1::2])
    assert len({tuple(way) for way in directions(6)}) == len(directions(6)) == 64


@pytest.mark.parametrize("joints", [6, 7, 9])
def test_any_two_joints_move_alike_in_half_of_the_directions(joints: int) -> None:
    ways = directions(joints)
    assert len(ways) == 64
    np.testing.assert_array_equal(ways.T @ ways, 64.0 * np.eye(joints))


def test_a_visit_arrives_from_either_side_of_every_joint(bench: MachineFile) -> None:
    space = build_space(bench)
    visits = both_ways(space, 12, np.random.default_rng(4), repeats=2)
    assert len(visits) == 12
    for visit in visits:
        table = table_of([visit], space, straight=False)
        direction = build_view(bench, table).direction.numpy()
        np.testing.assert_array_equal(direction[1], -direction[3])
        np.testing.assert_array_equal(direction[1], direction[5])
        np.testing.assert_array_equal(table.target[1], table.target[3])


def test_the_order_of_driving_is_short_and_complete(bench: MachineFile) -> None:
    space = build_space(bench)
    visits = both_ways(space, 20, np.random.default_rng(4))
    loaded = [replace(visit, payload=5.0 * (number % 2)) for number, visit in enumerate(visits)]
    ordered = in_driving_order(loaded, space)
    assert {id(visit) for visit in ordered} == {id(visit) for visit in loaded}
    assert [visit.payload for visit in ordered] == [0.0] * 10 + [5.0] * 10

    def way(items: list) -> float:
        places = space.mechanism.forward(torch.stack([visit.q[1] for visit in items]))
        return float(places.diff(dim=0).norm(dim=1).sum())

    assert way(ordered) < 0.8 * way(sorted(loaded, key=lambda visit: visit.payload))


# --- contests


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_gain_is_what_adding_the_rows_brings(seed: int) -> None:
    random = np.random.default_rng(seed)
    known, truth = random.normal(size=(30, 7)), np.zeros(7)
    truth[5:] = random.normal(size=2)
    contest = open_contest(known, np.arange(5), truth)
    left = known @ truth - known[:, :5] @ np.linalg.lstsq(known[:, :5], known @ truth, rcond=None)[0]
    np.testing.assert_allclose(contest.misfit, left @ left, rtol=1e-9)
    groups = random.normal(size=(4, 6, 7))
    gains = contest.gains(groups)
    for group, gain in zip(groups, gains, strict=True):
        np.testing.assert_allclose(contest.add(group).misfit - contest.misfit, gain, rtol=1e-7)
        assert gain >= 0.0


def test_columns_that_are_known_only_make_a_contest_easier() -> None:
    random = np.random.default_rng(0)
    truth = np.array([0.0, 0.0, 0.0, 1.0])
    contest = open_contest(random.normal(size=(20, 4)), np.arange(3), truth)
    assert contest.without(np.array([1])).misfit >= contest.misfit
