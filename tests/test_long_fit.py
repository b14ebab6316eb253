"""A long run is fitted by sums over chunks: the same fit and held-out errors, no work that grows as rows squared."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ptt.dependence.where import where_it_fails
from ptt.effects.registry import library, make_effect
from ptt.fitting import long, solve
from ptt.fitting.long import LongEvaluator
from ptt.fitting.whitened import Evaluator
from ptt.judge.ladder import climb as ladder
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table

MACHINE = Path(__file__).resolve().parents[1] / "data" / "sealed_one" / "machine.toml"
ROWS = 1600


@pytest.fixture(scope="module")
def problem(tmp_path_factory) -> Problem:
    """A virtual machine with backlash that warms up, a dozen gross errors in its readings."""
    file = load_machine(MACHINE)
    drawing = file.machine.model_dump(mode="json", exclude_none=True)
    faults = {"drive": {"backlash_mm": [0.04, 0.05, 0.03]}, "thermal": {"growth_um_per_m_k": 11.5, "fixed_end_mm": 450}}
    conditions = {"dwell_s": 1.0, "room": {"start_c": 20.0, "rise_k": 6.0, "time_constant_s": 2000.0}}
    rig = replace(parse_rig({"machine": drawing, "seed": 5, "conditions": conditions, **faults}), machine=file)
    path = tmp_path_factory.mktemp("run") / "long.csv"
    write_run(simulate(rig, make_volume(ideal_machine(rig.spec), ROWS, 3)).frame, path)
    table = read_table(path)
    table.measured[np.random.default_rng(1).choice(ROWS, 12, replace=False)] += 0.8
    return build_problem(file, table)


@pytest.fixture
def short(monkeypatch):
    """What counts as long, made small."""
    monkeypatch.setattr(solve, "LONG", 900)
    monkeypatch.setattr(solve, "SAMPLE_ROWS", 400)
    monkeypatch.setattr(ladder, "LONG", 900)
    monkeypatch.setattr(long, "CHUNK", 230)
    monkeypatch.setattr(LongEvaluator.__init__, "__kwdefaults__", {"size": 230})


def effects():
    return [make_effect(library(), name) for name in ("backlash", "screw-growth")]


def model(problem) -> Model:
    return Model(problem.file) + effects()[0] + effects()[1]


def test_sums_over_chunks_are_those_of_the_whole(problem):
    fitted = solve.fit(model(problem), problem)
    whole = Evaluator(fitted.layout, problem, fitted.noise)(fitted.unknowns)
    parts = LongEvaluator(fitted.layout, problem, fitted.noise, size=230)(fitted.unknowns)
    np.testing.assert_allclose(parts.residual, whole.residual, atol=1e-9, rtol=0)
    for one, other in zip(parts.sums(problem.used), whole.sums(problem.used), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-6 * np.abs(other).max())


def test_a_long_run_has_the_fit_of_a_short_one_gross_errors_included(problem, short, monkeypatch):
    chunked = solve.fit(model(problem), problem)
    monkeypatch.setattr(solve, "LONG", 10**9)
    whole = solve.fit(model(problem), problem)
    np.testing.assert_array_equal(chunked.outliers, whole.outliers)
    assert chunked.outliers.sum() == 12
    assert np.abs((chunked.values - whole.values) / whole.std).max() < 0.02
    np.testing.assert_allclose(chunked.std, whole.std, rtol=1e-3)
    np.testing.assert_allclose(chunked.prediction.reading, whole.prediction.reading, atol=1e-5)


def test_held_out_errors_of_a_long_run_are_those_of_fits_that_did_not_see_the_rows(problem, short, monkeypatch):
    chunked = ladder.climb(Model(problem.file), problem, effects())
    monkeypatch.setattr(solve, "LONG", 10**9)
    monkeypatch.setattr(ladder, "LONG", 10**9)
    whole = ladder.climb(Model(problem.file), problem, effects())
    for one, other in zip(chunked.steps, whole.steps, strict=True):
        assert one.heldout_rms_um["total"] == pytest.approx(other.heldout_rms_um["total"], rel=2e-3)
        assert one.rms_um["total"] == pytest.approx(other.rms_um["total"], rel=1e-3)
    # Hidden rows are judged by fits without them: seen rows always look better.
    assert chunked.steps[-1].heldout_rms_um["total"] > chunked.steps[-1].rms_um["total"]


def test_where_it_fails_asks_for_all_targets_as_often_for_few_rows_as_for_many(problem, monkeypatch):
    asked = []
    target = Problem.target.fget
    monkeypatch.setattr(Problem, "target", property(lambda self: asked.append(1) or target(self)))
    where_it_fails(problem, np.random.default_rng(0).normal(size=(ROWS, 3)))
    assert len(asked) <= 5
