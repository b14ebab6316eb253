"""Speed of a fit beside scipy's finite differences on the same residual: both in one run, the ratio counts."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy import optimize
from scipy.spatial.transform import Rotation

from ptt.effects import library
from ptt.effects.bench import sample_machine
from ptt.effects.layout import flatten, linear_size
from ptt.fitting.layout import lay_out
from ptt.fitting.linear import usual_sizes
from ptt.fitting.observability import unobservable
from ptt.fitting.search import open_terms
from ptt.fitting.solve import fit
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem, apply_frames, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

SIGMA = 0.003
GEOMETRY = ("homing-offset", "tower-position", "tower-tilt", "link-length")  # with the frame 24 free parameters
EVERYTHING = tuple(
    name for name, effect in library().items() if name != "tracker-frame" and "three-ptt" in effect.mechanisms
)


def hidden(names: tuple[str, ...], rows: int) -> tuple[Model, Problem]:
    """A run with effects of about their usual sizes, 5 % gross errors, and the bare effects to be fitted."""
    random = np.random.default_rng(1)
    file = sample_machine("three-ptt")
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA}))
    table = make_table(
        random.uniform(-60.0, 60.0, (rows, 3)),
        payload_kg=random.choice([0.0, 5.0], rows),
        temp_c=20.0 + random.uniform(0.0, 8.0, rows),
        time_s=10.0 * np.arange(rows),
        feed_mm_s=random.choice([5.0, 20.0, 40.0], rows),
    )
    view, model, shifts = build_view(file, table), Model(file), []
    plain = build_problem(file, replace(table, measured=table.target))
    for name in names:
        effect = library()[name]()
        trials = effect.search(view) or ({"length": torch.tensor([2.0], dtype=torch.float64)},)
        theta = flatten(effect, trials[len(trials) // 2], 3)
        count = linear_size(effect, 3)
        theta[:count] = torch.as_tensor(usual_sizes(effect, plain) * random.uniform(0.2, 1.0, count))
        model, shifts = model + effect, [*shifts, (effect, theta)]
    reading = predict(shifts, view).reading.numpy() @ Rotation.from_rotvec([0.3, 2.0, 1.0]).as_matrix().T
    reading += random.normal(0.0, SIGMA, reading.shape)
    reading[random.random(rows) < 0.05] += 1.0
    return model, build_problem(file, replace(table, measured=reading))


def by_scipy(model: Model, problem: Problem) -> optimize.OptimizeResult:
    """The same weighted residual and start, Jacobian by two-point differences, Cauchy loss against gross errors."""
    noise = problem.noise
    assert isinstance(noise, Noise)
    layout = lay_out(model, problem, open_terms(model.terms, problem, noise))
    rows = problem.used

    def residual(unknowns: np.ndarray) -> np.ndarray:
        terms = [(item.effect, theta) for item, theta in zip(layout.terms, layout.thetas(unknowns), strict=True)]
        moved, _ = apply_frames(predict(terms, problem.view).reading, problem.frame, layout.frame_parameters(unknowns))
        return ((problem.measured - moved.numpy())[rows] @ noise.whitener.T).ravel()

    start = np.clip(layout.start(), layout.lower + 1e-9, layout.upper - 1e-9)
    bounds = (layout.lower, layout.upper)
    return optimize.least_squares(residual, start, bounds=bounds, loss="cauchy", max_nfev=12)


@pytest.fixture(scope="module", params=[(GEOMETRY, 100), (EVERYTHING, 1260)], ids=["100x24", "1260xall"])
def case(request: pytest.FixtureRequest) -> tuple[Model, Problem]:
    return hidden(*request.param)


@pytest.mark.benchmark(group="fit")
def test_fit(benchmark: object, case: tuple[Model, Problem]) -> None:
    result = benchmark.pedantic(fit, args=case, rounds=5, warmup_rounds=1)
    assert result.status == "converged" and result.chi2 / result.freedom < 1.4


@pytest.mark.benchmark(group="fit")
def test_scipy_two_point(benchmark: object, case: tuple[Model, Problem]) -> None:
    rounds = 3 if len(case[1].table.line) < 500 else 1
    result = benchmark.pedantic(by_scipy, args=case, rounds=rounds)
    assert np.isfinite(result.cost)


@pytest.mark.benchmark(group="words")
def test_unobservable_combinations(benchmark: object, case: tuple[Model, Problem]) -> None:
    result = fit(*case)
    told = benchmark.pedantic(unobservable, args=(result,), rounds=2)
    assert len(told) == result.unseen.shape[1]
