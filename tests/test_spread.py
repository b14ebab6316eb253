"""Standard deviations that a diagnosis states: of values told by how wide they are, or by either of two sets."""

from dataclasses import replace

import numpy as np
import pytest

from ptt.challenge.cases import draw, plan
from ptt.challenge.truth import table_of
from ptt.diagnosis.find import find
from ptt.diagnosis.memory import Memory
from ptt.diagnosis.probability import TEMPER
from ptt.diagnosis.spread import exchanged_errors, spread_of, square_errors, values_of
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


def test_a_slip_and_a_knock_that_may_have_changed_places_say_so():
    found, problem, true = found_of("multi", 1010055)  # at each other's moments they leave 1.4 less of 215
    state, scale, key = found.state, found.system.scale, "homing-slip"
    pull = values_of(state, found.system.atoms[key], scale) - np.array(true[key]["slip_mm"])
    alone, both = spread_of(found.scorer, state, key) ** 2, exchanged_errors(found, problem)[key][:3]
    assert np.abs(pull / np.sqrt(alone)).max() > 5.0
    assert np.abs(pull / np.sqrt(alone + both)).max() < 2.0
