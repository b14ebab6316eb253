"""What a tangent cannot tell is asked where it is fitted: large values and the commoner effects in their place."""

from dataclasses import replace

from ptt.challenge.challenge import bench
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.rig.draw import draw_rig
from ptt.run.problem import build_problem


def test_a_zero_that_is_a_millimetre_off_is_no_joint_that_sits_aside() -> None:
    """A joint's centre takes a zero's place along the tangent at either: squares, which a fit has, tell them apart."""
    file = bench()
    drawn = draw_rig(41, file, "path")
    faults = {"homing_mm": (0.9, -0.2, 0.07), "windup_um": (0.0, 0.0, 4.0), "windup_length_mm": (2.07, 2.07, 2.07)}
    rig = replace(drawn.rig, drive=drawn.rig.drive.model_copy(update=faults))
    found = diagnose(Model(file), build_problem(file, table_of(simulate(rig, drawn.targets).frame)))
    assert {names[0] for names in found.suggested} == {"homing-offset", "windup"}
