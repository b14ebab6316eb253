"""What a tangent cannot tell is asked where it is fitted: large values and the commoner effects in their place."""

from pathlib import Path

from ptt.challenge.challenge import new_challenge
from ptt.diagnosis.diagnose import diagnose
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.reading import read_table


def test_a_zero_that_is_a_millimetre_off_is_no_joint_that_sits_aside(tmp_path: Path) -> None:
    """A joint's centre takes a zero's place along the tangent at either: squares, which a fit has, tell them apart."""
    new_challenge(tmp_path / "made", "multi", seed=41)
    file = load_machine(tmp_path / "made" / "machine.toml")
    found = diagnose(Model(file), build_problem(file, read_table(tmp_path / "made" / "run.csv")))
    assert {names[0] for names in found.suggested} == {"homing-offset", "windup"}
