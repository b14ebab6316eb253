"""Reversal compensation held against a play operator that is written out."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from test_backlash import play

from ptt.run.direction import travel_direction

walks = st.lists(st.sampled_from([-2.5, -0.3, -0.01, 0.0, 0.02, 0.4, 3.0]), min_size=1, max_size=40)


@given(st.lists(walks, min_size=1, max_size=4), st.floats(0.0, 0.3))
def test_play_of_the_compensated_commands_is_the_command(runs, gap):
    paths = [np.cumsum(steps) for steps in runs]
    starts = np.cumsum([0] + [len(path) for path in paths[:-1]])
    q = np.concatenate(paths)[:, None]
    sent = q + 0.5 * gap * travel_direction(q, starts)
    for start, path in zip(starts, paths, strict=True):
        moves = np.diff(path)[np.abs(np.diff(path)) > 1e-6]
        came_from = path[0] - (np.sign(moves[0]) if len(moves) else 1.0)
        reached = play(sent[start : start + len(path), 0], gap, came_from)
        np.testing.assert_allclose(reached, path, rtol=0.0, atol=1e-12)


def test_play_without_compensation_misses_by_half_the_gap():
    q = np.array([0.0, 1.0, 2.0, 1.0, 0.0])
    np.testing.assert_allclose(play(q, 0.04, -1.0) - q, [-0.02, -0.02, -0.02, 0.02, 0.02], atol=1e-15)


@given(walks, st.floats(0.0, 0.3))
def test_compensated_commands_travel_the_same_way(steps, gap):
    q = np.cumsum(steps)[:, None]
    direction = travel_direction(q)
    np.testing.assert_array_equal(travel_direction(q + 0.5 * gap * direction), direction)


def loop_direction(q, starts, tolerance=1e-6):
    """Direction of arrival of one joint, row by row."""
    result = np.ones(len(q), dtype=int)
    bounds = [*starts, len(q)]
    for begin, end in pairwise(bounds):
        last, known, waiting = np.nan, 0, []
        for row in range(begin, end):
            move = q[row] - last
            if abs(move) > tolerance:
                known = 1 if move > 0 else -1
                result[waiting] = known
                waiting = []
            if known == 0:
                waiting.append(row)
            else:
                result[row] = known
            last = last if np.isnan(q[row]) else q[row]
    return result


@given(st.integers(0, 10_000))
@settings(max_examples=60)
def test_direction_in_one_pass_equals_row_by_row(seed):
    random = np.random.default_rng(seed)
    q = np.cumsum(random.choice([-1.0, 0.0, 0.0, 1.0], size=(50, 3)), axis=0)
    q[random.random(50) < 0.1] = np.nan
    starts = np.unique([0, *random.integers(1, 50, 4)])
    expected = np.stack([loop_direction(q[:, k], starts) for k in range(3)], axis=1)
    np.testing.assert_array_equal(travel_direction(q, starts), expected)
    mask = np.zeros(50, dtype=bool)
    mask[starts] = True
    np.testing.assert_array_equal(travel_direction(q, mask), expected)


def test_first_row_standstill_and_a_joint_that_never_moves():
    q = np.array([[5.0, 1.0], [5.0, 1.0], [4.0, 1.0], [4.0, 1.0], [6.0, 1.0]])
    np.testing.assert_array_equal(travel_direction(q)[:, 0], [-1, -1, -1, -1, 1])
    np.testing.assert_array_equal(travel_direction(q)[:, 1], 1)
    np.testing.assert_array_equal(travel_direction(q, [3])[:, 0], [-1, -1, -1, 1, 1])
    assert travel_direction(np.zeros((0, 3))).shape == (0, 3)
