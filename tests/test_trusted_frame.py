"""A wrong unit of length or a shift in a frame that the machine file trusts is the tracker's."""

from dataclasses import replace

import numpy as np
import pytest

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.remeasure import remeasure
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import build_problem
from ptt.run.table import make_table

MACHINE = bench_machine()


def test_a_wrong_unit_of_length_in_a_trusted_frame_is_the_tracker_s():
    """It stretches about where the tracker stands and so shifts as well; towers moved for it make a tool worse."""
    trusted = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "trusted"}))
    drawn = draw_rig(42, trusted, "volume", rows=80)
    tracker = {"scale_ppm": -70.0, "translation_mm": (0.0, 0.0, 0.0), "rotation_mrad": (0.0, 0.0, 0.0)}
    drawn = replace(drawn, rig=replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update=tracker)))
    problem = build_problem(trusted, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(trusted), problem)
    assert found.verdict == "missing" and found.suggested == (("tracker-scale",),)
    scale, *shift = [parameter.value for parameter in found.candidates[0].parameters]
    station = np.array(drawn.rig.tracker.station_mm)
    np.testing.assert_allclose(-np.array(shift) / scale, station, atol=0.25 * np.linalg.norm(station))


@pytest.mark.parametrize("scale", [5e-5, -2e-4])
def test_a_unit_that_stretches_about_the_origin_is_the_tracker_s_too(scale):
    """Software that scales readings in the frame of the base; a lead shared by all sliders looks much the same."""
    trusted = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "trusted", "base_point": ()}))
    random = np.random.default_rng(5)
    target = random.uniform(-60.0, 60.0, (300, 3))
    measured = target * (1.0 + scale) + random.normal(0.0, 0.003, target.shape)
    found = diagnose(Model(trusted), build_problem(trusted, make_table(target, measured=measured)))
    assert found.verdict == "missing" and len(found.suggested) == 1
    assert found.suggested[0][0] == "tracker-scale" and set(found.suggested[0][1:]) <= {"lead-scale"}


def test_readings_that_are_shifted_without_a_wrong_unit_are_not_surely_one():
    """A unit that is right has no place about which it could stretch so far that all is shifted by this much."""
    trusted = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "trusted"}))
    drawn = draw_rig(42, trusted, "volume", rows=80)
    tracker = {"translation_mm": (0.08, -0.05, 0.03), "rotation_mrad": (0.0, 0.0, 0.0)}
    drawn = replace(drawn, rig=replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update=tracker)))
    problem = build_problem(trusted, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(trusted), problem)
    assert found.verdict == "missing" and "tracker-frame" in found.suggested[0]


def test_against_a_frame_that_the_file_trusts_stands_all_that_looks_like_it_in_the_machine():
    """On a circle towers and zeros do what towers and a shifted tracker do: sent without the zeros, they do harm."""
    drawn, _ = draw(plan("unknown", 1, 1000009, kinds="all")[0])
    assert drawn.rig.machine.tracker.frame == "trusted"
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(drawn.rig.machine), problem)
    assert "tracker-frame" in {name for step in found.suggested for name in step[1:]}
    tool = remeasure(found.model, drawn).to_dict()
    assert tool["after"]["total"] < 0.1 * tool["before"]["total"]
