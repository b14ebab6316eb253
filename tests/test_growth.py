"""A machine that is longer in all its parts, as one that is warm, reads exactly as a tracker's wrong scale does."""

from dataclasses import replace

import numpy as np
import pytest

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import SCALE_BAR, Diagnosis
from ptt.effects import library
from ptt.fitting.kept import keep
from ptt.fitting.solve import fit
from ptt.fitting.tool_sigma import tool_sigma
from ptt.model.model import Model
from ptt.run.frames import align
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

NOISE, GROWN = 0.002, 1.2e-4  # mm; 10 K of steel


def grown() -> Problem:
    """A run of random poses, seen by a tracker that stands elsewhere; the tool is where the readings say."""
    file, random = bench(), np.random.default_rng(3)
    target = random.uniform(-1.0, 1.0, (120, 3)) * [70.0, 70.0, 45.0]
    measured = (1.0 + GROWN) * target + random.normal(0.0, NOISE, target.shape)
    tracker = file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": NOISE})
    return build_problem(replace(file, tracker=tracker), make_table(target, measured=measured))


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    problem = grown()
    return diagnose(Model(problem.file), problem)


def test_that_it_may_be_the_machine_is_in_the_probability_and_in_the_doubt(found: Diagnosis) -> None:
    scale = found.candidates[0]
    assert [names[0] for names in found.suggested] == ["tracker-scale"] and len(scale.sum_of) > 1
    assert scale.probability <= 0.5
    target = grown().table.target
    turn, shift = align(target, (1.0 + GROWN) * target)
    off = 1e3 * np.sqrt(np.square(((1.0 + GROWN) * target - shift) @ turn - target).sum(axis=1).mean())
    assert scale.tool_doubt is not None and scale.tool_doubt > 0.95 * np.sqrt(0.5) * off
    assert off < 1.5 * np.hypot(scale.heldout_after, scale.tool_doubt)


def test_a_scale_bar_is_asked_for(found: Diagnosis) -> None:
    assert found.measure_next[-1] == found.to_dict()["measure_next"][-1] == SCALE_BAR


def test_a_shift_that_the_frame_takes_leaves_no_command_uncertain() -> None:
    """Scale about which place, no reading tells in a fitted frame: the tool is none the less where it is."""
    problem = grown()
    fitted = fit(Model(problem.file) + library()["tracker-scale"](), problem)
    assert "tracker-scale shift_mm 1" in keep(fitted).names
    sigma = tool_sigma(replace(keep(fitted), unnamed=None), [], problem.view, problem.file)
    assert sigma.max() < NOISE
