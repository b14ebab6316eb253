"""Wind-up of drives that differ: each joint changes over along a travel of its own."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.effects.base import Effect
from ptt.effects.bench import sample_view
from ptt.fitting.layout import MOST_LENGTH_RATIO
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model
from ptt.rig.rig_file import parse_rig
from ptt.rig.simulate import simulate, write_run
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table

LENGTHS, HEIGHTS = (1.2, 3.0, 5.5), (0.02, 0.016, 0.024)
OLD = """
[[effect]]
name = "windup"
[effect.parameters]
height_mm = { value = [0.01, 0.02, 0.03] }
length_mm = { value = 2.5, std = 0.1 }
"""


def machine() -> MachineFile:
    file = bench_machine()
    return replace(file, tracker=file.tracker.model_copy(update={"frame": "trusted", "sigma_mm": None}))


@pytest.fixture
def measured(tmp_path) -> Problem:
    return strokes(tmp_path, HEIGHTS, LENGTHS)


def strokes(
    tmp_path: Path, heights: tuple[float, ...], lengths: tuple[float, ...], play: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> Problem:
    """Short strokes forth and back about places at random."""
    drive = {"windup_um": [1e3 * each for each in heights], "windup_length_mm": lengths, "backlash_mm": play}
    rig = parse_rig({"machine": tomllib.loads(format_machine(machine())), "drive": drive, "conditions": {}})
    random = np.random.default_rng(8)
    targets = np.cumsum(random.normal(size=(260, 3)) * random.choice([0.5, 2.0, 12.0], (260, 1)), axis=0)
    targets = 50.0 * np.sin(targets / 50.0)
    frame = pd.DataFrame(targets, columns=["x_cmd", "y_cmd", "z_cmd"])
    write_run(simulate(rig, frame, seed=3).frame, tmp_path / "run.csv")
    return build_problem(machine(), read_table(tmp_path / "run.csv"))


def test_no_play_is_told_beside_drives_that_wind_up_over_unlike_travel(measured):
    found = diagnose(Model(measured.file), measured)
    assert (found.verdict, found.suggested) == ("missing", (("windup",),)), found.words
    assert "mm of travel" in found.words and " to " in found.words.split("wind-up, over ")[1].split(" mm")[0]


def test_each_joint_has_its_own_length(measured):
    fitted = fit(Model(measured.file) + library()["windup"](), measured)
    (term,) = fitted.model.terms
    assert term.std is not None
    theta, std = term.theta.numpy(), term.std.numpy()
    assert (np.abs(theta - np.array([*HEIGHTS, *LENGTHS])) < 4.0 * std).all(), (theta, std)
    assert (std[3:] < 1.0).all()


@pytest.mark.parametrize("family", ["three-ptt", "serial"])
def test_the_slope_by_the_lengths_is_the_derivative(family):
    view, windup = sample_view(family), library()["windup"]()
    random = np.random.default_rng(2)
    linear, length = (
        torch.as_tensor(random.uniform(low, high, view.joints)) for low, high in ((0.01, 0.02), (0.2, 3.0))
    )
    own, plain = (kind.slope_by(windup, "length", linear, view, {"length": length}) for kind in (type(windup), Effect))
    assert float(plain.abs().max()) > 1e-3
    torch.testing.assert_close(own, plain, rtol=0.0, atol=1e-12)


def test_a_joint_that_does_not_wind_up_has_about_the_length_of_the_others_and_says_how_little_is_known(tmp_path):
    problem = strokes(tmp_path, (0.0, 0.016, 0.024), (3.0, 3.0, 3.0))
    fitted = fit(Model(problem.file) + library()["windup"](), problem)
    (term,) = fitted.model.terms
    assert term.std is not None and float(term.theta[0]) < 4.0 * float(term.std[0])
    assert 0.3 < float(term.theta[3]) < 10.0 and float(term.std[3]) > 5.0 * float(term.std[4:].max()), term.std


def test_no_length_is_so_far_from_the_others_that_it_is_play(tmp_path):
    """Beside two drives that wind up, a third that has play looks like one that winds up over no travel."""
    problem = strokes(tmp_path, (0.02, 0.016, 0.0), (3.0, 3.0, 3.0), play=(0.0, 0.0, 0.1))
    fitted = fit(Model(problem.file) + library()["windup"](), problem)
    lengths = fitted.model.terms[0].theta[3:]
    assert float(lengths.max() / lengths.min()) < MOST_LENGTH_RATIO**2 + 1e-9
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "missing" and {step[0] for step in found.suggested} == {"backlash", "windup"}, found.words


@pytest.mark.parametrize("heights", [[0.0] * 3, [-0.01, -0.02, 0.0]])
def test_the_cause_is_said_whatever_the_heights(heights):
    theta = torch.tensor([*heights, 1.0, 2.0, 3.0], dtype=torch.float64)
    assert library()["windup"]().cause(theta, sample_view("three-ptt")).startswith("wind-up, over 1 to ")


def test_a_travel_that_no_reading_tells_is_not_said():
    theta = torch.tensor([0.01, 0.02, 0.01, 1.0, 2.0, 3.0], dtype=torch.float64)
    some, none = torch.tensor([True, True, True, False, True, False]), torch.tensor([True] * 3 + [False] * 3)
    say = library()["windup"]().cause_measured
    assert say(theta, sample_view("three-ptt"), some) == "wind-up, over 2 mm of travel"
    assert say(theta, sample_view("three-ptt"), none) == "wind-up, over travel that this run does not tell"


def test_bounds_of_an_arm_are_as_far_from_the_usual_as_those_of_a_slider():
    length = next(each for each in library()["windup"].parameters if each.stem == "length")
    arm = length.on("serial")
    assert arm.lower / arm.usual == pytest.approx(length.lower / length.usual)
    assert arm.most / arm.usual == pytest.approx(length.most / length.usual)


def test_one_length_in_a_file_is_that_of_all_joints():
    model = read_model(parse_machine(format_machine(replace(machine(), effect=())) + OLD, "old.toml"))
    (term,) = model.terms
    assert term.theta.tolist() == [0.01, 0.02, 0.03, 2.5, 2.5, 2.5]
    again = read_model(parse_machine(format_machine(write_model(model)), "new.toml"))
    assert again.terms[0].theta.tolist() == term.theta.tolist()
