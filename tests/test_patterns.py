"""Combinations of parameters that no run can see, said of the machine as it stands."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from made_runs import KNOWN, empty_run, machine, measure

from ptt.effects.bench import sample_machine
from ptt.fitting.observability import unobservable
from ptt.fitting.patterns import patterns
from ptt.fitting.solve import fit
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table


@pytest.mark.parametrize("azimuths", [(0.0, 120.0, 240.0), (90.0, 210.0, 330.0), (20.0, 130.0, 265.0)])
def test_towers_lean_together_along_the_axes_of_the_base(azimuths: tuple[float, float, float]) -> None:
    file = machine()
    drawing = file.machine.model_copy(update={"slider_azimuth_deg": azimuths})
    model = Model(replace(file, machine=drawing)) + KNOWN["tower-tilt"]()
    table = empty_run(60)
    fitted = fit(model, build_problem(model.file, measure(table, model.file, [])))
    own = np.flatnonzero(fitted.layout.owner == 0)
    out = np.stack([np.cos(np.radians(azimuths)), np.sin(np.radians(azimuths))], axis=1)
    leans = {item.words: item.vector[own] for item in patterns(fitted.layout, 0, own, model) if "lean" in item.words}
    for axis, way in enumerate("xy"):
        radial, tangential = leans[f"common lean of all legs along {way}"].reshape(2, 3, 1)
        along = radial * out + tangential * np.stack([-out[:, 1], out[:, 0]], axis=1)
        np.testing.assert_allclose(along, np.tile(np.eye(2)[axis] / np.sqrt(3.0), (3, 1)), atol=1e-12)


def arm_run(file: MachineFile) -> Problem:
    draws = np.random.default_rng(0)
    q = draws.uniform(-1.0, 1.0, (40, len(file.machine.joint)))
    place = build_mechanism(file.machine).forward(torch.as_tensor(q)).numpy()
    return build_problem(file, make_table(place, q).replace(measured=place + draws.normal(0.0, 0.01, place.shape)))


def test_an_arm_of_three_joints_is_no_tripod() -> None:
    file = sample_machine("serial", 3)
    model = Model(file) + KNOWN["homing-offset"]()
    fitted = fit(model, arm_run(file))
    own = np.flatnonzero(fitted.layout.owner == 0)
    joint = [item.words for item in patterns(fitted.layout, 0, own, model)][len(own) :]
    assert joint == ["offset of all joints together"]


def test_weights_are_of_the_values_by_their_names_within_the_effect() -> None:
    file = sample_machine("serial", 3)
    found = unobservable(fit(Model(file) + KNOWN["dh-offsets"](), arm_run(file)))
    assert any(item.what.startswith("a combination of") for item in found)
    for item in found:
        assert not any(name.startswith(item.effect) for name in item.weights)
        assert np.linalg.norm(list(item.weights.values())) == pytest.approx(1.0)
