"""Centres, widths and scaling of the hidden nodes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nets.centres import farthest_points, inertia, kmeans_centres
from nets.scaling import input_scaling
from nets.widths import nearest_widths, shared_widths, width_of_spread

POINTS = arrays(
    np.float64, st.tuples(st.integers(1, 40), st.integers(1, 4)), elements=st.integers(-8, 8).map(lambda k: k / 4)
)


@settings(max_examples=60, deadline=None)
@given(points=POINTS, count=st.integers(1, 12), seed=st.integers(0, 1000))
def test_centres_are_distinct_inside_the_box_and_as_many_as_asked(points, count, seed):
    centres = kmeans_centres(points, count, seed=seed)
    distinct = np.unique(points, axis=0)
    assert centres.shape == (min(count, len(distinct)), points.shape[1])
    assert len(np.unique(centres, axis=0)) == len(centres)
    assert np.all(centres >= points.min(axis=0) - 1e-12)
    assert np.all(centres <= points.max(axis=0) + 1e-12)
    np.testing.assert_array_equal(centres, kmeans_centres(points, count, seed=seed))


@settings(max_examples=40, deadline=None)
@given(points=POINTS, visits=st.integers(2, 7), order=st.randoms(use_true_random=False))
def test_visits_and_row_order_do_not_move_the_centres(points, visits, order):
    repeated = np.repeat(points, visits, axis=0)
    rows = list(range(len(repeated)))
    order.shuffle(rows)
    np.testing.assert_array_equal(kmeans_centres(points, 5), kmeans_centres(repeated[rows], 5))


def test_separate_clusters_are_all_found():
    rng = np.random.default_rng(3)
    true = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0], [10.0, 10.0, 10.0]])
    points = np.concatenate([each + 0.1 * rng.normal(size=(40, 3)) for each in true])
    centres = kmeans_centres(points, 5, seed=1)
    nearest = np.linalg.norm(true[:, None] - centres[None], axis=2).min(axis=1)
    assert nearest.max() < 0.1


def test_more_restarts_never_raise_the_inertia():
    points = np.random.default_rng(0).normal(size=(300, 3))
    once = inertia(points, kmeans_centres(points, 20, seed=5, restarts=1))
    often = inertia(points, kmeans_centres(points, 20, seed=5, restarts=8))
    assert often <= once * (1 + 1e-12)
    assert often < 0.7 * inertia(points, points[:20])


def test_many_points_are_sampled_but_still_covered():
    points = np.random.default_rng(0).uniform(size=(20_000, 2))
    centres = kmeans_centres(points, 16)
    assert centres.shape == (16, 2)
    assert inertia(points, centres) / len(points) < 2 * (1 / 6) / 16  # a square grid has (1/6) / 16


def test_farthest_points_take_the_corners_of_a_square():
    square = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.5]])
    np.testing.assert_array_equal(np.unique(farthest_points(square, 5), axis=0), np.unique(square, axis=0))
    np.testing.assert_array_equal(farthest_points(square, 1), [[0.5, 0.5]])


def test_a_node_is_one_half_at_the_spread():
    width = width_of_spread(3.8)
    assert math.exp(-(3.8**2) / (2 * width**2)) == pytest.approx(0.5, abs=1e-15)
    distance = 1.7
    newrb = math.exp(-((math.sqrt(math.log(2)) * distance / 3.8) ** 2))
    assert math.exp(-(distance**2) / (2 * width**2)) == pytest.approx(newrb, rel=1e-14)
    np.testing.assert_array_equal(shared_widths(np.zeros((4, 2)), 3.8), np.full(4, width))


@settings(max_examples=40, deadline=None)
@given(points=POINTS, factor=st.floats(0.1, 10), scale=st.floats(0.1, 10))
def test_nearest_widths_scale_with_the_centres(points, factor, scale):
    centres = np.unique(points, axis=0)
    widths = nearest_widths(centres, factor)
    assert widths.shape == (len(centres),)
    assert np.all(widths > 0)
    if len(centres) > 1:
        np.testing.assert_allclose(nearest_widths(scale * centres, factor), scale * widths, rtol=1e-12)
        np.testing.assert_allclose(nearest_widths(centres, 2 * factor), 2 * widths, rtol=1e-12)


def test_nearest_widths_follow_the_spacing():
    centres = np.array([[0.0], [1.0], [2.0], [10.0], [14.0]])
    expected = np.sqrt([(1 + 4) / 2, 1.0, (1 + 4) / 2, (16 + 64) / 2, (16 + 144) / 2])
    np.testing.assert_allclose(nearest_widths(centres, 1.0, neighbours=2), expected)
    np.testing.assert_allclose(nearest_widths(centres, 1.0, neighbours=1), [1.0, 1.0, 1.0, 4.0, 4.0])


def test_scaling_standardises_and_keeps_constant_inputs_finite():
    rng = np.random.default_rng(0)
    inputs = np.column_stack([rng.normal(5, 40, 200), np.full(200, 7.3), rng.normal(0, 2, 200)])
    mean, scale = input_scaling(inputs)
    scaled = (inputs - mean) / scale
    np.testing.assert_allclose(scaled[:, [0, 2]].std(axis=0), 1.0)
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=1e-12)
    assert scale[1] == scale[0]  # a constant input is scaled like the widest one
    np.testing.assert_array_equal(input_scaling(np.ones((3, 2)))[1], [1.0, 1.0])
