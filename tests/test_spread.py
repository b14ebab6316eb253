"""Standard deviations that a diagnosis states: of values told by how wide they are, or by either of two sets."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ptt.challenge.cases import Case, draw, plan
from ptt.challenge.hide import hide_faults
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.probability import TEMPER
from ptt.diagnosis.evidence.screen import Gain
from ptt.diagnosis.noise.memory import Memory
from ptt.diagnosis.search.find import find
from ptt.diagnosis.telling.absent import absent_effects
from ptt.diagnosis.telling.exchange import exchanged_errors, exchanges
from ptt.diagnosis.telling.spread import spread_of, square_errors, values_of
from ptt.effects import library
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.run.problem import build_problem


def found_of(level: str, seed: int) -> tuple:
    drawn, truth = draw(plan(level, 1, seed, kinds="all")[0])
    file = drawn.rig.machine
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    true = {fault.name: fault.values for fault in truth.faults}
    return find(Model(file), problem, library(), lambda what: None), problem, true


def test_what_all_towers_have_in_common_is_known_no_better_than_how_wide_few_of_them_are():
    found, _, true = found_of("single", 950001)  # set up anew for each run: shifts of all towers are the tracker's
    (key,), state, scale = found.state.keys, found.state, found.system.scale
    atom = found.system.atoms[key]
    plain, stated = state.errors(atom, scale)[0], spread_of(found.scorer, state, key)
    assert (stated > 1.1 * plain).all()
    values = np.concatenate([true[key]["tower_radial_mm"], true[key]["tower_tangential_mm"]])
    pull = (values_of(state, atom, scale) - values) / np.stack([plain, stated])
    assert np.abs(pull[0]).max() > 2.0 > np.abs(pull[1]).max()


def test_values_of_sets_that_do_as_well_count_by_their_odds(monkeypatch):
    found, _, _ = found_of("single", 950001)
    (key,), state, scorer = found.state.keys, found.state, found.scorer
    own, scale = square_errors(scorer, state, found.system.atoms[key]), found.system.scale
    assert spread_of(scorer, state, key) ** 2 == pytest.approx(own)  # nothing else comes near
    posterior = replace(state.posterior, values=1.1 * state.posterior.values)
    rival = replace(state, keys=state.keys, memory=Memory(None, 0.1), total=state.total - 2.0, posterior=posterior)
    monkeypatch.setitem(scorer.scored, (rival.keys, rival.memory), rival)
    odds, apart = np.exp(-2.0 / TEMPER), 0.1 * values_of(state, found.system.atoms[key], scale)
    other = square_errors(scorer, rival, found.system.atoms[key]) + apart**2
    assert spread_of(scorer, state, key) ** 2 == pytest.approx((own + odds * other) / (1.0 + odds))


def test_a_slip_and_a_knock_that_may_have_changed_places_say_so(monkeypatch):
    """Where both are taken for scatter of the repeats, as here by force, a slip may stand at the time of a knock."""
    monkeypatch.setattr("ptt.run.repeats._white_part", lambda pooled, *_: pooled)
    found, problem, true = found_of("multi", 1010055)  # at each other's moments they leave 1.4 less of 215
    state, scale, key = found.state, found.system.scale, "homing-slip"
    pull = values_of(state, found.system.atoms[key], scale) - np.array(true[key]["slip_mm"])
    alone, both = spread_of(found.scorer, state, key) ** 2, exchanged_errors(found, exchanges(found, problem))[key][:3]
    assert np.abs(pull / np.sqrt(alone)).max() > 5.0
    assert np.abs(pull / np.sqrt(alone + both)).max() < 2.0


def test_what_zeros_would_do_that_nobody_named_stands_in_the_errors_of_leaning_towers():
    """In a frame that is fitted, zeros that differ lean the tracker: the towers take what the frame does not."""
    drawn, _ = draw(Case(1090035, "single", "volume", ("tower-tilt",), noise="white"))
    drawn = hide_faults(drawn, ["homing-offset"], 1090042)
    file = drawn.rig.machine
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = find(Model(file), problem, library(), lambda what: None)
    (key,), state, scorer = found.state.keys, found.state, found.scorer
    atom = found.system.atoms[key]
    assert atom.name == "tower-tilt"
    lean = drawn.truth["tower-tilt"]
    true = 1e-3 * np.concatenate([lean["lean_radial_mrad"], lean["lean_tangential_mrad"]])
    off = np.abs(values_of(state, atom, found.system.scale) - true)
    alone = spread_of(scorer, state, key)
    candidate = next(one for one in diagnose(Model(file), problem).candidates if one.effect == "tower-tilt")
    beside = np.array([item.std for item in candidate.parameters])
    assert (off / alone).max() > 100.0
    assert (off / beside).max() < 3.0  # it is even whether zeros are off, once nothing speaks against that


def test_an_effect_that_the_readings_exclude_leaves_errors_as_they_are():
    """In a frame that the file trusts, readings tell zeros from towers: nothing is left open."""
    scores, moves = [], []
    for known in (0.0, 1e-4, 1e4):
        state, scorer = beside_one(known)
        (absent,) = absent_effects(scorer, state)
        scores.append(absent.odds)
        moves.append(float(absent.moved[0, 0]))
    assert scores[0] == pytest.approx(np.exp(-8.0 / TEMPER))
    assert moves[0] == pytest.approx(1.0)  # of one usual size, told by nothing
    assert moves[1] == pytest.approx(moves[0], rel=1e-3)
    assert moves[2] < 1e-3 * moves[0]
    assert scores[2] < 0.02 * scores[0]


RARE = SimpleNamespace(of_drawing=False)


def beside_one(known: float) -> tuple:
    """A set of one value, and an effect that does the same but for what a sum of squares of `known` tells of it."""
    gram = np.array([[1e6, 1e6], [1e6, 1e6 + known]])
    own = 0.5 * np.log(1.0 + known)
    atom = SimpleNamespace(name="told", key="told", columns=np.array([0]), odds=8.0, group=np.array([0]), effect=RARE)
    other = SimpleNamespace(
        name="absent", key="absent", columns=np.array([1]), odds=8.0, group=np.array([0]), effect=RARE
    )
    system = SimpleNamespace(
        atoms={"told": atom, "absent": other},
        sums_of=lambda columns, memory: SimpleNamespace(gram=gram[np.ix_(columns, columns)], side=np.array([1e6, 1e6])),
    )
    posterior = SimpleNamespace(phi=1.0, values=np.array([1.0]), cholesky=np.array([[1e3]]), order=np.array([0]))
    state = SimpleNamespace(keys=("told",), columns=np.array([0]), memory=None, posterior=posterior)
    gain = Gain(-8.0 - own, "absent", np.ones(1))
    return state, SimpleNamespace(system=system, screen=lambda state, allowed: [gain])
