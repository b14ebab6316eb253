"""Waves that come back at whole parts of a screw's turn are named; those of any other length stay unknown."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.harmonics import find_harmonics
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import library
from ptt.effects.screw import OncePerRev
from ptt.machine import MachineFile, load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

FILE = bench()
LEAD = float(FILE.machine.screw_lead_mm)
MECHANISM = build_mechanism(FILE.machine)
NOISE = 0.004


def waving(lengths: Sequence[float], sliders: Sequence[float] = (1.0, 1.0, 1.0), rows: int = 150) -> Problem:
    """Random poses of a machine whose sliders err by 12 um with waves of some lengths, mm."""
    random = np.random.default_rng(5)
    sent = MECHANISM.inverse(torch.as_tensor(random.uniform(-55.0, 55.0, (rows, 3)))).numpy()
    return reading(sent, lengths, sliders)


def reading(sent: np.ndarray, lengths: Sequence[float], sliders: Sequence[float], file: MachineFile = FILE) -> Problem:
    """What a tracker reads of such sliders."""
    random = np.random.default_rng(6)
    target = MECHANISM.forward(torch.as_tensor(sent)).numpy()
    error = np.zeros_like(sent)
    for length in lengths:
        error += 0.012 * np.sin(2.0 * np.pi * sent / length + random.uniform(0.0, 6.0, 3)) * sliders
    there = MECHANISM.forward(torch.as_tensor(sent + error)).numpy()
    measured = there + random.normal(0.0, NOISE, target.shape)
    return build_problem(file, replace(make_table(target, sent), measured=measured))


def names(found: Diagnosis) -> set[str]:
    return {step[0] for step in found.suggested}


@pytest.mark.parametrize(
    ("waves", "sliders"),
    [
        ((2, 3), (1, 1, 1)),
        pytest.param((1, 3), (1, 1, 1), marks=pytest.mark.long),
        pytest.param((4,), (1, 1, 1), marks=pytest.mark.long),
        pytest.param((6, 12), (1, 1, 1), marks=pytest.mark.long),
        ((2, 5), (0, 1, 0)),
    ],
)
def test_waves_at_whole_parts_of_a_turn_are_named(waves: tuple[int, ...], sliders: tuple[int, ...]) -> None:
    found = diagnose(Model(FILE), waving([LEAD / m for m in waves], sliders))
    expected = {"once-per-rev" if m == 1 else f"once-per-rev[harmonic {m}]" for m in waves}
    assert (found.verdict, names(found)) == ("missing", expected)


def test_a_sawtooth_of_the_turn_is_as_many_of_its_harmonics_as_are_seen() -> None:
    problem = waving([], rows=300)
    sent = problem.view.q.numpy()
    error = 0.05 * (np.remainder(sent / LEAD, 1.0) - 0.5)
    there = MECHANISM.forward(torch.as_tensor(sent + error)).numpy()
    measured = there + np.random.default_rng(7).normal(0.0, NOISE, there.shape)
    found = diagnose(Model(FILE), replace(problem, measured=measured))
    assert found.verdict == "missing"
    assert {"once-per-rev", *(f"once-per-rev[harmonic {m}]" for m in (2, 3, 4))} <= names(found)


@pytest.mark.parametrize(
    "part", [1.37, pytest.param(0.44, marks=pytest.mark.long), pytest.param(0.29, marks=pytest.mark.long)]
)
def test_a_period_beside_the_harmonics_stays_unknown_and_its_length_is_told(part: float) -> None:
    found = diagnose(Model(FILE), waving([part * LEAD], (0.0, 1.0, 0.0), rows=250))
    assert found.verdict == "unknown"
    assert not any(name.startswith("once-per-rev") for name in names(found))
    told = [each.period_mm for each in found.depends_on if each.period_mm and each.on == "b2"]
    assert told[0] == pytest.approx(part * LEAD, rel=0.01)


def test_a_harmonic_is_offered_once_and_only_where_heights_show_enough_of_its_phases() -> None:
    known, random = library(), np.random.default_rng(8)
    low = MECHANISM.inverse(torch.zeros((1, 3), dtype=torch.float64)).numpy()
    for whole, offered in ((False, True), (True, False)):  # of three waves a turn twelfths show four phases
        steps = random.uniform(-130, 130, (150, 3))
        sent = np.round(low / LEAD) * LEAD + (np.round(steps) if whole else steps) * LEAD / 12.0
        problem = reading(sent, [LEAD / 3.0], (1.0, 1.0, 1.0))
        found = find(Model(FILE), problem, known, lambda what: None)
        nothing = found.scorer.score((), WHITE)
        seen = find_harmonics(found.scorer, nothing, problem)
        assert (OncePerRev("harmonic 3") in seen) == offered
        assert all(each.needs(problem.view) is None for each in seen)
        assert OncePerRev("harmonic 3") not in find_harmonics(found.scorer, nothing, problem, seen)


def test_on_a_travel_of_few_turns_any_length_would_be_a_harmonic_and_none_is_offered() -> None:
    file = replace(FILE, machine=FILE.machine.model_copy(update={"screw_lead_mm": 400.0}))
    random = np.random.default_rng(9)
    sent = MECHANISM.inverse(torch.as_tensor(random.uniform(-55.0, 55.0, (150, 3)))).numpy()
    problem = reading(sent, [8.0], (1.0, 1.0, 1.0), file)  # the fiftieth
    found = find(Model(file), problem, library(), lambda what: None)
    assert not found.seen
    assert found.periods


def turning(waves: float, joints: Sequence[int], reach: float = 2.2) -> Diagnosis:
    """What is said of a UR10 some of whose joints err by 400 urad with so many waves a turn; none goes once around."""
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machines" / "ur10.toml")
    robot, random, rows = build_mechanism(file.machine), np.random.default_rng(int(waves)), 150
    sent = random.uniform(-reach, reach, (rows, 6))
    error = 4e-4 * np.sin(waves * sent + random.uniform(0.0, 6.0, 6)) * joints
    there = robot.forward(torch.as_tensor(sent + error)).numpy()
    file = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": 0.02}))
    table = make_table(robot.forward(torch.as_tensor(sent)).numpy(), sent)
    table = replace(table, measured=there + random.normal(0.0, 0.02, there.shape))
    return diagnose(Model(file), build_problem(file, table))


@pytest.mark.parametrize(
    ("joints", "waves"),
    [
        pytest.param(joints, waves, marks=() if waves == asked else pytest.mark.long)
        for joints, asked in (((1, 1, 1, 1, 1, 1), 7), ((0, 0, 1, 0, 0, 0), 2))
        for waves in (2, 4, 7)
    ],
)
def test_joints_of_an_arm_may_err_at_part_of_their_turn(waves: int, joints: tuple[int, ...]) -> None:
    """None of them goes once around, so that lines of neighbouring harmonics run into each other."""
    found = turning(waves, joints)
    assert (found.verdict, names(found)) == ("missing", {f"once-per-rev[harmonic {waves}]"})


@pytest.mark.parametrize("joints", [(0, 1, 0, 0, 1, 0), pytest.param((0, 0, 1, 0, 0, 0), marks=pytest.mark.long)])
def test_a_wave_between_two_harmonics_is_neither_of_them_where_lines_run_into_each_other(
    joints: tuple[int, ...],
) -> None:
    found = turning(9.4, joints)
    assert (found.verdict, names(found)) == ("unknown", set())
    assert found.depends_on[0].period_mm == pytest.approx(2.0 * np.pi / 9.4, rel=0.01)


def test_what_was_seen_is_a_candidate_once_and_only_of_an_effect_that_is_known() -> None:
    problem, known = waving([LEAD / 4.0]), library()
    found = find(Model(FILE), problem, known, lambda what: None)
    assert [each.label for each in found.seen] == ["harmonic 4"]
    there, _ = present_candidates(found.fitted, problem, known, found.seen)
    assert "once-per-rev[harmonic 4]" not in {each.key for each in there}  # it is in the model
    other = (OncePerRev("harmonic 2"), OncePerRev("harmonic 9"))
    there, _ = present_candidates(found.fitted, problem, known, other)
    assert {each.key for each in other} <= {each.key for each in there}
    some = {name: cls for name, cls in known.items() if name != "once-per-rev"}
    assert not {each.key for each in present_candidates(found.fitted, problem, some, other)[0]} & {e.key for e in other}


def test_odds_of_all_harmonics_are_those_of_one_cause() -> None:
    odds = [OncePerRev(f"harmonic {m}").odds_of_kind for m in range(2, 2001)]
    assert np.exp(-np.array(odds)).sum() == pytest.approx(1.0, abs=1e-3)
    assert OncePerRev().odds_of_kind == 0.0
