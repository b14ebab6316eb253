"""A tracker's drift that nothing at rest has seen may be the machine's."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from told_models import term

from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.witness import DRIFT_OPEN, GROWTH_OPEN, WARMTH_OPEN, own_drift, unwitnessed
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.machine_schema import BasePoint, ThreePttSpec, TrackerSpec
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.rig.draw import draw_rig
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

DRIFT = np.array([0.15, -0.09, 0.06])  # mm
PLACES = [(400.0, 0.0, -200.0), (-300.0, 300.0, -200.0), (-300.0, -300.0, 250.0), (0.0, 300.0, 300.0)]


def drifting(tracker: TrackerSpec) -> Diagnosis:
    drawn = draw_rig(31, bench_machine(), "volume", rows=100)
    file = replace(drawn.rig.machine, tracker=tracker)
    moved = {"drift_um": tuple(1e3 * DRIFT), "drift_constant_s": 400.0}
    rig = replace(drawn.rig, machine=file, tracker=drawn.rig.tracker.model_copy(update=moved))
    return diagnose(Model(file), build_problem(file, table_of(simulate(rig, drawn.targets).frame, drawn.absent)))


@pytest.mark.parametrize("watched", [False, True])
def test_a_drift_is_the_trackers_alone_where_base_reflectors_were_read_along_the_run(watched: bool) -> None:
    points = tuple(BasePoint(name=f"base {i}", xyz_mm=place, sigma_mm=0.002) for i, place in enumerate(PLACES))
    found = drifting(TrackerSpec(frame="measured", base_point=points) if watched else TrackerSpec(frame="fitted"))
    (drift,) = [one for one in found.candidates if one.effect == "tracker-drift"]
    assert found.suggested == (("tracker-drift",),)
    assert (DRIFT_OPEN in drift.words) is not watched
    # A settling drift lies within a half of its way about its middle, and is the machine's in one of two.
    far = 1e3 * np.linalg.norm(DRIFT)
    assert (drift.tool_doubt > 0.1 * far) is not watched and drift.tool_doubt < 0.36 * far


@pytest.mark.parametrize(
    "um_per_k",
    [
        pytest.param(-40.0, marks=pytest.mark.long),
        -17.0,
        pytest.param(9.0, marks=pytest.mark.long),
        pytest.param(17.0, marks=pytest.mark.long),
        40.0,
    ],
)
def test_a_tripod_that_rises_with_the_room_is_no_frame_of_unheard_of_metal(um_per_k: float) -> None:
    """Told is a machine that could be, and that a tracker looks the same; or that no known effect describes it."""
    drawn = draw_rig(31, bench_machine(), "warmup", rows=120)
    table = table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent)
    rise = 1e-3 * um_per_k * (table.temp_c - 20.0)[:, None] * [0.0, 0.0, 1.0]
    file = drawn.rig.machine
    found = diagnose(Model(file), build_problem(file, replace(table, measured=table.measured + rise)))
    if found.verdict == "unknown" and um_per_k != 17.0:  # as much as steel would do
        assert found.depends_on[0].residual == "z" and found.depends_on[0].on in ("temperature", "time")
        return
    (step,) = (one for one in found.candidates if (one.effect,) == found.model.keys)
    assert found.verdict == "missing" and step.effect in ("frame-growth", "screw-growth", "tracker-drift")
    assert (DRIFT_OPEN if step.effect == "tracker-drift" else GROWTH_OPEN) in step.words
    assert step.effect == "tracker-drift" or step.tool_doubt > 10.0
    for each in step.parameters[:2] if step.effect == "frame-growth" else ():
        assert -3.0 * each.std < each.value < 4.8e-5 + 3.0 * each.std


@pytest.mark.parametrize("per_k", [pytest.param((1e-4, 7e-5), marks=pytest.mark.long), (7e-5, 1.2e-4)])
def test_a_frame_that_grows_more_than_any_metal_is_named_where_its_form_shows(per_k: tuple[float, float]) -> None:
    """The sensor may hang where it sees a tenth of the warmth that the frame has."""
    random, file, rows = np.random.default_rng(3), bench_machine(), 120
    robot, spec, target = build_mechanism(file.machine), file.machine, random.uniform(-90.0, 90.0, (rows, 3))
    assert isinstance(robot, ThreePtt) and isinstance(spec, ThreePttSpec)
    joints, warmth = robot.inverse(torch.as_tensor(target)), 6.0 * (1.0 - np.exp(-np.linspace(0.0, 3.0, rows)))
    azimuth = np.radians(spec.slider_azimuth_deg)
    outward = spec.base_radius_mm * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(3)])
    reached = []
    for (radius, link), q in zip(warmth[:, None] * per_k, joints, strict=True):
        foot = robot.foot + torch.as_tensor(radius * outward)
        reached.append(replace(robot, foot=foot, link=robot.link * (1.0 + link)).forward(q))
    measured = torch.stack(reached).numpy() + random.normal(0.0, 0.003, (rows, 3))
    table = make_table(target, joints.numpy(), temp_c=20.0 + warmth, time_s=30.0 * np.arange(rows))
    found = diagnose(Model(file), build_problem(file, replace(table, measured=measured)))
    assert found.suggested == (("frame-growth",),)
    told = {one.name: one.value for one in found.candidates[0].parameters}
    np.testing.assert_allclose([told["radius_per_k"], told["link_per_k"]], per_k, rtol=0.1)


def warming(evenly: bool) -> tuple[Problem, Noise, np.ndarray]:
    """Poses at random in a room that warms up with the clock, or swings; with their times, s."""
    random, rows = np.random.default_rng(4), 80
    time = 30.0 * np.arange(rows)
    warmth = 20.0 + (time / 300.0 if evenly else 4.0 * np.sin(time / 200.0))
    place = random.uniform(-50.0, 50.0, (rows, 3))
    table = make_table(place, measured=place, temp_c=warmth, time_s=time)
    return build_problem(bench_machine(), table), Noise(np.eye(3) * 0.004**2, "machine file"), time


@pytest.mark.parametrize("ramp", [True, False])
def test_what_a_growth_shifts_alike_may_be_a_drift_where_temperature_went_with_the_clock(ramp: bool) -> None:
    problem, noise, _ = warming(ramp)
    growth = term("screw-growth", [8e-6, 12e-6, 16e-6, 0.002, -0.001, -0.003, *[0.0] * 5])
    said = unwitnessed(growth, problem, noise)
    assert [line.endswith("temperature went with the clock.") for line in said] == ([True] if ramp else [])
    assert (own_drift([growth], problem, noise) > 0.002) is ramp


def watched(visits: tuple[tuple[int, ...], ...], *, clock: bool) -> Problem:
    """Runs of 60 poses with readings of the base reflectors before some of them."""
    draws, rows = np.random.default_rng(0), list[tuple[int, str, tuple[float, ...]]]()
    for run, before in enumerate(visits):
        for number, pose in enumerate(draws.uniform(-60.0, 60.0, (60, 3)).tolist()):
            rows += [(run, f"base {i}", place) for i, place in enumerate(PLACES) if number in before]
            rows.append((run, "", tuple(pose)))
    run, name = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    place, at_base = np.array([row[2] for row in rows]), name != ""
    table = make_table(
        np.where(at_base[:, None], np.nan, place), measured=place + draws.normal(0.0, 0.003, place.shape), name=name,
        role=np.where(at_base, "base", "pose"), run=run, time_s=10.0 * np.arange(len(rows)) if clock else None,
    ).replace(run_label=tuple("ab"[: len(visits)]))  # fmt: skip
    points = tuple(BasePoint(name=f"base {i}", xyz_mm=place, sigma_mm=0.002) for i, place in enumerate(PLACES))
    return build_problem(replace(bench_machine(), tracker=TrackerSpec(frame="measured", base_point=points)), table)


@pytest.mark.parametrize("clock", [True, False])
@pytest.mark.parametrize(
    ("visits", "open_"), [(((0, 59),), False), (((0,),), True), (((0,), (0,)), True), (((0, 59), (0,)), False)]
)
def test_a_knock_is_the_trackers_alone_where_its_set_up_saw_base_reflectors_on_both_sides(
    visits: tuple[tuple[int, ...], ...], open_: bool, clock: bool
) -> None:
    problem, noise = watched(visits, clock=clock), Noise(np.eye(3) * 0.003**2, "machine file")
    knock = term("setup-jump", [0.05, 0.0, 0.0, 0.0, 0.0, 0.0, float(problem.view.clock[30])])
    said = unwitnessed(knock, problem, noise)
    assert [line.endswith("a base, a platform or a reflector that moved would look the same.") for line in said] == (
        [True] if open_ else []
    )


@pytest.mark.parametrize("along", [True, False])
def test_a_drift_along_which_temperature_went_may_be_a_stand_that_follows_it(along: bool) -> None:
    problem, noise, time = warming(along)
    drift = term("tracker-drift", [0.05, -0.02, 0.01, 100.0 * float(time[-1]), float(time[-1])])
    assert unwitnessed(drift, problem, noise) == [DRIFT_OPEN, *([WARMTH_OPEN] if along else [])]
    steady = build_problem(bench_machine(), problem.table.replace(temp_c=None))
    assert unwitnessed(drift, steady, noise) == [DRIFT_OPEN]
