"""The training domain."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nets import measure_domain

POINTS = arrays(np.float64, st.tuples(st.integers(1, 60), st.integers(1, 4)), elements=st.floats(-3, 3))


def ring(count=100):
    angle = np.arange(count) * 2 * np.pi / count
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)


@settings(max_examples=100, deadline=None)
@given(points=POINTS)
def test_every_training_point_is_inside_and_far_points_are_not(points):
    domain = measure_domain(points)
    assert domain.contains(points).all()
    size = np.ptp(points, axis=0).max() + 1.0
    assert not domain.contains(points + 4 * size).any()


@settings(max_examples=40, deadline=None)
@given(points=POINTS, shift=st.floats(-2, 2))
def test_the_rule_is_the_documented_one(points, shift):
    domain = measure_domain(points)
    queries = points[::-1] * 0.9 + shift
    near = np.linalg.norm(queries[:, None] - domain.points[None], axis=2).min(axis=1) <= domain.reach
    room = domain.reach / 4
    boxed = np.all((queries >= domain.low - room) & (queries <= domain.high + room), axis=1)
    np.testing.assert_array_equal(domain.contains(queries), near & boxed)


def test_the_hole_of_a_ring_is_outside_though_the_hull_holds_it():
    domain = measure_domain(ring())
    between = 0.5 * (ring() + np.roll(ring(), 1, axis=0))
    assert domain.contains(between).all()
    assert not domain.contains(np.zeros((1, 3))).any()
    assert not domain.contains(np.array([[0.5, 0.5, 0.0]])).any()


def test_a_gap_of_two_points_is_inside_and_a_long_one_is_not():
    points = ring(100)
    keep = np.ones(100, dtype=bool)
    keep[[10, 11, *range(40, 55)]] = False
    domain = measure_domain(points[keep])
    assert domain.contains(points[[10, 11]]).all()
    assert not domain.contains(points[[44, 47, 50]]).any()


def test_repeats_and_jitter_do_not_shrink_the_domain():
    rng = np.random.default_rng(0)
    once = measure_domain(ring())
    visited = np.repeat(ring(), 7, axis=0)
    jittered = measure_domain(visited + 1e-5 * rng.normal(size=visited.shape))
    assert measure_domain(visited).reach == pytest.approx(once.reach, rel=1e-12)
    assert jittered.reach == pytest.approx(once.reach, rel=0.01)


def test_a_filled_volume_holds_unseen_points_and_ends_at_its_faces():
    rng = np.random.default_rng(0)
    domain = measure_domain(rng.uniform(-1, 1, size=(1000, 3)))
    inner = rng.uniform(-0.9, 0.9, size=(5000, 3))
    assert domain.contains(inner).mean() > 0.99
    assert not domain.contains(inner + np.array([1.3, 0.0, 0.0]))[inner[:, 0] > -0.1].any()


def test_distance_is_in_units_of_the_reach():
    domain = measure_domain(np.arange(11.0)[:, None])
    assert domain.reach == pytest.approx(2.0)
    np.testing.assert_allclose(domain.distance(np.array([[3.0], [4.5], [14.0]])), [0.0, 0.25, 2.0])
    np.testing.assert_array_equal(
        domain.contains(np.array([[3.0], [10.5], [10.6], [-0.6]])), [True, True, False, False]
    )


def test_the_typical_spacing_is_what_nine_points_of_ten_have_at_most():
    """Of fifty points in a row ten lie three apart, and the others one: gaps are judged by the wider part."""
    places = np.concatenate([np.arange(40.0), 50.0 + 3.0 * np.arange(10)])[:, None]
    assert measure_domain(places).reach == pytest.approx(2 * 3.0)
    assert measure_domain(places[:42]).reach == pytest.approx(2 * 1.0)  # two of 42 are fewer than one in ten


def test_one_point_is_its_own_domain():
    domain = measure_domain(np.array([[0.3, 0.4]]))
    np.testing.assert_array_equal(domain.contains(np.array([[0.3, 0.4], [0.3, 0.41]])), [True, False])
    assert domain.contains(np.empty((0, 2))).shape == (0,)


def test_nan_is_outside():
    np.testing.assert_array_equal(
        measure_domain(ring()).contains(np.array([[np.nan, 0.0, 0.0], [1.0, 0.0, 0.0]])), [0, 1]
    )
