"""Lines in the spectrum of what is left: what a pose has to itself is no line, and a line is offered once."""

from dataclasses import replace

import numpy as np
import pytest

from ptt.challenge.challenge import bench
from ptt.challenge.hide import hide_faults
from ptt.challenge.truth import table_of
from ptt.diagnosis.find import find
from ptt.diagnosis.found import Found
from ptt.diagnosis.memory import WHITE, Memory
from ptt.diagnosis.periods import find_period
from ptt.effects import library
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import Problem, build_problem

MACHINE = bench()


@pytest.fixture(scope="module")
def turning() -> tuple[Found, Problem]:
    """A machine with an error at every turn of its screws, nothing of it explained."""
    drawn = hide_faults(draw_rig("none", 77, MACHINE, "volume", rows=150), ["once-per-rev"], 77)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    return find(Model(MACHINE), problem, library(), lambda what: None), problem


def test_a_line_is_found_where_it_is_and_offered_once(turning):
    found, problem = turning
    nothing = found.scorer.score((), WHITE)
    line = find_period(found.scorer, nothing, problem)
    assert line is not None
    turn = problem.file.machine.screw_lead_mm
    assert line.length == pytest.approx(turn if np.isscalar(turn) else turn[line.joint], rel=0.02)
    other = find_period(found.scorer, nothing, problem, [(line.joint, line.length)])
    assert other is None or other.joint != line.joint or abs(other.length / line.length - 1.0) > 1e-3


def test_what_each_pose_has_to_itself_is_worth_no_line(turning):
    """Where each pose may err by itself as much as all readings scatter, a line is worth a fraction of its squares."""
    found, problem = turning
    nothing = found.scorer.score((), WHITE)
    assert find_period(found.scorer, nothing, problem) is not None
    assert find_period(found.scorer, replace(nothing, memory=Memory(pose=1e3)), problem) is None
