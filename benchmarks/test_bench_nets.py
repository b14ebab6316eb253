"""Speed of the RBF network: 160 points beside scikit-learn and scipy, and the full choice on 1,260 rows.

Peers get the same points, the same width and nearly no regularisation. The error on 2,000 unseen points is kept in
`extra_info` as `unseen_rms_um`. Nothing is asserted about absolute times.
"""

import math

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from sklearn.kernel_ridge import KernelRidge

from nets import fit_rbf, train_rbf
from nets.widths import width_of_spread

SPREAD = 4.0  # standard deviations of the inputs


def surface(p):
    x, y, z = p.T / 50
    return np.stack(
        [0.8 * np.sin(x + z / 2) + 0.3 * x * y, np.cos(y - z) / 2 + x * x / 5, 0.4 * z * z + 0.3 * x * z], 1
    )


def volume(rows, seed):
    return np.random.default_rng(seed).uniform(-60, 60, size=(rows, 3))


SEEN, UNSEEN = volume(160, 0), 0.9 * volume(2000, 1)
MEAN, SCALE = SEEN.mean(axis=0), SEEN.std(axis=0)


def record(benchmark, predict):
    error = np.sqrt(np.mean(np.square(predict(UNSEEN) - surface(UNSEEN))))
    benchmark.extra_info["unseen_rms_um"] = round(1e3 * float(error), 3)
    assert error < 0.1 * surface(UNSEEN).std()


@pytest.mark.benchmark(group="fit 160 points")
@pytest.mark.parametrize("centres", [64, 160])
def test_fit_gaussian_rbf(benchmark, centres):
    network = benchmark(fit_rbf, SEEN, surface(SEEN), centres=centres, spread=SPREAD, ridge=1e-12)
    record(benchmark, network.predict)


@pytest.mark.benchmark(group="fit 160 points")
def test_fit_kernel_ridge(benchmark):
    gamma = 1 / (2 * width_of_spread(SPREAD) ** 2)

    def fit():
        return KernelRidge(kernel="rbf", gamma=gamma, alpha=160e-12).fit((SEEN - MEAN) / SCALE, surface(SEEN))

    model = benchmark(fit)
    record(benchmark, lambda p: model.predict((p - MEAN) / SCALE))


@pytest.mark.benchmark(group="fit 160 points")
@pytest.mark.parametrize("kernel", ["gaussian", "thin_plate_spline"])
def test_fit_rbf_interpolator(benchmark, kernel):
    # scipy writes the node as exp(-(epsilon d)^2).
    epsilon = 1 / (math.sqrt(2) * width_of_spread(SPREAD))

    def fit():
        return RBFInterpolator((SEEN - MEAN) / SCALE, surface(SEEN), kernel=kernel, epsilon=epsilon, smoothing=1e-12)

    model = benchmark(fit)
    record(benchmark, lambda p: model((p - MEAN) / SCALE))


@pytest.mark.benchmark(group="choose and fit")
@pytest.mark.parametrize("rows", [160, 1260])
def test_train_over_the_whole_grid(benchmark, rows):
    p = volume(rows, 2)
    training = benchmark.pedantic(train_rbf, args=(p, surface(p), np.arange(rows)), rounds=3)
    benchmark.extra_info["chosen"] = str(training.chosen)
    record(benchmark, training.network.predict)


@pytest.mark.benchmark(group="100,000 queries")
@pytest.mark.parametrize("verb", ["predict", "inside"])
def test_query_the_network(benchmark, verb):
    p = volume(1260, 2)
    network = fit_rbf(p, surface(p), centres=128, spread=SPREAD, ridge=1e-12)
    queries = volume(100_000, 3)
    answer = benchmark(getattr(network, verb), queries)
    assert len(answer) == 100_000
