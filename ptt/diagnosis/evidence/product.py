"""Values that are none, or an effect's first value times an unknown place: what that says beside the linear prior."""

import numpy as np

# Values of the first parameter that are integrated over, and standard errors to either side
GRID_POINTS, GRID_ERRORS = 161, 8.0


def nats_of_product(values: np.ndarray, covariance: np.ndarray, width: float) -> float:
    """Log evidence with the further values first x N(0, 1) each, less that with N(0, width) each, both as columns.

    Args:
        values: of an effect in usual sizes, the first one and those that it makes, (m,).
        covariance: of their posterior, (m, m).
        width: variance of the prior that the posterior was found with.

    Returns:
        Nats; zero where the readings say nothing of the further values.
    """
    first, spread = values[0], np.sqrt(covariance[0, 0])
    slope = covariance[1:, 0] / covariance[0, 0]
    given = covariance[1:, 1:] - np.outer(slope, covariance[0, 1:])  # shape: (m - 1, m - 1)
    variance, ways = np.linalg.eigh(given)
    precision = 1.0 / np.clip(variance, 1e-300, width)  # a posterior is no wider than its prior
    step = np.linspace(-GRID_ERRORS, GRID_ERRORS, GRID_POINTS)
    mean = (values[1:] + np.outer(spread * step, slope)) @ ways  # shape: (grid, m - 1)
    wide = np.square(first + spread * step)[:, None] + 1e-12
    after = precision - 1.0 / width + 1.0 / wide
    logs = 0.5 * (np.log(width / wide) + np.log(precision / after) - mean**2 * precision * (1.0 - precision / after))
    whole = logs.sum(axis=1) - 0.5 * step**2
    top = whole.max()
    return float(top + np.log(np.exp(whole - top).sum() * (step[1] - step[0]) / np.sqrt(2.0 * np.pi)))


def nats_of_none(values: np.ndarray, covariance: np.ndarray, width: float) -> float:
    """Log evidence with none of the further values, less that with them; arguments as in `nats_of_product`.

    Source: Dickey, The Annals of Mathematical Statistics 42, 1971: the posterior's density there over the prior's.
    """
    variance, ways = np.linalg.eigh(covariance[1:, 1:])
    variance = np.clip(variance, 1e-300, width)
    return float(0.5 * (np.log(width / variance) - np.square(values[1:] @ ways) / variance).sum())
