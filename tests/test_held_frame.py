"""Frames that base reflectors hold: their readings scatter, and what is stated of an effect takes that in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench
from ptt.correct.training.compensator import Compensator
from ptt.correct.training.heldout import evaluate_heldout
from ptt.correct.training.protocols import block_protocol
from ptt.correct.training.train import train
from ptt.diagnosis.diagnose import diagnose
from ptt.effects import library
from ptt.fitting.chunks import LONG
from ptt.fitting.gauge import sparsest
from ptt.fitting.held_frame import with_frame_doubt
from ptt.fitting.kept import keep
from ptt.fitting.solve import fit, with_rounds_beside
from ptt.fitting.tool_sigma import tool_sigma
from ptt.judge.ladder.climb import climb
from ptt.machine import MachineFile, load_machine
from ptt.machine_schema import TrackerSpec
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.run.base_visits import rounds_apart
from ptt.run.problem import Problem, build_problem
from ptt.run.table import concat_tables, make_table
from ptt.run.viewing import build_view

NOISE = 0.004
PLACES = np.array([[300.0, 20.0, -60.0], [-150.0, 260.0, -40.0], [-140.0, -270.0, -80.0], [200.0, 210.0, 90.0]])
OFFSETS = np.array([0.05, -0.03, 0.02])
STILL = np.zeros(3)
LITTLE, DRIFT = np.array([0.0, 0.0, 0.012]), np.array([0.15, -0.1, 0.1])
HOLDING = [(3, STILL, ["homing-offset"]), (2, DRIFT, ["tracker-drift", "homing-offset"])]  # seed, drift, what is there


def machine(places: np.ndarray = PLACES) -> MachineFile:
    """The bench beside a tracker that reads four reflectors fixed to the base."""
    file = bench()
    points = [{"name": f"base {k + 1}", "xyz_mm": place.tolist(), "sigma_mm": 1e-4} for k, place in enumerate(places)]
    told = {"frame": "measured", "sigma_mm": NOISE, "base_point": points}
    return replace(file, tracker=TrackerSpec.model_validate(told))


def measured(
    seed: int, rows: int = 200, rounds: int = 2, places: np.ndarray = PLACES, offsets: np.ndarray = OFFSETS,
    drift: np.ndarray = STILL,
) -> Problem:  # fmt: skip
    """Offsets of all sliders, read with rounds to four reflectors before and between them, by a tracker that drifts."""
    file, random = machine(places), np.random.default_rng(seed)
    robot = build_mechanism(file.machine)
    target = random.uniform(-60.0, 60.0, (rows, 3))
    joints = robot.inverse(torch.as_tensor(target)).numpy()
    there = robot.forward(torch.as_tensor(joints + offsets)).numpy()
    cuts = np.linspace(0, rows, rounds, endpoint=False).astype(int)
    before = np.repeat(cuts, len(places))  # poses ahead of each reading of a reflector
    names, none = [f"base {k + 1}" for k in range(len(places))] * rounds, np.full((len(before), 3), np.nan)
    read = np.insert(there, before, np.tile(places, (rounds, 1)), axis=0)
    read = read + np.linspace(0.0, 1.0, len(read))[:, None] * drift
    table = make_table(
        np.insert(target, before, none, axis=0), np.insert(joints, before, none, axis=0),
        read + random.normal(0.0, NOISE, read.shape),
        time_s=10.0 * np.arange(len(read)),
        role=np.insert(np.full(rows, "pose"), before, "base"),
        name=np.insert(np.full(rows, "", dtype="U8"), before, names),
    )  # fmt: skip
    return build_problem(file, table)


@pytest.fixture(autouse=True)
def drawn_right(monkeypatch: pytest.MonkeyPatch) -> None:
    """What base reflectors leave open is told apart from what sizes of the drawing may: these are taken for right."""
    for place in ("judge.ladder.climb", "diagnosis.telling.verdict", "correct.training.train"):
        monkeypatch.setattr(f"ptt.{place}.beside_unnamed", lambda fitted, problem: fitted)


def test_what_add_states_is_as_sure_as_the_reflectors_make_it():
    pulls = []
    for seed in range(12):
        step = climb(Model(machine()), measured(seed), [library()["homing-offset"]()]).steps[-1]
        (term,) = step.fitted.model.terms
        pulls.append((term.theta.numpy() - OFFSETS) / term.std.numpy())
    assert 0.6 < float(np.sqrt(np.square(pulls).mean())) < 1.4
    assert np.abs(pulls).max() < 3.5


def test_reflectors_hold_the_frame_beside_a_drift_that_moves_their_rounds_apart():
    """One zero is off by a tenth of the drift: nearly a shift and a turn of all readings, but for the reflectors."""
    found = diagnose(Model(machine()), measured(1, rows=45, rounds=3, offsets=LITTLE, drift=DRIFT))
    assert found.verdict == "missing" and [names[0] for names in found.suggested] == ["tracker-drift", "homing-offset"]


def test_a_drift_that_a_model_has_without_values_is_fitted_before_rounds_are_judged_beside_it():
    problem = measured(1, rows=45, rounds=3, offsets=LITTLE, drift=DRIFT)
    found = diagnose(Model(machine()) + library()["tracker-drift"](), problem)
    assert [names[0] for names in found.suggested] == ["homing-offset"]


def test_rows_paired_with_the_readings_of_others_leave_reflectors_holding_the_frame_beside_a_drift():
    problem = measured(2, rows=60, rounds=3, offsets=LITTLE, drift=DRIFT)
    wild = problem.table.measured.copy()
    wild[np.flatnonzero(problem.table.role != "base")[25:30]] += np.random.default_rng(3).normal(0.0, 40.0, (5, 3))
    found = diagnose(Model(machine()), build_problem(machine(), replace(problem.table, measured=wild)))
    assert [names[0] for names in found.suggested] == ["tracker-drift", "homing-offset"]


def visits_of(walk: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Visits to all reflectors in rounds that the tracker's walk, (r, 3) mm, moves; their reflectors and rounds."""
    rounds, point = np.divmod(np.arange(len(PLACES) * len(walk)), len(PLACES))
    noise = np.random.default_rng(2).normal(0.0, 1e-3, (len(point), 3))
    return PLACES[point] + walk[rounds] + noise, point, rounds


def test_rounds_scatter_by_what_a_fit_leaves_of_them():
    line = np.linspace(0.0, 0.1, 40)[:, None]
    read, point, rounds = visits_of(line + np.random.default_rng(1).normal(0.0, 0.02, (40, 3)))
    columns = line[rounds][..., None] * np.eye(3)
    assert rounds_apart(read, point, rounds, np.zeros((160, 3, 0))) > 0.03
    assert rounds_apart(read - line[rounds], point, rounds, columns) == pytest.approx(0.02, rel=0.2)
    few = rounds < 2
    assert rounds_apart(read[few], point[few], rounds[few], columns[few]) is None


def test_what_moves_all_rounds_alike_or_other_runs_takes_nothing_off_their_scatter():
    """With three rounds to a run a drift leaves three of six numbers; a scale has four, a knock in the first six."""
    one = measured(1, rows=45, rounds=3, drift=DRIFT).table
    problem = build_problem(machine(), concat_tables([one, one]))
    drifting = fit(Model(machine()) + library()["tracker-drift"](), problem).model
    scale = Term(library()["tracker-scale"](), torch.full((4,), 1e-9, dtype=torch.float64))
    knock = Term(library()["setup-jump"](), torch.tensor([1e-9] * 6 + [250.0], dtype=torch.float64))
    bases = [problem.base] + [
        with_rounds_beside(replace(drifting, terms=(*drifting.terms, *more)), problem).base
        for more in ((), (scale,), (knock,))
    ]
    drawn, alone, beside_scale, beside_knock = (base.apart for base in bases if base is not None)
    assert alone.max() < 0.1 * drawn.min()
    np.testing.assert_allclose(beside_scale, alone, atol=1e-5)
    second = bases[0].frame == 1
    np.testing.assert_allclose(beside_knock, np.where(second, alone, drawn), atol=1e-5)


def test_rounds_scatter_alike_where_some_reflectors_were_missed():
    """One alone was read in every round; or each in a round of its own, and what it scatters by itself is unknown."""
    read, point, rounds = visits_of(np.random.default_rng(1).normal(0.0, 0.02, (10, 3)))
    none = np.zeros((len(read), 3, 0))
    whole = rounds_apart(read, point, rounds, none)
    for here in ((rounds < 9) | (point == 0), (rounds < 1) | (point == 1), rounds % len(PLACES) == point):
        assert rounds_apart(read[here], point[here], rounds[here], none[here]) == pytest.approx(whole, rel=0.35)
    assert rounds_apart(read[:4], point[:4], rounds[:4], none[:4]) == 0.0


def test_rows_of_a_short_second_run_are_held_out_all_at_once():
    """Its frame is told by its own reflectors, whatever readings of the tool a fit does without."""
    problem = build_problem(machine(), concat_tables([measured(1).table, measured(2, rows=6).table]))
    step = climb(Model(machine()), problem, [library()["homing-offset"]()]).steps[-1]
    assert step.heldout_rms_um["total"] < 1.2e3 * np.sqrt(3.0) * NOISE


@pytest.mark.parametrize(("seed", "drift", "names"), HOLDING)
def test_add_and_diagnose_state_alike(seed: int, drift: np.ndarray, names: list[str]):
    problem = measured(seed, rows=60, rounds=3, drift=drift)
    step = climb(Model(machine()), problem, [library()[name]() for name in names]).steps[-1]
    found = diagnose(Model(machine()), problem)
    assert [first for first, *_ in found.suggested] == names
    told = {item.effect: [parameter.std for parameter in item.parameters[:3]] for item in found.candidates}
    for term in step.fitted.model.terms:
        np.testing.assert_allclose(term.std[:3].numpy(), told[term.effect.key], rtol=0.35)


def test_more_readings_of_the_reflectors_make_it_surer_and_none_leave_it_as_it_is(monkeypatch: pytest.MonkeyPatch):
    effects = [library()["homing-offset"]()]
    few, many = (climb(Model(machine()), measured(1, rounds=n), effects).steps[-1].fitted for n in (2, 32))
    assert many.std.max() < 0.5 * few.std.max()
    problem = measured(1)
    assert with_frame_doubt(few, replace(problem, base=None)) is few
    once = with_frame_doubt(few, problem)
    assert few.doubt is not None and once.covariance is few.covariance  # of the tool as its frame shows it
    assert problem.table.rows < LONG
    monkeypatch.setattr("ptt.fitting.held_frame.LONG", 100)
    np.testing.assert_allclose(with_frame_doubt(few, problem).std, once.std, rtol=1e-6)


@pytest.mark.parametrize(("seed", "drift", "names"), HOLDING)
def test_training_states_as_add_does(seed: int, drift: np.ndarray, names: list[str]):
    problem, effects = measured(seed, rows=60, rounds=3, drift=drift), [library()[name]() for name in names]
    added = climb(Model(machine()), problem, effects).steps[-1].fitted.model.terms
    trained = train(sum(effects, Model(machine())), problem).physics.model.terms
    for one, other in zip(added, trained, strict=True):
        np.testing.assert_allclose(one.theta.numpy(), other.theta.numpy(), atol=1e-3)
        np.testing.assert_allclose(other.std[:3].numpy(), one.std[:3].numpy(), rtol=0.05)


def test_held_out_rows_are_predicted_in_the_frame_beside_a_drift_that_is_fitted_to_the_others():
    problem = measured(1, rows=60, rounds=3, offsets=LITTLE, drift=DRIFT)
    model = Model(machine()) + library()["tracker-drift"]() + library()["homing-offset"]()
    found = evaluate_heldout(Compensator(model, None, {}), problem, block_protocol(problem))
    assert np.sqrt(np.square(found.after).sum(axis=1).mean()) < 1.2 * np.sqrt(3.0) * NOISE


def test_reflectors_in_one_line_leave_a_turn_about_it_open():
    row = np.array([[-200.0, 0.0, -60.0], [10.0, 0.0, -60.0], [220.0, 0.0, -60.0], [300.0, 0.0, -60.0]])
    problem = measured(5, places=row)
    (term,) = climb(Model(problem.file), problem, [library()["homing-offset"]()]).steps[-1].fitted.model.terms
    assert 0.05 < float(term.std.max()) < 20.0


def test_a_gauge_is_asked_at_places_that_no_reflector_saw() -> None:
    problem = measured(2)
    term = climb(Model(machine()), problem, [library()["homing-offset"]()]).steps[-1].fitted.model.terms[0]
    assert problem.noise is not None
    (told,) = sparsest([replace(term, theta=1e-3 * term.theta)], problem, problem.noise)  # too small to be told
    assert torch.isfinite(told.term.theta).all()


def test_the_tool_is_as_uncertain_in_the_base_frame_as_it_is_wrong():
    """Zeros of an arm take up a tilt of the frame in one corner of its reach, and go on with it in the others."""
    drawn = load_machine(Path(__file__).resolve().parents[1] / "data" / "machines" / "ur10.toml")
    arm = replace(machine(PLACES), machine=drawn.machine)
    robot, random, ratios = build_mechanism(arm.machine), np.random.default_rng(1), []
    middle, zeros = random.uniform(-1.0, 1.0, 6), np.array([3e-4, -2e-4, 4e-4, 1e-4, -3e-4, 0.0])
    for _ in range(4):
        q = np.concatenate([np.full((8, 6), np.nan), middle + random.uniform(-0.4, 0.4, (60, 6))])
        there = robot.forward(torch.as_tensor(np.nan_to_num(q) + zeros)).numpy()
        there[:8] = np.tile(PLACES, (2, 1))
        table = make_table(
            np.where(np.isnan(q[:, :1]), np.nan, there), q, there + random.normal(0.0, NOISE, there.shape),
            role=np.repeat(["base", "pose"], [8, 60]),
            name=np.array([f"base {k + 1}" for k in range(4)] * 2 + [""] * 60),
        )  # fmt: skip
        problem = build_problem(arm, table)
        fitted = climb(Model(arm), problem, [library()["homing-offset"]()]).steps[-1].fitted
        fresh = middle + random.uniform(-1.5, 1.5, (40, 6))
        view, shifts = build_view(arm, make_table(None, fresh)), [(t.effect, t.theta) for t in fitted.model.terms]
        there = robot.forward(torch.as_tensor(fresh + zeros))
        missed = (predict(shifts, view).p - there).norm(dim=1).numpy()
        ratios.append(missed / tool_sigma(keep(fitted), shifts, view, arm))
    assert 0.5 < np.sqrt(np.square(ratios).mean()) < 1.5
