"""Readings beyond all sense end in a verdict: within the reach of the links, and no axis loses its noise."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from made_runs import empty_run, machine, term

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.search.excess import Objections
from ptt.diagnosis.search.fits import fit_less, is_reachable
from ptt.diagnosis.search.rest import Rest
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

NOISE = Noise(np.eye(3) * 9e-6, "stated", 100.0)


def waving(seed: int, size: float) -> Problem:
    """Readings off by waves of some millimetres along each axis, which nothing in the library does."""
    random = np.random.default_rng(seed)
    table = make_table(random.uniform(-60.0, 60.0, (60, 3)))
    waves = random.normal(0.0, 1.0 / 30.0, (3, 3))
    off = size * np.sin(table.target @ waves + random.uniform(0.0, 6.0, 3))
    return build_problem(machine(), table.replace(measured=table.target + off + random.normal(0.0, 0.003, (60, 3))))


@pytest.mark.parametrize(
    ("seed", "size"),
    [
        pytest.param(6, 100.0, marks=pytest.mark.long, id="a fit cannot begin where the tangent leads"),
        pytest.param(5, 3.0, id="an unknown follows one axis to the last digit"),
    ],
)
def test_what_no_machine_does_is_unknown_and_no_error(seed: int, size: float) -> None:
    problem = waving(seed, size)
    found = diagnose(Model(machine()), problem)
    assert found.verdict == "unknown"
    assert is_reachable(found.model.terms, problem)
    shares = np.linalg.eigvalsh(found.noise.covariance)
    assert shares[0] > 5e-4 * shares[-1]


def test_a_fit_begins_within_reach_and_stays_there() -> None:
    problem = build_problem(machine(), empty_run(40).replace(measured=empty_run(40).target.copy()))
    far = Model(machine()) + term("homing-offset", problem.view, [1e4, 0.0, -1e4])
    assert not is_reachable(far.terms, problem)
    fitted = fit_less(far, problem, np.zeros((40, 3)), np.zeros(40, dtype=bool), NOISE)
    assert is_reachable(fitted.model.terms, problem)
    torch.testing.assert_close(fitted.model.terms[0].theta, torch.zeros(3, dtype=torch.float64), atol=1e-3, rtol=0.0)


def test_names_with_which_the_machine_could_not_stand_speak_against_an_explanation() -> None:
    sound = Rest((), ())
    assert not sound.objected(Objections(), NOISE, NOISE).significant
    said = sound.objected(Objections(impossible=("tower-position", "backlash")), NOISE, NOISE)
    assert said.significant
    assert "the fitted values of tower-position and backlash are impossible" in said.reasons[0]


def test_a_clock_that_goes_back_within_a_run_was_set_anew() -> None:
    """Rows that are taken as they stand keep their order: time goes on where the clock was set back."""
    table = empty_run(40)
    table = table.replace(measured=table.target + 0.003 * np.random.default_rng(0).normal(size=(40, 3)))
    anew = build_problem(machine(), table.replace(time_s=10.0 * (np.arange(40) % 20))).view
    assert float(anew.time.diff().min()) == 0.0
    assert float(anew.time[-1]) == 380.0
    backward = build_problem(machine(), table.replace(time_s=-10.0 * np.arange(40)))
    assert "time" not in backward.view.varies
    assert diagnose(Model(machine()), replace(backward)).verdict in ("nothing-missing", "missing", "unknown")
