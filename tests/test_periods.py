"""Lines in the spectrum of what is left: what a pose has to itself is no line, and a line is offered once."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from ptt.challenge.challenge import bench
from ptt.challenge.hide import hide_faults
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.noise.memory import WHITE, Memory
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.search.periods import FEWEST_PERIODS, TURNS_PER_ROW, find_period
from ptt.diagnosis.search.spectrum import FREQUENCY_STEP, JointWave
from ptt.effects import library
from ptt.model.model import Model
from ptt.rig import format_rig, parse_rig
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import Problem, build_problem

MACHINE = bench()


@pytest.fixture(scope="module")
def turning() -> tuple[Found, Problem]:
    """A machine with an error at every turn of its screws, nothing of it explained."""
    drawn = hide_faults(draw_rig(77, MACHINE, "volume", rows=150), ["once-per-rev"], 77)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    return find(Model(MACHINE), problem, library(), lambda what: None), problem


def test_a_line_is_found_where_it_is_and_offered_once(turning):
    found, problem = turning
    nothing = found.scorer.score((), WHITE)
    found_line = find_period(found.scorer, nothing, problem)
    assert found_line is not None
    line = found_line.period
    turn = problem.file.machine.screw_lead_mm
    joint, length = line
    assert length == pytest.approx(turn if np.isscalar(turn) else turn[joint], rel=0.02)
    other = find_period(found.scorer, nothing, problem, [line])
    assert other is None or other.period[0] != joint or abs(other.period[1] / length - 1.0) > 1e-3


def test_what_each_pose_has_to_itself_is_worth_no_line(turning):
    """Where each pose may err by itself as much as all readings scatter, a line is worth a fraction of its squares."""
    found, problem = turning
    nothing = found.scorer.score((), WHITE)
    assert find_period(found.scorer, nothing, problem) is not None
    assert find_period(found.scorer, replace(nothing, memory=Memory(pose=1e3)), problem) is None


@pytest.mark.parametrize(
    ("period", "rows", "turns"),
    [
        (1.7, 90, 45.0),
        pytest.param(0.3, 300, 300.0, marks=pytest.mark.long),
        pytest.param(2.3, 90, 33.0, marks=pytest.mark.long),
    ],
)
def test_a_wave_finer_than_the_readings_are_many_is_found_among_poses_at_random(
    period: float, rows: int, turns: float
) -> None:
    """Two readings a wave are what even steps need; poses at random tell finer ones too, as of an encoder's scale."""
    drawn = draw_rig(5, MACHINE, "volume", rows=rows)
    odd = {"kind": "periodic", "leg": 3, "size_um": 20.0, "period_mm": period, "phase_rad": 0.4}
    keys = "".join(f"{key} = {json.dumps(value)}\n" for key, value in odd.items())
    rig = replace(parse_rig(f"{format_rig(drawn.rig)}\n[[odd]]\n{keys}"), machine=drawn.rig.machine)
    file = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"sigma_mm": None}))
    problem = build_problem(file, table_of(simulate(rig, drawn.targets).frame, drawn.absent))
    assert np.ptp(problem.view.q.numpy()[:, 2]) / period > turns
    found = diagnose(Model(file), problem)
    first = found.depends_on[0]
    assert found.verdict == "unknown" and not found.suggested and first.residual == "slider 3"
    assert first.period_mm == pytest.approx(period, rel=0.01)


@pytest.mark.parametrize("seed", [4, pytest.param(3, marks=pytest.mark.long)])
def test_a_wave_is_found_where_few_poses_are_read_often(seed: int) -> None:
    """A free function of the place bends to any wave on sixty poses; its frequency is that of all readings together."""
    drawn = draw_rig(seed, MACHINE, "volume", rows=60)
    odd = {"kind": "periodic", "leg": 2, "size_um": 20.0, "period_mm": 3.1, "phase_rad": 1.0}
    keys = "".join(f"{key} = {json.dumps(value)}\n" for key, value in odd.items())
    rig = replace(parse_rig(f"{format_rig(drawn.rig)}\n[[odd]]\n{keys}"), machine=drawn.rig.machine)
    targets = pd.concat([drawn.targets] * 6, ignore_index=True)
    found = diagnose(Model(MACHINE), build_problem(MACHINE, table_of(simulate(rig, targets).frame, drawn.absent)))
    first = found.depends_on[0]
    assert first.residual == "slider 2" and first.period_mm == pytest.approx(3.1, rel=0.002)


def test_of_waves_that_even_steps_make_alike_the_slowest_is_said() -> None:
    """A column of 101 even heights: 20 turns look like 80 and 120, and 50 have a cosine and no sine."""
    height, random = np.linspace(0.0, 150.0, 101), np.random.default_rng(1)
    for turns in (12.0, 20.0, 37.0):
        slope = np.cos(2.0 * np.pi * turns * height / 150.0) + random.normal(0.0, 0.1, 101)
        found = np.arange(FEWEST_PERIODS, TURNS_PER_ROW * 101, FREQUENCY_STEP)
        gain = JointWave(2, height, slope, np.ones(101)).over(FEWEST_PERIODS, FREQUENCY_STEP, len(found))
        assert found[np.argmax(gain > gain.max() - 0.5)] == pytest.approx(turns, abs=0.3)
