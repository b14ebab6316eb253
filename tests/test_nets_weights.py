"""Weights: closed-form ridge and gradient descent."""

import numpy as np
import pytest

from nets.design import build_design
from nets.weights import descend_gradient, normal_equations, products, ridge_path, shrinkage

RIDGES = np.array([1e-6, 1e-3, 1e-1])


def problem(affine=False, rows=60, nodes=9):
    rng = np.random.default_rng(2)
    scaled, outputs = rng.normal(size=(rows, 3)), rng.normal(size=(rows, 2)) + 5.0
    return build_design(scaled, outputs, rng.normal(size=(nodes, 3)), np.full(nodes, 1.5), affine=affine), scaled


def equations_of(design):
    return normal_equations(products(design.background, design.features, design.outputs))


@pytest.mark.parametrize("affine", [False, True])
def test_ridge_equals_the_augmented_least_squares(affine):
    design, _ = problem(affine)
    columns = np.hstack([design.background, design.features])
    for ridge, weights in zip(RIDGES, ridge_path(equations_of(design), RIDGES), strict=True):
        h, q = design.background.shape[1], design.features.shape[1]
        penalty = np.sqrt(ridge * len(columns)) * np.eye(h + q)[h:]
        target = np.vstack([design.outputs, np.zeros((q, 2))])
        expected = np.linalg.lstsq(np.vstack([columns, penalty]), target, rcond=None)[0]
        np.testing.assert_allclose(weights, expected[h:], rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(equations_of(design).background(weights), expected[:h], atol=1e-9)


def test_holding_rows_out_equals_leaving_them_away():
    design, _ = problem(affine=True)
    whole = products(design.background, design.features, design.outputs)
    part = products(design.background[:20], design.features[:20], design.outputs[:20])
    rest = products(design.background[20:], design.features[20:], design.outputs[20:])
    left = ridge_path(normal_equations(whole - part), RIDGES)
    np.testing.assert_allclose(left, ridge_path(normal_equations(rest), RIDGES), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose((part + rest).matrix, whole.matrix, atol=1e-9)


@pytest.mark.parametrize("rate", [0.2, 1.0])
def test_gradient_descent_reaches_the_ridge_solution_and_the_error_falls(rate):
    equations = equations_of(problem()[0])
    ridge = np.array([1e-2, 1e-1])
    weights, curve = descend_gradient(equations, ridge, rate=rate, epochs=6000)
    path = ridge_path(equations, ridge)
    np.testing.assert_allclose(weights, np.stack([path[0, :, 0], path[1, :, 1]], axis=1), rtol=1e-8)
    assert curve.shape == (6001, 2)
    assert np.all(np.diff(curve, axis=0) <= 1e-13 * curve[0])
    assert np.all(curve[20] < curve[0])
    np.testing.assert_allclose(curve[0], equations.energy / equations.rows)


def test_the_curve_is_the_mean_squared_error():
    design, _ = problem()
    weights, curve = descend_gradient(equations_of(design), np.array([1e-3, 1e-3]), rate=0.7, epochs=50)
    equations = equations_of(design)
    error = design.outputs - design.features @ weights - design.background @ equations.background(weights)
    np.testing.assert_allclose(curve[-1], np.mean(np.square(error), axis=0), rtol=1e-12)


@pytest.mark.parametrize("epochs", [1, 7, 300])
def test_unfinished_descent_is_known_in_closed_form(epochs):
    equations = equations_of(problem()[0])
    walked, _ = descend_gradient(equations, np.array([1e-4, 1e-4]), rate=0.6, epochs=epochs)
    (known,) = ridge_path(equations, np.array([1e-4]), rate=0.6, steps=epochs)
    np.testing.assert_allclose(walked, known, rtol=1e-9, atol=1e-12)


def test_shrinkage_of_a_finished_descent_is_the_ridge():
    eigenvalues, penalty = np.array([0.5, 1.0, 4.0]), np.array([0.1, 1.0])
    finished = shrinkage(eigenvalues, penalty, 1.0, 10_000)
    np.testing.assert_allclose(finished, 1 / (eigenvalues + penalty[:, None]))
    assert np.all(shrinkage(eigenvalues, penalty, 1.0, 2) < finished + 1e-15)


def test_no_nodes_leave_the_background_alone():
    rng = np.random.default_rng(0)
    scaled = rng.normal(size=(30, 2))
    outputs = 3.0 + scaled @ np.array([[1.0], [-2.0]])
    design = build_design(scaled, outputs, np.empty((0, 2)), np.empty(0), affine=True)
    weights = ridge_path(equations_of(design), RIDGES)[0]
    threshold, slope = design.threshold_and_slope(equations_of(design).background(weights), weights)
    np.testing.assert_allclose(threshold, [-3.0])
    np.testing.assert_allclose(slope, [[1.0], [-2.0]])


def test_a_constant_input_gets_no_slope():
    scaled = np.column_stack([np.linspace(-1, 1, 20), np.zeros(20)])
    design = build_design(scaled, scaled[:, :1] * 2, np.empty((0, 2)), np.empty(0), affine=True)
    weights = np.zeros((0, 1))
    _, slope = design.threshold_and_slope(equations_of(design).background(weights), weights)
    np.testing.assert_allclose(slope, [[2.0], [0.0]], atol=1e-12)
