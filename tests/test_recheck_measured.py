"""Recheck where base reflectors hold the frame: its errors are those that `ptt compare` and `ptt add` have."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from ptt.again.recheck import recheck
from ptt.again.result import Recheck
from ptt.challenge.truth import table_of
from ptt.effects import library
from ptt.fitting.solve import residual_of
from ptt.fleet.again import recheck_or_diagnose
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.machine import format_machine, parse_machine
from ptt.machine_schema import BasePoint, TrackerSpec
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.model.of_run import for_runs
from ptt.rig import parse_rig, simulate
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.axes import rms
from ptt.run.problem import Problem, build_problem

MACHINE = {"kind": "three-ptt", "base_radius_mm": 200, "platform_radius_mm": 100, "link_length_mm": 300,
           "slider_travel_mm": [150, 420], "screw_lead_mm": 5}  # fmt: skip
PLACES = np.array([[400.0, 0, -200], [-200, 350, -200], [-200, -350, -200], [300, 300, 50]])
SIGMA = 0.004
TURN = np.array([[np.cos(0.3), -np.sin(0.3), 0.0], [np.sin(0.3), np.cos(0.3), 0.0], [0.0, 0.0, 1.0]])


def run_of(seed: int, offset: tuple[float, float, float]) -> Problem:
    """A run with homing errors; base reflectors are read before and after by a tracker that stands anywhere."""
    drive = {"backlash_mm": (0.03, 0.02, 0.045), "homing_mm": offset}
    still = {"white_mm": SIGMA, "translation_mm": [0.0] * 3, "rotation_mrad": [0.0] * 3}
    rig = parse_rig({"machine": MACHINE, "seed": seed, "drive": drive, "tracker": still})
    poses = simulate(rig, make_volume(ideal_machine(rig.spec), 80, seed)).frame
    readings, random = ["x_meas", "y_meas", "z_meas"], np.random.default_rng(seed)
    base = poses.iloc[: len(PLACES)].copy()
    base["role"], base["name"] = "base", [f"base {number}" for number in range(len(PLACES))]
    base[[title for title in base if str(title).endswith("_cmd")]] = np.nan
    rounds = [base.assign(**dict(zip(readings, (PLACES + random.normal(0.0, SIGMA, PLACES.shape)).T, strict=True)))
              for _ in range(2)]  # fmt: skip
    whole = pd.concat([rounds[0], poses, rounds[1]], ignore_index=True)
    whole[readings] = whole[readings].to_numpy() @ TURN.T + [1000.0, -50.0, 30.0]
    points = tuple(BasePoint(name=f"base {i}", xyz_mm=tuple(at), sigma_mm=0.005) for i, at in enumerate(PLACES))
    file = replace(rig.machine, tracker=TrackerSpec(frame="measured", base_point=points, sigma_mm=SIGMA))
    return build_problem(replace(file, text=""), table_of(whole))


@pytest.fixture(scope="module")
def solved() -> Model:
    first = run_of(1, (0.3, 0.0, 0.0))
    ladder = climb(Model(first.file), first, [library()[name]() for name in ("backlash", "homing-offset")])
    return read_model(parse_machine(format_machine(record(ladder, "add", []))))


def look(solved: Model, problem: Problem) -> Recheck:
    return recheck(for_runs(solved, problem)[0], problem)


def as_compared(solved: Model, problem: Problem) -> float:
    return rms(residual_of(solved, problem).residual, problem.used)["total"]


def test_what_a_fitted_frame_would_take_is_an_error_where_reflectors_hold_it(solved: Model) -> None:
    later = run_of(2, (0.4, 0.0, 0.0))
    found = look(solved, later)
    assert found.verdict == "changed" and [item.moved.name for item in found.changed] == ["offset_mm 1"]
    assert found.error_um["now"] == pytest.approx(as_compared(solved, later), rel=0.01)
    assert found.error_um["now"] > 150.0 and found.error_um["left"] < found.error_um["expected"] < 15.0
    assert found.made_um["now"]["homing-offset"] > found.made_um["before"]["homing-offset"] + 150.0


def test_sliders_that_all_stand_higher_are_no_less_an_error(solved: Model) -> None:
    """A fitted frame would take all of it; the verdict says that something is otherwise, and the error how much."""
    later = run_of(2, (0.4, 0.1, 0.1))
    found = look(solved, later)
    assert found.verdict != "same"
    assert found.error_um["now"] == pytest.approx(as_compared(solved, later), rel=0.01)
    assert found.error_um["now"] > 90.0


def test_a_machine_that_is_the_same_errs_as_expected_in_the_frame_of_the_reflectors(solved: Model) -> None:
    later = run_of(3, (0.3, 0.0, 0.0))
    found = look(solved, later)
    assert found.verdict == "same"
    assert found.error_um["now"] == pytest.approx(as_compared(solved, later), rel=0.02)
    assert 0.6 < found.error_um["now"] / found.error_um["expected"] < 1.3


def test_a_store_holds_a_machine_without_values_against_its_drawing_in_that_frame_as_well() -> None:
    later = run_of(4, (0.1, 0.1, 0.1))
    found = recheck_or_diagnose(Model(later.file), later, library(), str)
    assert found.verdict == "new" and found.now_um == pytest.approx(as_compared(Model(later.file), later), rel=0.01)
    assert found.now_um > 90.0
