"""What looks like something else: slips between runs, joints that settle, zeros and links that look like one offset."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from stated_bench import NOISE, run_of, stated

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.long import diagnose_long
from ptt.diagnosis.search.find import find
from ptt.diagnosis.telling import doubt
from ptt.diagnosis.telling.absent import Absent
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.floor import noise_floor
from ptt.effects import Curve, library
from ptt.fitting.solve import fit
from ptt.judge.ladder.climb import climb
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table


def zeros_and_links(seed: int) -> Problem:
    """A machine with zeros and two links off, none of which is an offset of a joint."""
    random = np.random.default_rng(seed)
    file, target = stated(), random.uniform(-60.0, 60.0, (150, 3))
    zeros, longer = random.normal(0.0, 0.1, 3), random.normal(0.0, 0.1, 3) * [1.0, 1.0, 0.0]
    robot = build_mechanism(file.machine)
    assert isinstance(robot, ThreePtt)
    joints = robot.inverse(torch.as_tensor(target))
    built = replace(robot, link=robot.link + torch.as_tensor(longer))
    reached = built.forward(joints + torch.as_tensor(zeros)).numpy()
    table = replace(make_table(target, joints.numpy()), measured=reached + random.normal(0.0, NOISE, target.shape))
    return build_problem(file, table)


@pytest.mark.parametrize("seed", [1, 6])
def test_zeros_and_link_lengths_are_not_told_as_offsets_of_joints(seed: int) -> None:
    """One effect stands for both, so it comes first."""
    problem = zeros_and_links(seed)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "missing"
    assert {names[0] for names in found.suggested} == {"homing-offset", "link-length"}


@pytest.mark.parametrize("seed", [1, 4])
def test_a_trusted_frame_that_is_off_is_told_as_that_beside_zeros(seed: int) -> None:
    """Not as zeros and towers alone, which shift and turn the readings as well, to most of it."""
    random = np.random.default_rng(seed)
    target, zeros = random.uniform(-60.0, 60.0, (120, 3)), random.normal(0.0, 0.08, 3)
    problem = run_of(stated("trusted"), target, np.tile(zeros, (120, 1)), seed)
    moved = problem.table.measured + random.normal(0.0, 0.05, 3) + np.cross(random.normal(0.0, 4e-4, 3), target)
    found = diagnose(Model(problem.file), build_problem(problem.file, replace(problem.table, measured=moved)))
    assert found.verdict == "missing"
    first = [step for step in found.suggested if step[0] == "tracker-frame"]
    assert first == [("tracker-frame",)]
    assert any("homing-offset" in step for step in found.suggested if step not in first)


@pytest.mark.parametrize("seed", [0, 3])
def test_a_wrong_unit_of_length_of_a_tracker_far_away_is_no_tower(seed: int) -> None:
    """In a trusted frame it shifts all readings far more than it stretches them."""
    random = np.random.default_rng(seed)
    target = random.uniform(-60.0, 60.0, (120, 3))
    problem = run_of(stated("trusted"), target, np.zeros((120, 3)), seed)
    moved = problem.table.measured + 2e-5 * (target - [1500.0, -800.0, 300.0])
    found = diagnose(Model(problem.file), build_problem(problem.file, replace(problem.table, measured=moved)))
    assert [step[0] for step in found.suggested] == ["tracker-scale"]


@pytest.mark.parametrize(
    ("size", "seed"),
    [
        (0.012, 5),
        pytest.param(0.012, 6, marks=pytest.mark.long),
        pytest.param(0.02, 0, marks=pytest.mark.long),
        pytest.param(0.02, 2, marks=pytest.mark.long),
    ],
)
def test_a_drift_is_not_told_as_a_wander_that_outlasts_the_run(size: float, seed: int) -> None:
    rows, random = 128, np.random.default_rng(seed)
    target, way, time = random.uniform(-60.0, 60.0, (rows, 3)), random.normal(size=3), np.linspace(0.0, 1.0, rows)
    problem = run_of(stated(), target, np.zeros((rows, 3)), seed, time_s=10.0 * np.arange(rows))
    settled = size * np.expm1(-time / 0.4)[:, None] / np.expm1(-1.0 / 0.4) * way
    table = replace(problem.table, measured=problem.table.measured + settled)
    assert diagnose(Model(problem.file), build_problem(problem.file, table)).suggested == (("tracker-drift",),)


def test_what_stands_for_two_is_one_step_where_no_more_may_be_added() -> None:
    problem = zeros_and_links(1)
    assert len(diagnose(Model(problem.file), problem, steps=1).suggested) == 1


@pytest.mark.parametrize(
    ("rows", "side", "size", "lasts", "seed"),
    [pytest.param(166, 60.0, 0.026, 750.0, 8, marks=pytest.mark.long), (96, 40.0, 0.036, 220.0, 11)],
)
def test_a_joint_that_settles_is_no_drift_of_the_tracker(
    rows: int, side: float, size: float, lasts: float, seed: int
) -> None:
    target = np.random.default_rng(seed).uniform(-side, side, (rows, 3))
    time = 8.0 * np.arange(rows)
    settles = (size * (1.0 - np.exp(-time / lasts)))[:, None] * np.eye(3)[1]
    problem = run_of(stated(), target, settles, seed, time_s=time)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "unknown"
    assert (found.depends_on[0].residual, found.depends_on[0].on) == ("slider 2", "time")


def test_what_is_likelier_than_nothing_is_said_of_an_error_beyond_the_noise() -> None:
    """A tool that stands aside by three times the noise where the frame is trusted, and a wander might do as well."""
    target = np.random.default_rng(2).uniform(-40.0, 40.0, (60, 3))
    problem = run_of(stated("trusted"), target, np.zeros((60, 3)), 2, time_s=8.0 * np.arange(60))
    table = replace(problem.table, measured=problem.table.measured + np.array([0.0, 2.9 * NOISE, 0.0]))
    assert diagnose(Model(problem.file), build_problem(problem.file, table)).verdict == "missing"


def test_what_the_tracker_may_have_done_is_a_doubt_and_what_the_machine_may_have_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As likely as not, and with screws that would be longer by a hundred usual sizes."""
    target = np.random.default_rng(2).uniform(-40.0, 40.0, (80, 3))
    file = stated()
    joints = build_mechanism(file.machine).inverse(torch.as_tensor(target)).numpy()
    problem = run_of(file, target, (joints - joints.mean(axis=0)) * 1.5e-3, 3)
    found = find(Model(file), problem, library(), lambda what: None)
    atoms, state = found.system.atoms, found.state
    assert state.keys == ("lead-scale",)
    longer = np.where(state.owner >= 0, 1.0, 0.0)
    monkeypatch.setattr(doubt, "absent_effects", lambda scorer, state: ())
    doubts = {"": doubt.tool_doubt(found.scorer, state)}
    for name in ("tracker-scale", "homing-offset"):
        key = next(key for key, atom in atoms.items() if atom.name == name)
        absent = Absent(key, 1.0, 1e4 * np.outer(longer, longer))
        monkeypatch.setattr(doubt, "absent_effects", lambda scorer, state, one=absent: (one,))
        doubts[name] = doubt.tool_doubt(found.scorer, state)
    assert doubts["homing-offset"] == doubts[""]
    size = 100.0 * float(next(p.usual for p in library()["lead-scale"]().parameters))
    moved = build_mechanism(file.machine).forward(torch.as_tensor(joints + (joints - joints.mean(axis=0)) * size))
    left = frame_off(moved.numpy() - target, target)
    assert doubts["tracker-scale"] == pytest.approx(np.sqrt(0.5 * np.square(left).sum(axis=1).mean()), rel=0.05)


def frame_off(error: np.ndarray, place: np.ndarray) -> np.ndarray:
    """What a small rigid motion leaves of errors, (n, 3) mm."""
    turns = np.cross(np.eye(3)[None], place[:, None]).transpose(0, 2, 1)
    columns = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2).reshape(-1, 6)
    return error - (columns @ np.linalg.lstsq(columns, error.ravel(), rcond=None)[0]).reshape(-1, 3)


class Hose(Curve):
    """A hose pulls at slider 3 where the tool stands far out in y."""

    name = "hose"
    mechanisms = ("three-ptt",)
    on, shape = "y", "smooth"
    between = (-60.0, 60.0)


@pytest.mark.parametrize(
    "how",
    [diagnose, pytest.param(partial(diagnose_long, size=100), marks=pytest.mark.long)],
    ids=["whole", "in chunks"],
)
def test_an_unknown_that_the_user_has_described_is_not_told_again(how: Callable[..., Diagnosis]) -> None:
    target = np.random.default_rng(4).uniform([-60.0, -60.0, -40.0], [60.0, 60.0, 40.0], (200, 3))
    pulled = 0.04 * np.sin(target[:, 1] / 18.0)[:, None] * np.eye(3)[2]
    problem = run_of(stated(), target, pulled, 9)
    before = how(Model(problem.file), problem)
    assert before.verdict == "unknown"
    assert (before.depends_on[0].residual, before.depends_on[0].on) == ("slider 3", "y")
    described = climb(Model(problem.file), problem, [Hose()]).model
    after = how(described, problem, {**library(), Hose.name: Hose})
    (term,) = after.model.terms
    assert term.fixed == described.terms[0].fixed
    torch.testing.assert_close(term.theta, described.terms[0].theta)
    told = [item.size.rms for item in after.depends_on if item.size is not None]
    assert max(told, default=0.0) < 0.2 * before.depends_on[0].size.rms


@pytest.mark.parametrize("share", [0.72, 1.2])
def test_a_drift_that_settles_as_slowly_as_the_run_is_long_is_told_as_one(share: float) -> None:
    """Between half of the run and a straight line it had been fitted as either."""
    rows, random = 200, np.random.default_rng(4)
    target, time = random.uniform(-50.0, 50.0, (rows, 3)), 10.0 * np.arange(rows)
    file = stated("trusted")
    problem = run_of(file, target, np.zeros((rows, 3)), 6, time_s=time)
    drift = 0.3 * np.expm1(-time / (share * time[-1])) / np.expm1(-1.0 / share)
    read = problem.table.measured + drift[:, None] * [0.6, -0.5, 0.6]
    drifting = build_problem(file, problem.table.replace(measured=read))
    (term,) = fit(Model(file) + library()["tracker-drift"](), drifting).model.terms
    assert float(term.theta[-2]) == pytest.approx(share * time[-1], rel=0.15)


def test_what_a_file_holds_is_diagnosed_though_no_diagnosis_would_name_it() -> None:
    """A fit of few readings may end at links that shorten under pull; what follows is not of that."""
    file = stated()
    file = replace(file, machine=file.machine.model_copy(update={"platform_mass_kg": 4.0}))
    target = np.random.default_rng(2).uniform(-60.0, 60.0, (120, 3))
    held = Term(library()["link-compliance"](), torch.full((3,), -2e-4, dtype=torch.float64))
    model = Model(file) + held
    problem = run_of(file, target, np.zeros((120, 3)), 2)
    shift = predict([(held.effect, held.theta)], problem.view).reading - predict([], problem.view).reading
    problem = build_problem(file, replace(problem.table, measured=problem.measured + shift.numpy()))
    found = diagnose(model, problem)
    assert found.verdict == "nothing-missing" and sum(found.verdict_probability.values()) == pytest.approx(1.0)
    assert diagnose(Model(file), problem).suggested != (("link-compliance",),)


def test_of_few_rows_that_state_no_noise_a_comparison_says_what_a_diagnosis_says() -> None:
    """Everything at once has more values there than the readings have coordinates."""
    rows, file = 40, bench()
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": None, "frame": "fitted"}))
    target = np.random.default_rng(3).uniform(-50.0, 50.0, (rows, 3))
    problem = run_of(file, target, np.tile([0.0, 0.08, -0.05], (rows, 1)), 4)
    floor, found = noise_floor(Model(file), problem, library()), diagnose(Model(file), problem)
    assert floor.total == pytest.approx(found.noise.total, rel=0.05)
    assert floor.total == pytest.approx(np.sqrt(3.0) * NOISE, rel=0.25)
