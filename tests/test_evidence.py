"""Prior variances learned at the most evidence: against brute force on the marginal likelihood of the readings."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import optimize, stats

from ptt.fitting.evidence import LOG_SIZE_STD, maximise, profile_noise
from ptt.fitting.posterior import Posterior

ROWS = 40
FREE = 1e3  # wide enough, and readings' own covariance can still be inverted to many digits


def problem(seed: int, sizes: list[float], each: int = 3, frame: int = 2, rows: int = ROWS) -> tuple:
    """Columns, readings and owners: some free columns, then groups whose values have these sizes."""
    random = np.random.default_rng(seed)
    owner = np.concatenate([np.full(frame, -1), np.repeat(np.arange(len(sizes)), each)])
    columns = random.normal(size=(rows, len(owner))) * np.exp(random.normal(size=len(owner)))
    truth = random.normal(size=len(owner)) * np.append(sizes, 3.0)[owner]
    return columns, columns @ truth + random.normal(size=rows), owner


def solve(columns: np.ndarray, values: np.ndarray, owner: np.ndarray, **options: object) -> Posterior:
    options = {"freedom": 12.0, "ungrouped_variance": FREE, **options}
    return maximise(columns.T @ columns, columns.T @ values, float(values @ values), len(values), owner, **options)


def marginal(
    logs: np.ndarray, columns: np.ndarray, values: np.ndarray, owner: np.ndarray, freedom: float, width: float
) -> float:
    """Log density of the readings themselves, the unknowns and the noise integrated out, and the variances' prior.

    The noise variance has a scaled inverse chi-squared prior, so the readings have Student's distribution; its
    constants, which depend on no scale, are left out.
    """
    prior = np.append(np.exp(logs), FREE)[owner]
    spread = np.eye(len(values)) + (columns * prior) @ columns.T
    distance = values @ np.linalg.solve(spread, values)
    known = freedom + len(values)
    tail = 0.5 * (len(values) - distance) if np.isinf(freedom) else -0.5 * known * np.log((freedom + distance) / known)
    return float(tail - 0.5 * np.linalg.slogdet(spread)[1] - 0.125 * ((logs / width) ** 2).sum())


def brute(columns: np.ndarray, values: np.ndarray, owner: np.ndarray, freedom: float, width: float) -> float:
    groups = owner.max() + 1
    starts = np.stack(np.meshgrid(*[[-4.0, 0.0, 5.0]] * groups), axis=-1).reshape(-1, groups)

    def wanted(logs: np.ndarray) -> float:
        return -marginal(logs, columns, values, owner, freedom, width)

    inside = [(-9.0, 13.0)] * groups
    return max(-optimize.minimize(wanted, start, method="Nelder-Mead", bounds=inside, tol=1e-6).fun for start in starts)


@pytest.mark.parametrize("freedom", [3.0, 60.0, np.inf])
@pytest.mark.parametrize("sizes", [[1.0, 30.0], [0.01, 2.0], [0.0, 100.0]])
@pytest.mark.parametrize("seed", range(3))
def test_no_scales_are_more_probable(seed: int, sizes: list[float], freedom: float) -> None:
    columns, values, owner = problem(seed, sizes)
    found = solve(columns, values, owner, freedom=freedom)
    assert found.total == pytest.approx(
        marginal(np.log(found.group_variances), columns, values, owner, freedom, LOG_SIZE_STD), abs=1e-5
    )
    assert found.total > brute(columns, values, owner, freedom, LOG_SIZE_STD) - 5e-3


def test_large_unknowns_are_released_and_absent_ones_held() -> None:
    columns, values, owner = problem(5, [100.0, 0.0], each=6, rows=60)
    found = solve(columns, values, owner)
    free = np.linalg.lstsq(columns, values, rcond=None)[0]
    large, absent = owner == 0, owner == 1
    assert found.group_variances[0] > 1e3 and found.group_variances[1] < 0.3
    np.testing.assert_allclose(found.values[large], free[large], atol=0.2)
    assert np.abs(found.values[absent]).max() < np.abs(free[absent]).max()


def test_what_the_data_do_not_see_keeps_its_prior_and_stays_at_zero() -> None:
    columns, values, _ = problem(1, [1.0])
    columns = np.column_stack([columns, columns[:, 0]])  # the same as a free column
    found = solve(columns, values, np.array([-1, -1, 0, 0, 0, 1]))
    assert abs(found.values[-1]) < 1e-4
    assert found.covariance[-1, -1] == pytest.approx(found.phi * found.group_variances[1], rel=1e-3)
    assert found.group_variances[1] == pytest.approx(1.0, abs=0.1)  # nothing but its own prior speaks of it


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.floats(0.0, 50.0), min_size=1, max_size=4), st.floats(0.5, 200.0))
@example(1367, [0.0, 0.0, 18.0, 0.0], 1.0)
@example(3862, [25.0, 12.5, 0.0, 16.5], 60.0)  # asked for 1e-9 nats it ends 4e-8 below the top
def test_the_slope_vanishes_and_the_curvature_is_the_numerical_one(
    seed: int, sizes: list[float], freedom: float
) -> None:
    columns, values, owner = problem(seed, sizes)
    ended = solve(columns, values, owner, freedom=freedom, tolerance=1e-12)
    found = solve(
        columns, values, owner, freedom=freedom, start=ended.group_variances
    )  # its curvature is the one where it is
    assert found.evaluations == 1
    logs, step = np.log(found.group_variances), 1e-2  # shorter ones drown in the rounding of a covariance of 1e8

    def at(change: np.ndarray) -> float:
        return marginal(logs + change, columns, values, owner, freedom, LOG_SIZE_STD)

    eye = step * np.eye(len(logs))
    slope = np.array([at(way) - at(-way) for way in eye]) / (2 * step)
    np.testing.assert_allclose(slope, 0.0, atol=2e-4)
    second = [[at(a + b) - at(a - b) - at(b - a) + at(-a - b) for a in eye] for b in eye]
    np.testing.assert_allclose(found.curvature, -np.array(second) / (4 * step**2), atol=2e-3)


def test_order_of_the_unknowns_does_not_matter() -> None:
    columns, values, owner = problem(3, [1.0, 20.0, 0.1])
    order = np.random.default_rng(0).permutation(len(owner))
    one, other = solve(columns, values, owner), solve(columns[:, order], values, owner[order])
    np.testing.assert_allclose(other.values, one.values[order], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(other.covariance, one.covariance[np.ix_(order, order)], rtol=1e-7, atol=1e-12)
    for found, own in ((one, columns), (other, columns[:, order])):
        whole = (own.T @ own + np.diag(1.0 / found.prior_variance))[np.ix_(found.order, found.order)]
        np.testing.assert_allclose(found.cholesky @ found.cholesky.T, whole, rtol=1e-9, atol=1e-8)
        np.testing.assert_array_equal(found.cholesky, np.tril(found.cholesky))


def test_a_good_start_saves_steps_and_changes_nothing() -> None:
    columns, values, owner = problem(4, [0.3, 200.0])
    cold = solve(columns, values, owner)
    warm = solve(columns, values, owner, start=cold.group_variances)
    assert warm.evaluations == 1 < cold.evaluations
    assert warm.total == pytest.approx(cold.total, abs=1e-2)


def test_bounds_hold_and_a_fixed_group_is_not_learned() -> None:
    columns, values, owner = problem(2, [50.0, 0.0, 5.0])
    found = solve(columns, values, owner, floor=np.array([1e-2, 0.5, 1.0]), ceiling=np.array([9.0, 100.0, 1.0]))
    assert found.group_variances[0] == pytest.approx(9.0)
    assert found.group_variances[1] == pytest.approx(0.5)
    assert found.group_variances[2] == 1.0


def test_without_a_prior_an_absent_group_vanishes() -> None:
    columns, values, owner = problem(2, [0.0])
    values = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    assert solve(columns, values, owner, log_size_std=np.inf).group_variances[0] < 1e-4


def test_rounding_of_strong_columns_does_no_harm() -> None:
    columns, values, owner = problem(6, [1.0, 1.0])
    strong = np.array([1e7, 1e7, 1e-3, *[1.0] * 5])
    columns = np.column_stack([columns, columns[:, 0] + columns[:, 1]]) * np.append(strong, 1e6)
    owner = np.append(owner, -1)
    found = solve(columns, values, owner)
    assert np.isfinite(found.total) and found.evaluations < 30
    left = values - columns @ found.values
    assert found.penalised_square == pytest.approx(
        left @ left + found.values**2 @ (1.0 / found.prior_variance), rel=1e-6
    )


def test_only_free_columns_are_least_squares() -> None:
    columns, values, owner = problem(7, [])
    found = solve(columns, values, owner, freedom=0.0)
    expected = np.linalg.lstsq(columns, values, rcond=None)
    np.testing.assert_allclose(found.values, expected[0], rtol=1e-2)
    assert found.phi == pytest.approx(expected[1][0] / ROWS, rel=1e-2)
    assert found.group_variances.shape == (0,) and found.curvature.shape == (0, 0)


def test_no_noise_is_finer_than_the_last_digit_of_a_reading() -> None:
    """Where it would be, it is known, and rows count by chi-squared alone: half of what they miss by more."""
    phi, tail = profile_noise(np.array([5.0, 9.0, 200.0]), 30.0, 10.0, 1.0)
    np.testing.assert_allclose(phi, [1.0, 1.0, 210.0 / 40.0])
    assert tail[0] - tail[1] == pytest.approx((9.0 - 5.0) / 2.0)
    columns, values, owner = problem(3, [1.0])
    assert solve(columns, values, owner, freedom=0.0).phi < 2.0 == solve(columns, values, owner, least_phi=2.0).phi


def test_stated_scatter_is_what_repeated_problems_scatter_by() -> None:
    random, pulls = np.random.default_rng(11), []
    for seed in range(150):
        sizes = np.exp(random.normal(0.0, LOG_SIZE_STD, 2))
        columns, _, owner = problem(seed, [1.0, 1.0], each=6, rows=60)
        truth = random.normal(size=len(owner)) * np.append(sizes, 3.0)[owner]
        found = solve(columns, columns @ truth + random.normal(size=60), owner, freedom=30.0)
        pulls.append((found.values - truth) / np.sqrt(np.diag(found.covariance)))
    within = np.mean(np.abs(np.concatenate(pulls)) < 2.0)
    assert stats.binom.sf(150 * 14 * (1 - within), 150 * 14, 0.09) > 1e-4 and within > 0.92


@pytest.mark.parametrize("done", [0.05, 1e-3])
def test_no_more_is_still_to_be_had_than_was_asked_for(done: float) -> None:
    random = np.random.default_rng(5)
    for seed in range(40):
        columns, values, owner = problem(seed, list(np.exp(random.normal(0.0, 2.5, 3))))
        start = np.exp(random.normal(0.0, 1.0, 3))
        exact, found = (solve(columns, values, owner, start=start, tolerance=each) for each in (1e-9, done))
        assert found.total > exact.total - 2.0 * done
        assert found.evaluations <= exact.evaluations


def test_what_ends_before_the_total_that_was_asked_for_would_not_have_reached_it() -> None:
    random, ended, spared = np.random.default_rng(6), 0, 0
    for seed in range(150):
        columns, values, owner = problem(seed, list(np.exp(random.normal(0.0, 2.5, 3))))
        start = np.exp(random.normal(0.0, 2.0, 3))
        whole = solve(columns, values, owner, start=start)
        least = whole.total + random.uniform(-3.0, 3.0)
        found = solve(columns, values, owner, start=start, least_total=least)
        ended, spared = ended + found.stopped_early, spared + whole.evaluations - found.evaluations
        assert whole.total < least if found.stopped_early else found.total == whole.total
    assert ended > 40 and spared > ended / 2


def test_evidence_of_unknowns_that_are_zero_is_that_of_a_problem_without_them() -> None:
    random = np.random.default_rng(3)
    rows, values = random.normal(size=(40, 6)), random.normal(size=40)
    group, held = np.array([-1, 0, 1, 0, 1, 0]), np.array([2.0, 0.3])

    def known(chosen: np.ndarray) -> Posterior:
        some = rows[:, chosen]
        return maximise(
            some.T @ some, some.T @ values, float(values @ values), 40.0, group[chosen],
            freedom=np.inf, start=held, floor=held, ceiling=held,
        )  # fmt: skip

    gained = known(np.array([0, 1, 2, 5])).total - known(np.arange(6)).total
    np.testing.assert_allclose(known(np.arange(6)).savage_dickey(np.array([3, 4])), gained, rtol=1e-9)
