"""Lost motion: of play and wind-up that has it which tells the readings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from told_models import term

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.evidence.memories import _signal_basis
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.lost import lost_by_one
from ptt.effects import library
from ptt.errors import PosesError
from ptt.fitting.solve import fit
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table

PLAY, WOUND = ("backlash", [0.09, 0.12, 0.1, 1.0]), ("windup", [0.045, 0.06, 0.05, 0.2, 0.2, 0.2])
PART = ("backlash", [0.04, 0.02, -0.02, 1.0]), ("windup", [0.025, 0.05, 0.06, 0.1, 0.1, 0.1])
NOISE, MACHINE = Noise(9e-6 * np.eye(3), "machine file"), bench_machine()


def model_of(*terms):
    return sum((term(*each) for each in terms), Model(MACHINE))


def found_beside(*named):
    """What a search found that named these, of 150 rows."""
    atoms = {name: SimpleNamespace(name=name, odds=10.0) for name, _ in named}
    return SimpleNamespace(
        state=SimpleNamespace(keys=tuple(atoms), posterior=SimpleNamespace(phi=1.0)),
        system=SimpleNamespace(atoms=atoms), carried=np.zeros((150, 3)), gross=np.zeros(150, dtype=bool), noise=NOISE,
    )  # fmt: skip


def read(*true):
    """Readings of a machine with these on a way of short moves."""
    turn = np.linspace(0.0, 30.0, 150)
    place = np.column_stack([35.0 * np.cos(turn), 35.0 * np.sin(turn), 20.0 * np.sin(0.4 * turn)])
    view = build_problem(MACHINE, make_table(place, measured=place)).view
    reading = predict([(told.effect, told.theta) for told in (term(*each) for each in true)], view).reading.numpy()
    noisy = reading + np.random.default_rng(3).normal(0.0, 0.003, reading.shape)
    return build_problem(MACHINE, make_table(place, measured=noisy))


SHORTER = (
    ([0.118, 0.026, 0.086], [0.012, 0.01, 0.014, 4.0, 4.0, 4.0]),
    ([-0.022, 0.002, 0.005], [0.074, 0.02, 0.0435, 0.06, 0.06, 0.08]),
)
LONGER = (
    ([0.018, 0.149, 0.15], [0.003, 0.009, 0.009, 1.7, 1.7, 1.7]),
    ([0.015, 0.059, 0.035], [0.004, 0.053, 0.066, 0.08, 0.16, 0.2]),
)


@pytest.mark.parametrize(("true", "named"), [SHORTER, LONGER], ids=["over less than it loses", "over a little more"])
def test_a_windup_that_has_what_is_play_gives_it_back(true, named):
    """From a wind-up over a short travel no step of a fit leads to a play and a wind-up beside it."""
    (play, wound), (other_play, other_wound) = true, named
    terms = ("windup", other_wound), ("backlash", [*other_play, 1.0])
    hidden = ("backlash", [*play, 1.0]), ("windup", wound)
    best = lost_by_one(model_of(*terms), Model(MACHINE), found_beside(*terms), read(*hidden))
    values = {told.effect.name: told.theta for told in best.terms}
    assert set(values) == {"backlash", "windup"}
    np.testing.assert_allclose(values["backlash"][:3], play, atol=4e-3)
    np.testing.assert_allclose(values["windup"][:3], wound[:3], atol=3e-3)


@pytest.mark.parametrize("true", [PLAY, WOUND])
@pytest.mark.parametrize("named", [(PLAY,), (WOUND,), PART])
def test_play_and_windup_are_told_apart_where_each_is_fitted(true, named):
    told, problem, found, model = term(*true), read(true), found_beside(*named), model_of(*named)
    best = lost_by_one(model, Model(MACHINE), found, problem)
    assert best.keys == (true[0],)
    torch.testing.assert_close(best.terms[0].theta[:3], told.theta[:3], atol=2e-3, rtol=0.0)
    assert lost_by_one(model, model, found, problem) is model


def test_no_effect_is_opened_beside_values_beyond_reach():
    """What a tangent asks for may have no place for the tool; nothing is known of other effects there."""
    place = np.random.default_rng(1).uniform(-40.0, 40.0, (40, 3))
    problem = build_problem(MACHINE, make_table(place, measured=place))
    beyond = model_of(("homing-offset", [1e6, 0.0, -1e6])) + library()["windup"]()
    with pytest.raises(PosesError, match="cannot stand where it was commanded to"):
        fit(beyond, problem, noise=NOISE)


def test_parallel_links_are_said_to_be_a_direct_singularity():
    """Base and platform of one radius: the tool moves sideways while all sliders stand (DESIGN 3)."""
    spec = MACHINE.machine.model_copy(update={"base_radius_mm": MACHINE.machine.platform_radius_mm})
    drawing = replace(MACHINE, machine=spec)
    place = np.random.default_rng(1).uniform(-40.0, 40.0, (40, 3))
    for frame in ("fitted", "trusted"):
        drawing = replace(drawing, tracker=drawing.tracker.model_copy(update={"frame": frame}))
        with pytest.raises(PosesError, match=r"row 2 and 39 more: .* direct singularity .* base_radius_mm") as told:
            build_problem(drawing, make_table(place, measured=place))
        assert told.value.exit_code == 3 and "far off" not in str(told.value)


def test_columns_without_bound_do_not_drown_those_beside_them():
    """Curves on a few heights of a small circle have values of metres for a while as a search strays."""
    columns = np.random.default_rng(0).normal(size=(50, 6))
    gram, prior = columns.T @ columns, np.array([1e60, 1e60, 1e40, 1.0, 1.0, 1.0])
    system = SimpleNamespace(sums_of=lambda columns, memory: SimpleNamespace(gram=gram))
    state = SimpleNamespace(columns=np.arange(6), memory=WHITE, posterior=SimpleNamespace(prior_variance=prior))
    ways = _signal_basis(system, state)
    np.testing.assert_allclose((ways @ ways.T).diagonal()[3:], 1.0, rtol=1e-3)  # what the weak ones may be stays
    assert np.linalg.eigvalsh(np.eye(ways.shape[1]) + ways.T @ gram @ ways).min() > 0.9
