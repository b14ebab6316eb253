"""What a run says of its machine: a score is that of its rows, whatever the fit held beside them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from test_diagnosis import MACHINE

from ptt.effects import library
from ptt.fitting.solve import fit
from ptt.fleet.told import told_by
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

SIGMA = 0.05  # mm


def test_a_score_is_what_the_rows_pull_with_and_not_what_a_curve_is_defined_without() -> None:
    """The slope of a curve is held near zero: half the fall of the rows' sum of squares along it is its score."""
    random, mechanism = np.random.default_rng(4), build_mechanism(MACHINE.machine)
    file = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "trusted", "sigma_mm": SIGMA}))
    targets = random.uniform(-60.0, 60.0, (60, 3))
    command = mechanism.inverse(torch.as_tensor(targets)).numpy()
    off = 0.03 * np.sin((command - 270.0) / 40.0) + 2e-3 * (command - 270.0) * [1.0, 0.0, 0.0]
    reached = mechanism.forward(torch.as_tensor(command + off)).numpy()
    problem = build_problem(file, make_table(targets, command, measured=reached + random.normal(0.0, SIGMA, (60, 3))))
    model = Model(file)
    for name in ("homing-offset", "lead-scale", "screw-error-map"):
        model = model + library()[name]()
    found = fit(model, problem, robust=False)
    said = told_by(found)

    def squares(moved: int, place: int, size: float) -> float:
        """Of all rows, in units of noise, with nothing but one value of one effect; the range of a curve is given."""
        shifts = []
        for number, term in enumerate(found.model.terms):
            theta = torch.zeros_like(term.theta)
            if term.effect.name == "screw-error-map":
                theta[-6:] = term.theta[-6:]
            if number == moved:
                theta[place] = size
            shifts.append((term.effect, theta))
        reading = predict(shifts, problem.view).reading.numpy()
        return float(np.square((problem.measured - reading) / SIGMA).sum())

    wider = max(1.0, found.chi2 / found.freedom)
    name = "screw-error-map straight_mm 1.1"
    index = said.names.index(name)
    usual, place = said.usual[index], 45  # behind 15 heights of each screw
    pull = (squares(2, place, usual) - squares(2, place, -usual)) / -4.0 / wider
    assert said.score[index] == pytest.approx(pull, rel=1e-3)
    assert abs(said.values[index] / usual) > 5e-3 * pull  # so much would be off if what holds it were counted


def test_the_error_of_a_value_that_is_measured_in_combinations_only_is_that_of_the_value_itself() -> None:
    """The frame takes up what three offsets have in common: a third of each may be as large as is usual."""
    random, mechanism = np.random.default_rng(5), build_mechanism(MACHINE.machine)
    file = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "fitted", "sigma_mm": 1e-3}))
    targets = random.uniform(-60.0, 60.0, (60, 3))
    command = mechanism.inverse(torch.as_tensor(targets)).numpy()
    problem = build_problem(file, make_table(targets, command, measured=targets + random.normal(0.0, 1e-3, (60, 3))))
    model = Model(file)
    for name in ("homing-offset", "lead-scale"):
        model = model + library()[name]()
    said = told_by(fit(model, problem, robust=False))
    offsets = np.array(["homing-offset" in name for name in said.names])
    np.testing.assert_allclose(said.std[offsets] / said.usual[offsets], np.sqrt(1.0 / 3.0), rtol=0.02)
