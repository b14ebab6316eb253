"""The linearised problem: columns against differences of the prediction, readings, base reflectors, sums."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptt.effects import Effect, Parameter, library
from ptt.effects.bench import sample_machine
from ptt.effects.layout import flatten
from ptt.errors import ModelError
from ptt.fitting.linear import Linear, assemble, linear_columns, usual_sizes
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.machine_schema import BasePoint
from ptt.model.chain import linearise, predict, trace
from ptt.model.model import Model
from ptt.run.problem import Problem, apply_frames, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

KNOWN = library()
SIGMA = 0.003


def made(policy: str = "fitted", seed: int = 3) -> tuple[Problem, FitResult]:
    """A run of a machine with a link error and a payload, and the fit of what is known of it."""
    random = np.random.default_rng(seed)
    file = sample_machine("three-ptt")
    points = tuple(
        BasePoint(name=f"base {i}", xyz_mm=tuple(place), sigma_mm=0.004)
        for i, place in enumerate(np.array([[200.0, 0, -50], [-100, 170, -40], [-90, -180, 10], [0, 0, 200.0]]))
    )
    base = points if policy == "measured" else ()
    tracker = file.tracker.model_copy(update={"sigma_mm": SIGMA, "frame": policy, "base_point": base})
    file = replace(file, tracker=tracker)
    rows = 60
    table = make_table(random.uniform(-60, 60, (rows, 3)), payload_kg=random.choice([0.0, 5.0], rows))
    effect = KNOWN["link-length"]()
    truth = torch.tensor([0.2, -0.1, 0.15], dtype=torch.float64)
    reading = predict([(effect, truth)], build_view(file, table)).reading.numpy()
    turn = np.eye(3) + 1e-3 * np.array([[0, -1, 2], [1, 0, -1], [-2, 1, 0.0]])
    measured = reading @ turn.T + [1.0, 2.0, 3.0] + random.normal(0, SIGMA, reading.shape)
    measured[7] = np.nan
    if policy == "measured":
        names, roles = np.array([p.name for p in points]), np.full(len(points), "base")
        places = np.array([p.xyz_mm for p in points]) @ turn.T + [1.0, 2.0, 3.0]
        table = replace(
            make_table(
                np.concatenate([table.target, np.zeros((4, 3))]), payload_kg=np.append(table.payload_kg, [0.0] * 4)
            ),
            name=np.concatenate([np.full(rows, ""), names]),
            role=np.concatenate([np.full(rows, "pose"), roles]),
        )
        measured = np.concatenate([measured, places + random.normal(0, 0.002, places.shape)])
    problem = build_problem(file, replace(table, measured=measured))
    return problem, fit(Model(file) + effect, problem)


def moved(
    fitted: FitResult, problem: Problem, unknowns: np.ndarray, extra: tuple[Effect, torch.Tensor] | None = None
) -> np.ndarray:
    """Whitened prediction of the readings, frames included."""
    layout = fitted.layout
    terms = [(term.effect, theta) for term, theta in zip(layout.terms, layout.thetas(unknowns), strict=True)]
    reading = predict([*terms, extra] if extra else terms, problem.view).reading
    if layout.frames:
        reading, _ = apply_frames(reading, problem.frame, layout.frame_parameters(unknowns))
    return reading.numpy() @ fitted.noise.whitener.T


CANDIDATES = ["backlash", "column-bend", "tower-position", "once-per-rev", "tracker-scale"]


def linear_of(problem: Problem, fitted: FitResult) -> Linear:
    return linear_columns(fitted, problem, [KNOWN[name]() for name in CANDIDATES], fitted.noise)


@pytest.mark.parametrize("policy", ["fitted", "trusted", "measured"])
def test_columns_are_what_the_prediction_changes_by(policy: str) -> None:
    problem, fitted = made(policy)
    linear = linear_of(problem, fitted)
    for place in range(len(fitted.unknowns)):
        step = np.zeros(len(fitted.unknowns))
        step[place] = 1e-4
        change = moved(fitted, problem, fitted.unknowns + step) - moved(fitted, problem, fitted.unknowns - step)
        np.testing.assert_allclose(linear.columns[..., place], change / 2e-4, rtol=1e-4, atol=2e-3)


def test_columns_of_candidates_are_what_they_would_add() -> None:
    problem, fitted = made()
    linear = linear_of(problem, fitted)
    before = moved(fitted, problem, fitted.unknowns)
    for trial in linear.trials[:: max(1, len(linear.trials) // 12)]:
        theta = flatten(trial.effect, trial.shape, 3)
        for number, place in enumerate(trial.columns):
            small = theta.clone()
            small[number] = 1e-3 * linear.scale[place]
            change = moved(fitted, problem, fitted.unknowns, (trial.effect, small)) - before
            np.testing.assert_allclose(linear.columns[..., place], change * 1e3, rtol=0.02, atol=0.02)


def test_present_columns_explain_the_readings_down_to_the_residual() -> None:
    problem, fitted = made()
    linear = linear_of(problem, fitted)
    own = linear.present["link-length"]
    left = linear.values - linear.columns[..., own] @ fitted.unknowns[own]
    np.testing.assert_allclose(left, linear.residual, atol=1e-9)
    expected = fitted.residual[linear.rows] @ fitted.noise.whitener.T
    np.testing.assert_allclose(linear.residual[linear.rows], expected, atol=1e-9)
    assert not linear.rows[7] and linear.rows.sum() == 59
    assert (linear.values[7] == linear.columns[7][:, own] @ fitted.unknowns[own]).all()


def test_later_columns_are_the_same_as_those_of_the_start() -> None:
    problem, fitted = made()
    linear = linear_of(problem, fitted)
    trial = linear.trials[-1]
    np.testing.assert_allclose(linear.at.columns(trial.effect, trial.shape), linear.columns[..., trial.columns])
    np.testing.assert_allclose(linear.scale[trial.columns], usual_sizes(trial.effect, problem))
    assert linear.without_rows().at is None


def test_base_reflectors_hold_the_frame_in_the_sums() -> None:
    problem, fitted = made("measured")
    linear = assemble(fitted.layout, fitted.unknowns, problem, fitted.noise)
    gram, side, _, count = linear.total()
    rows = np.concatenate([linear.columns[linear.rows], linear.base_columns]).reshape(-1, gram.shape[0])
    values = np.concatenate([linear.values[linear.rows], linear.base_values]).ravel()
    np.testing.assert_allclose(gram, rows.T @ rows, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(side, rows.T @ values, rtol=1e-9, atol=1e-6)
    assert count == len(values)
    solution = np.linalg.solve(gram, side)
    # At the fit the effects come out as they are, and the frames do not move on.
    own = linear.present["link-length"]
    np.testing.assert_allclose(solution[own], fitted.unknowns[own], atol=1e-3)
    np.testing.assert_allclose(solution[linear.frame], 0.0, atol=1e-5)


@pytest.mark.parametrize("crossed", [True, False])
def test_where_further_effects_lead_is_told_with_the_derivatives(crossed: bool) -> None:
    problem, _ = made()
    sizes = {"backlash": [0.3, 0.3, 0.3, 1.0], "link-length": [0.3, 0.3, 0.3]}
    terms = [(KNOWN[name](), torch.tensor(size, dtype=torch.float64)) for name, size in sizes.items()]
    told, alone = linearise(terms, problem.view, crossed=crossed).chain, trace(terms, problem.view)
    for one, other in zip(
        (told.by_joint, told.by_slot, told.reading, told.at_joints.q, told.at_tool.p),
        (alone.by_joint, alone.by_slot, alone.reading, alone.at_joints.q, alone.at_tool.p),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


class Divided(Effect):
    """A law of one's own that divides by the payload, which is zero in some rows."""

    name = "divided"
    parameters = (Parameter("size", "mm", 0.01, "size", count=3),)

    def basis(self, view, shape):
        return view.payload.reciprocal()[:, None, None] * torch.eye(3, dtype=torch.float64)


def test_a_candidate_that_is_no_number_at_a_row_is_refused_by_name_and_row():
    """Beside it every sum over the rows would be none, and the search would end in the middle of linear algebra."""
    problem, fitted = made()
    payload = problem.view.payload.numpy()
    first = int(np.flatnonzero((payload == 0.0) & problem.used)[0])
    with pytest.raises(ModelError, match=rf"row {problem.table.line[first]} and .* 'divided' is no finite number"):
        linear_columns(fitted, problem, [Divided()], fitted.noise)
    loaded = replace(problem, used=problem.used & (payload > 0.0))
    linear_columns(fitted, loaded, [Divided()], fitted.noise)  # rows that do not count may hold anything
