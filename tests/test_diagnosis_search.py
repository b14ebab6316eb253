"""What a search may say: the moment to the row, the fewest parts, gross errors by the bulk, names that predict."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.hide import hide_faults
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence import score
from ptt.diagnosis.evidence.candidates import first_of
from ptt.diagnosis.evidence.product import nats_of_none, nats_of_product
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search import exact
from ptt.diagnosis.search.find import find
from ptt.effects import library
from ptt.fitting.moment import place_own_moments
from ptt.fitting.solve import fit
from ptt.machine import load_machine
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.rig.draw import DrawnRig, draw_rig
from ptt.rig.simulate import simulate
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table

MACHINE = bench_machine()


def hidden(fault: str, seed: int, rows: int = 200) -> tuple[DrawnRig, Problem]:
    drawn = hide_faults(draw_rig(seed, MACHINE, "volume", rows=rows), [fault], seed)
    return drawn, build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))


@pytest.mark.parametrize("off", [-3, -1, 1])
def test_a_slip_is_dated_to_its_row(off):
    drawn, problem = hidden("homing-slip", 31, rows=120)
    effect, time = library()["homing-slip"](), problem.view.time
    last = drawn.rig.drive.slip_row - 1
    term = Term(effect, torch.cat([torch.zeros(3, dtype=torch.float64), time[last + off].reshape(1)]))
    dated = place_own_moments(fit(Model(MACHINE) + term, problem, robust=False), problem)
    assert float(dated.terms[0].theta[-1]) == float(time[last])


def test_of_a_knock_and_a_slip_each_keeps_its_own_moment():
    """Three sliders that slip look like a knock but for turns, so each may be found first where the other was."""
    drawn, truth = draw(plan("multi", 1, 800014, noise=None, bench=None, rows=None, visible=True)[0])
    assert {"homing-slip", "setup-jump"} <= set(drawn.truth)
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(drawn.rig.machine), problem)
    terms = {term.effect.name: term for term in found.model.terms}
    assert set(terms) == set(truth.hidden)
    assert float(terms["setup-jump"].theta[-1]) < float(terms["homing-slip"].theta[-1])  # as hidden
    slip, true = terms["homing-slip"], torch.tensor(drawn.truth["homing-slip"]["slip_mm"])
    assert slip.std is not None and (abs(slip.theta[:3] - true) < 4.0 * slip.std[:3]).all()


def test_a_product_s_prior_is_that_of_its_place():
    """Against sums over many draws of the first value; where readings say nothing of the others it is nothing."""
    random, read, error, width = np.random.default_rng(0), np.array([1.0, 2.0, -0.5, 0.3]), 0.1, 2.0
    first = random.normal(0.0, np.sqrt(width), 400_000)
    given, linear = np.square(first)[:, None] + error**2, width + error**2
    own = -0.5 * np.square(read[0] - first) / 0.09
    logs = own - 0.5 * (np.square(read[1:]) / given + np.log(given)).sum(axis=1)
    plain = own - 0.5 * (np.square(read[1:]) / linear + np.log(linear)).sum()
    information = np.diag([1.0 / 0.09, *[error**-2] * 3])
    covariance = np.linalg.inv(information + np.eye(4) / width)
    expected = np.log(np.exp(logs).mean()) - np.log(np.exp(plain).mean())
    assert nats_of_product(covariance @ information @ read, covariance, width) == pytest.approx(expected, abs=0.05)
    unseen = np.diag([0.01, width, width, width])
    assert nats_of_product(np.array([1.0, 0.0, 0.0, 0.0]), unseen, width) == pytest.approx(0.0, abs=1e-9)
    none = (
        -0.5 * (np.square(read[1:] / error) + np.log(error**2)).sum()
        + 0.5 * (np.square(read[1:]) / linear + np.log(linear)).sum()
    )
    assert nats_of_none(covariance @ information @ read, covariance, width) == pytest.approx(none, abs=1e-6)
    assert nats_of_none(np.array([1.0, 0.0, 0.0, 0.0]), unseen, width) == pytest.approx(0.0, abs=1e-9)


def test_a_second_knock_without_a_first_is_the_first():
    assert first_of("setup-jump[second]", {"setup-jump[second]", "backlash"}) == "setup-jump"
    assert first_of("setup-jump[second]", {"setup-jump[second]", "setup-jump"}) == "setup-jump[second]"
    assert first_of("once-per-rev[harmonic 2]", {"once-per-rev[harmonic 2]"}) == "once-per-rev[harmonic 2]"


@pytest.mark.parametrize(
    ("fault", "seed", "leads"),
    [
        ("cross-coupling", 35, lambda truth: {f"b{truth['other']}"}),
        pytest.param("loose-joint", 36, lambda truth: {"x", "y"}, marks=pytest.mark.long),
    ],
)
def test_an_unknown_needs_no_names_beside_it_and_leads_with_its_variable(fault, seed, leads):
    drawn, problem = hidden(fault, seed)
    found = diagnose(Model(MACHINE), problem)
    truth = drawn.truth[fault]
    assert found.verdict == "unknown" and not found.suggested
    assert found.depends_on[0].residual == f"slider {truth['leg']}"
    assert found.depends_on[0].on in leads(truth)


def as_found(fitted, **more):
    """As much of an explanation by the effects of a fit as is asked for what is needless in it."""
    keys = fitted.model.keys
    state = SimpleNamespace(keys=keys, worth=lambda key: key == "backlash", posterior=SimpleNamespace(phi=1.0))
    system = SimpleNamespace(atoms={key: SimpleNamespace(odds=3.0) for key in keys})
    scorer = SimpleNamespace(given=(), system=system)
    return SimpleNamespace(
        fitted=fitted,
        scorer=scorer,
        state=state,
        system=system,
        **{"carried": None, "gross": None, "noise": None, **more},
    )


def wound_over(length: float) -> Problem:
    """Readings of a machine that winds up over a short travel, along a spiral in and out, up and down."""
    turn, time = np.linspace(0.0, 33.3, 130), np.linspace(0.0, 1.0, 130)
    radius = 40.0 * np.abs(1.0 - 2.0 * time)
    place = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), 20.0 * np.sin(14.45 * time)])
    file = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"sigma_mm": 0.003}))
    table = make_table(place, measured=place)
    windup = library()["windup"](), torch.tensor([0.1, 0.11, 0.05, *[length] * 3], dtype=torch.float64)
    reading = predict([windup], build_problem(file, table).view).reading.numpy()
    noisy = reading + np.random.default_rng(6).normal(0.0, 0.003, reading.shape)
    return build_problem(file, replace(table, measured=noisy))


def test_windup_over_a_short_travel_is_no_play():
    problem = wound_over(0.05)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "missing" and found.suggested == (("windup",),)
    assert float(found.model.terms[0].theta[-1]) == pytest.approx(0.05, rel=0.1)


def test_without_play_a_windup_is_looked_for_as_if_nothing_were_known():
    """Beside play it had what that left, over a length from which its fit leads to none at all."""
    problem = wound_over(0.3)
    beside = torch.tensor([0.01, 0.005, 0.01, *[0.001] * 3], dtype=torch.float64)
    play = torch.tensor([0.08, 0.09, 0.06, 1.0], dtype=torch.float64)
    both = Model(problem.file) + Term(library()["backlash"](), play) + Term(library()["windup"](), beside)
    noise = Noise(9e-6 * np.eye(3), "machine file")
    fitted = fit(both, problem, noise=noise, robust=False, coarse=True)
    none = {"carried": np.zeros((130, 3)), "gross": np.zeros(130, dtype=bool), "noise": noise}
    less = exact.without_needless(as_found(fitted, **none), problem)
    assert less.keys == ("windup",) and float(less.terms[0].theta[-1]) == pytest.approx(0.3, rel=0.1)


def test_what_is_forgotten_of_sets_of_long_ago_is_worked_out_again(monkeypatch):
    drawn = hide_faults(draw_rig(41, MACHINE, "volume", rows=60), ["link-length", "backlash"], 41)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    kept = diagnose(Model(MACHINE), problem)
    scored = list[tuple]()
    work_out = score.Scorer._score
    monkeypatch.setattr(score.Scorer, "_score", lambda self, *what: scored.append(what[:2]) or work_out(self, *what))
    monkeypatch.setattr(score, "MOST_FACTOR_NUMBERS", 1)  # number: of one set alone the factor is kept
    found = diagnose(Model(MACHINE), problem)
    assert len(scored) > 1.2 * len(set(scored))
    assert {name for (name,) in found.suggested} == {name for (name,) in kept.suggested} == {"link-length", "backlash"}
    assert found.verdict_probability == pytest.approx(kept.verdict_probability, abs=0.01)


def test_a_set_that_was_only_told_to_be_far_is_scored_when_it_is_asked_for():
    drawn = hide_faults(draw_rig(41, MACHINE, "volume", rows=60), ["link-length", "backlash"], 41)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    system, far = find(Model(MACHINE), problem, library(), lambda what: None).system, 0
    for key in list(system.atoms)[:60]:
        whole, hasty = score.Scorer(system), score.Scorer(system)
        exact = whole.score([key], WHITE, {})
        told = hasty.score([key], WHITE, {}, exact.total + 100.0)
        far += told.posterior.stopped_early
        assert told.total <= exact.total + 0.1
        assert hasty.score([key], WHITE).total == pytest.approx(exact.total, abs=0.1)
        assert not hasty.score([key], WHITE).posterior.stopped_early
    assert far > 5


def test_what_is_needless_is_asked_beside_the_unknowns_of_now():
    """A run in which a wind-up and an unknown take turns: the play alone says it all, once neither is carried along."""
    folder = Path(__file__).parent.parent / "data" / "sealed_one"
    machine = load_machine(folder / "machine.toml")
    found = diagnose(Model(machine), build_problem(machine, read_table(folder / "run.csv")))
    assert found.suggested == (("backlash",),) and not found.outliers.any()


def test_from_a_set_that_cannot_be_anything_may_be_the_way_out():
    """Without its unknown a clearance is below zero: no screen of such a set says what may come in its place."""
    drawn, truth = draw(plan("multi", 1, 1090007, kinds="all", noise=None, bench=None, rows=None, visible=True)[0])
    frame = simulate(drawn.rig, drawn.targets).frame
    found = diagnose(Model(drawn.rig.machine), build_problem(drawn.rig.machine, table_of(frame, drawn.absent)))
    assert {step[0] for step in found.suggested} == set(truth.hidden)
    assert found.verdict == "missing"
