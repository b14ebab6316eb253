"""Other priors of an effect's further values than the normal one: zero, or the first value times an unknown factor."""

import numpy as np

# Values of the first parameter that are integrated over, and standard errors to either side
GRID_POINTS, GRID_ERRORS = 161, 8.0


def nats_of_product(values: np.ndarray, covariance: np.ndarray, prior_variance: float) -> float:
    """Log evidence with further values ~ N(0, first^2), less that with N(0, v), integrated over the first value.

    Args:
        values: posterior means in usual sizes, the first value and the further ones, (m,).
        covariance: of the posterior, (m, m).
        prior_variance: v, with which the posterior was found.

    Returns:
        Nats; zero where the readings say nothing of the further values.
    """
    first, std = values[0], np.sqrt(covariance[0, 0])
    slope = covariance[1:, 0] / covariance[0, 0]
    given_first = covariance[1:, 1:] - np.outer(slope, covariance[0, 1:])  # shape: (m - 1, m - 1)
    variance, axes = np.linalg.eigh(given_first)
    precision = 1.0 / np.clip(variance, 1e-300, prior_variance)  # a posterior is no wider than its prior
    step = np.linspace(-GRID_ERRORS, GRID_ERRORS, GRID_POINTS)
    mean = (values[1:] + np.outer(std * step, slope)) @ axes  # shape: (grid, m - 1)
    other = np.square(first + std * step)[:, None] + 1e-12  # prior variance of the further values at each first value
    after = precision - 1.0 / prior_variance + 1.0 / other
    logs = 0.5 * (
        np.log(prior_variance / other) + np.log(precision / after) - mean**2 * precision * (1.0 - precision / after)
    )
    whole = logs.sum(axis=1) - 0.5 * step**2
    top = whole.max()
    return float(top + np.log(np.exp(whole - top).sum() * (step[1] - step[0]) / np.sqrt(2.0 * np.pi)))


def nats_of_none(values: np.ndarray, covariance: np.ndarray, prior_variance: float) -> float:
    """Savage-Dickey ratio of the further values at zero, nats; arguments as in `nats_of_product`.

    Source: Dickey, The weighted likelihood ratio, Annals of Mathematical Statistics 42 (1971).
    """
    variance, axes = np.linalg.eigh(covariance[1:, 1:])
    variance = np.clip(variance, 1e-300, prior_variance)
    return float(0.5 * (np.log(prior_variance / variance) - np.square(values[1:] @ axes) / variance).sum())
