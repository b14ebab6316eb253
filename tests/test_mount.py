"""A tool that moves in its holder: no slip of a joint and no link, which commands would then correct on a sound arm."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from serial_arms import MACHINES
from test_report_chinese import SAY, latin

from ptt.dependence.dependence import Dependence
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.next_look import next_look
from ptt.diagnosis.telling.verdict_words import depends
from ptt.door.diagnosing import format_diagnosis
from ptt.effects.prefilled import UnreadableError, prefilled
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.serial import Serial
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

ROWS, MOVED = 160, 90  # readings, and the first one after the tool moved


def moved(name: str, aside: tuple[float, float, float], slip: float) -> Problem:
    """An arm whose tool moves along directions of the last link, mm, and whose last joint slips, rad, at one moment."""
    file, random = load_machine(MACHINES / f"{name}.toml"), np.random.default_rng(7)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.03, "frame": "fitted"}))
    robot, late = build_mechanism(file.machine), np.arange(ROWS) >= MOVED
    assert isinstance(robot, Serial)
    loose = replace(robot, tool_mm=tuple(np.add(robot.tool_mm, aside)))
    sent = random.uniform(-1.2, 1.2, (ROWS, robot.joints))
    turned = torch.as_tensor(sent + late[:, None] * np.eye(robot.joints)[-1] * slip)
    reached = np.where(late[:, None], loose.forward(turned).numpy(), robot.forward(turned).numpy())
    return build_problem(file, make_table(None, sent, reached + random.normal(0.0, 0.03, (ROWS, 3))))


@pytest.mark.parametrize("name", ["kuka_iiwa", pytest.param("assembly_robot", marks=pytest.mark.long)])
def test_a_tool_that_moved_in_its_holder_is_told_with_the_moment(name: str) -> None:
    problem = moved(name, (0.3, -0.2, 0.25), 0.0)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("unknown", ())
    first = found.depends_on[0]
    assert (first.on, first.shape, first.acts_on) == ("time", "step", "mount") and first.share > 0.9
    assert first.place is not None and first.place[0] < MOVED <= first.place[1] + 1.0
    assert "as if the tool moved in its holder" in found.words
    assert "ptt effects new" not in format_diagnosis(found)
    with pytest.raises(UnreadableError, match="no effect moves the tool in its holder"):
        prefilled("own-cause", found.to_dict()["depends_on"])


def test_a_last_joint_that_slips_is_no_tool_that_moved() -> None:
    problem = moved("assembly_robot", (0.0, 0.0, 0.0), 4e-3)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("missing", (("homing-slip",),))


def test_what_is_said_of_a_holder() -> None:
    held = Dependence("x", "time", 0.9, 0.0, None, "smooth", np.zeros((0, 3)), acts_on="mount")
    said = [depends(held), *next_look([held], untold=False)]
    assert said[1] == "Look for the cause in the tool's holder."
    assert [latin(SAY(line)) for line in said] == [[]] * len(said)
