"""Lost motion: of play and wind-up that has it which tells the readings."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.lost import lost_by_one
from ptt.effects import library
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table

PLAY, WOUND = ("backlash", [0.09, 0.12, 0.1, 1.0]), ("windup", [0.045, 0.06, 0.05, 0.2])
PART = ("backlash", [0.04, 0.02, -0.02, 1.0]), ("windup", [0.025, 0.05, 0.06, 0.1])
NOISE, MACHINE = Noise(9e-6 * np.eye(3), "machine file"), bench_machine()


def term(name, values):
    return Term(library()[name](), torch.tensor(values, dtype=torch.float64))


def model_of(*terms):
    return sum((term(*each) for each in terms), Model(MACHINE))


@pytest.mark.parametrize("true", [PLAY, WOUND])
@pytest.mark.parametrize("named", [(PLAY,), (WOUND,), PART])
def test_play_and_windup_are_told_apart_where_each_is_fitted(true, named):
    turn = np.linspace(0.0, 30.0, 150)
    place = np.column_stack([35.0 * np.cos(turn), 35.0 * np.sin(turn), 20.0 * np.sin(0.4 * turn)])
    table = make_table(place, measured=place)
    told = term(*true)
    reading = predict([(told.effect, told.theta)], build_problem(MACHINE, table).view).reading.numpy()
    noisy = reading + np.random.default_rng(3).normal(0.0, 0.003, reading.shape)
    problem = build_problem(MACHINE, make_table(place, measured=noisy))
    atoms = {name: SimpleNamespace(name=name, odds=10.0) for name, _ in named}
    found = SimpleNamespace(
        state=SimpleNamespace(keys=tuple(atoms), posterior=SimpleNamespace(phi=1.0)),
        system=SimpleNamespace(atoms=atoms), carried=np.zeros((150, 3)), gross=np.zeros(150, dtype=bool), noise=NOISE,
    )  # fmt: skip
    model = model_of(*named)
    best = lost_by_one(model, Model(MACHINE), found, problem)
    assert best.keys == (true[0],)
    torch.testing.assert_close(best.terms[0].theta[:3], told.theta[:3], atol=2e-3, rtol=0.0)
    assert lost_by_one(model, model, found, problem) is model
