"""The variable that tells an effect: travel since reversal begins anew with each run, labels say what a run has."""

from dataclasses import replace

import pytest
import torch

from ptt.effects.bench import sample_machine, sample_table, sample_view
from ptt.run.problem import Problem, build_problem
from ptt.run.view import View
from ptt.show.telling import telling_of, travel_since_reversal


def walked(view: View, joint: int) -> list[float]:
    """The same row by row."""
    q, way = view.q[:, joint].tolist(), view.direction[:, joint].tolist()
    gone, found = 0.0, []
    for row, start in enumerate(view.starts.tolist()):
        if start:
            gone = 0.0
            found.append(float("nan"))
            continue
        gone = abs(q[row] - q[row - 1]) + (gone if way[row] == way[row - 1] else 0.0)
        found.append(gone)
    return found


@pytest.mark.parametrize("kind", ["three-ptt", "serial"])
def test_no_run_carries_travel_into_the_next(kind: str):
    view = sample_view(kind)
    for joint in range(view.joints):
        expected = torch.tensor(walked(view, joint), dtype=torch.float64)
        torch.testing.assert_close(travel_since_reversal(view, joint), expected, equal_nan=True)


def test_a_turn_between_two_rows_counts():
    view = sample_view("three-ptt")
    turning_point = view.q.clone()
    turning_point[5, 0] = view.q[5, 0] - 0.25 * view.direction[5, 0]
    seen = travel_since_reversal(replace(view, turning_point=turning_point), 0)
    assert float(seen[5]) == pytest.approx(0.25)


def problem(kind: str) -> Problem:
    table = sample_table(kind)
    place = sample_view(kind).p.numpy()
    return build_problem(sample_machine(kind), table.replace(measured=place))


def test_rows_without_a_clock_are_not_seconds():
    own = problem("three-ptt")
    assert telling_of("time", own.view, 0)[1] == "time [s]"
    silent = replace(own.view, varies=own.view.varies - {"time"})
    values, label = telling_of("time", silent, 0)
    assert label == "reading number" and values.tolist() == list(range(own.view.rows))


def test_an_arm_has_joints_and_gears_instead_of_screws():
    arm = problem("serial")
    assert telling_of("phase", arm.view, 1)[1] == "angle of joint 2 within one gear period [rad]"
    assert telling_of("load", arm.view, 1)[1] == "torque on joint 2 [N mm]"
