"""Several things that happened at once in one run, each at its own moment: sliders that slip, a tracker knocked."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.candidates import first_of
from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.turn import moments_of, unlike
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import library
from ptt.fitting.solve import fit
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table

ROWS = 300
KNOCK, OTHER = (0.03, -0.06, -0.1), (-0.05, 0.02, 0.04)

NEXT = ("", "[second]", "[third]")

Events = Mapping[int, tuple[int, float] | Sequence[float]]


@pytest.mark.parametrize(
    ("events", "turning", "named"),
    [
        pytest.param(
            {93: (2, 0.033), 182: KNOCK}, 0.004, ("homing-slip", "setup-jump", "once-per-rev"), marks=pytest.mark.long
        ),
        pytest.param(
            {90: (0, 0.03), 186: (2, 0.05)}, 0.0, ("homing-slip", "homing-slip[second]"), marks=pytest.mark.long
        ),
        pytest.param(
            {90: (0, 0.05), 186: (0, -0.02)}, 0.0, ("homing-slip", "homing-slip[second]"), marks=pytest.mark.long
        ),
        pytest.param(
            {60: (1, 0.05), 150: (0, 0.03), 210: (2, -0.03)},
            0.0,
            tuple(f"homing-slip{n}" for n in NEXT),
            marks=pytest.mark.long,
        ),
        ({60: KNOCK, 150: (0, 0.04), 210: OTHER}, 0.0, ("setup-jump", "homing-slip", "setup-jump[second]")),
        ({120: KNOCK, 123: (0, 0.06)}, 0.0, ("setup-jump", "homing-slip")),
        pytest.param({120: (1, 0.06), 124: KNOCK}, 0.0, ("setup-jump", "homing-slip"), marks=pytest.mark.long),
    ],
)
def test_of_several_events_each_is_named_at_its_own_row(events: Events, turning: float, named: tuple[str, ...]) -> None:
    """An event dated by a larger one passes for unknown physics."""
    found = told_of(events, turning)
    assert found.verdict == "missing" and {names[0] for names in found.suggested} == set(named)
    told = sorted(float(moment["after"]) / 10.0 + 1.0 for moment in moments_of(found.model))
    np.testing.assert_allclose(told, sorted(events), atol=1.0)


@pytest.mark.parametrize(
    ("events", "named", "residual"),
    [
        ({90: (0, 0.05), 186: (0, -0.05)}, (), "slider 1"),
        pytest.param({60: (1, 0.05), 150: (1, 0.02), 210: (1, -0.07)}, (), "slider 2", marks=pytest.mark.long),
        pytest.param({90: KNOCK, 186: [-along for along in KNOCK]}, (), "z", marks=pytest.mark.long),
        pytest.param({60: (1, 0.05), 150: OTHER, 210: (1, -0.05)}, ("setup-jump",), "slider 2", marks=pytest.mark.long),
    ],
)
def test_what_came_and_went_is_one_thing_that_nobody_knows(events: Events, named: tuple[str, ...], residual: str):
    """That one knock takes back just what another did is no accident: it may come again, and no command is for that."""
    found = told_of(events)
    assert (found.verdict, {names[0] for names in found.suggested}) == ("unknown", set(named))
    assert (found.depends_on[0].residual, found.depends_on[0].on) == (residual, "time")


def told_of(events: Events, turning: float = 0.0, began: float = 0.0) -> Diagnosis:
    """What is said of a helix, moved by plain formulas, along which things happen at some rows."""
    file, random, way = bench(), np.random.default_rng(1), np.linspace(0.0, 1.0, ROWS)
    robot = build_mechanism(file.machine)
    target = np.stack([60.0 * np.cos(8.0 * np.pi * way), 60.0 * np.sin(8.0 * np.pi * way), 80.0 * way - 40.0], axis=1)
    joints = robot.inverse(torch.as_tensor(target)).numpy()
    error = turning * np.cos(2.0 * np.pi * joints / 5.0 + np.arange(3.0))
    knocked = random.normal(0.0, 0.003, (ROWS, 3))
    for row, event in events.items():
        if len(event) == 2:
            error[row:, event[0]] += event[1]
        else:
            knocked[row:] += event
    measured = robot.forward(torch.as_tensor(joints + error)).numpy() + knocked
    table = make_table(target, joints, measured=measured, time_s=began + 10.0 * np.arange(ROWS))
    return diagnose(Model(file), build_problem(file, table))


def test_what_goes_the_further_ones_move_up():
    there = {"homing-slip", "homing-slip[third]", "setup-jump[third]"}
    assert first_of("homing-slip[third]", there) == "homing-slip[second]"
    assert first_of("setup-jump[third]", there) == "setup-jump"
    assert first_of("homing-slip", there) == "homing-slip"


def test_every_moment_is_there_once_for_all_that_is_sudden():
    slip = library()["homing-slip"]()
    model = Model(bench()) + Term(slip, torch.tensor([0.1, 0.0, 0.0, 50.0], dtype=torch.float64))
    shapes = [{"after": torch.tensor([moment])} for moment in (70.0, 50.0, 20.0, 70.0)]
    moments = unlike([*shapes, *moments_of(model)])
    assert [float(moment["after"]) for moment in moments] == [20.0, 50.0, 70.0]


def test_what_comes_and_goes_within_five_readings_is_no_two_events():
    """Gross readings are a knock there and a slip back, and no such pair is an explanation."""
    file, random = bench(), np.random.default_rng(2)
    robot = build_mechanism(file.machine)
    target = random.uniform(-60.0, 60.0, (120, 3))
    joints = robot.inverse(torch.as_tensor(target)).numpy()
    measured = target + random.normal(0.0, 0.003, (120, 3))
    measured[60:63] += (0.2, -0.3, 0.25)
    table = make_table(target, joints, measured=measured, time_s=np.arange(120.0))
    model = Model(file) + Term(
        library()["setup-jump"](), torch.tensor([0.2, -0.3, 0.25, 0.0, 0.0, 0.0, 59.0], dtype=torch.float64)
    )
    problem = build_problem(file, table)
    fitted = fit(model, problem, robust=False)
    slip = library()["homing-slip"]()
    shapes = {slip.key: [{"after": torch.tensor([moment], dtype=torch.float64)} for moment in (55.0, 59.0, 62.0, 64.0)]}
    noise = Noise(np.eye(3) * 9e-6, "machine file")
    system = build_row_system(fitted, problem, [slip], noise, 1000.0, problem.used, shapes=shapes)
    scorer = Scorer(system)
    state = scorer.score(["setup-jump"], WHITE)
    open_ = {system.atoms[gain.key].moment for gain in scorer.all_gains(state, lambda atom: atom.name == slip.name)}
    assert open_ == {55.0, 59.0, 62.0, 64.0}
    slips = {atom.moment: key for key, atom in system.atoms.items() if atom.name == slip.name}
    likely = {moment: np.isfinite(scorer.score((*state.keys, key), WHITE).total) for moment, key in slips.items()}
    assert likely == {55.0: True, 59.0: True, 62.0: False, 64.0: True}
    both = model + Term(slip, torch.tensor([0.1, 0.0, 0.0, 62.0], dtype=torch.float64))
    told = Scorer(build_row_system(fit(both, problem, robust=False), problem, [], noise, 1000.0, problem.used))
    less = told.score(["setup-jump"], WHITE)  # what the model has may be taken out and come back
    assert [gain.key for gain in told.screen(less, lambda atom: atom.name == slip.key)] == [slip.key]


@pytest.mark.parametrize("began", [pytest.param(0.0, marks=pytest.mark.long), 5000.0])
def test_a_moment_is_said_by_the_clock_of_the_table(began: float) -> None:
    """Who looks for it in the file finds the row, whenever the clock was started."""
    assert f"slip after {began + 890.0:.0f} s" in told_of({90: (0, 0.05)}, began=began).words
