"""A run diagnosed in chunks says what the same run says as a whole."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from chunked_run import FILE, MODEL, ROWS, run_of
from chunked_run import problem as problem

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.effect_atoms import straight_sizes
from ptt.diagnosis.long import LONG_STRETCH_ROWS, diagnose_long
from ptt.effects import library
from ptt.fitting.chunks import sample_stretches, take
from ptt.mechanisms import build_mechanism
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

ROW = 2180  # of what happens at once


def test_the_diagnosis_is_that_of_the_whole(problem: Problem) -> None:
    whole = diagnose(MODEL, problem)
    parts = diagnose_long(MODEL, problem, size=900, sample_rows=1200)
    assert parts.verdict == whole.verdict == "missing"
    assert [step[0] for step in parts.suggested] == [step[0] for step in whole.suggested]
    assert {"backlash", "once-per-rev", "screw-growth"} == {step[0] for step in parts.suggested}
    assert parts.rows == whole.rows == ROWS - 3  # two gross ones, and the one that opens the run
    assert np.flatnonzero(parts.outliers).tolist() == np.flatnonzero(whole.outliers).tolist() == [777, 2100]
    assert np.flatnonzero(parts.to_dict()["outlier_rows"]).size == 2
    for mine, other in zip(parts.candidates, whole.candidates[: len(parts.suggested)], strict=False):
        assert mine.effect == other.effect
        assert mine.heldout_after == pytest.approx(other.heldout_after, rel=0.02)
        assert mine.heldout_before == pytest.approx(other.heldout_before, rel=0.02)
        for a, b in zip(mine.parameters, other.parameters, strict=True):
            assert a[:2] == b[:2]
            assert a[2] == pytest.approx(b[2], abs=0.3 * (b[3] or 0.0), rel=1e-6)
            assert (a[3] is None) == (b[3] is None) and (a[3] or 0.0) == pytest.approx(b[3] or 0.0, rel=0.1)
    assert set(parts.to_dict()) == set(whole.to_dict())
    assert "in chunks of 900" in parts.words
    for key in ("before", "after"):
        for axis in ("x", "y", "z", "total"):
            assert parts.rms_um[key][axis] == pytest.approx(whole.rms_um[key][axis], rel=0.01)


@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("setup-jump", {"tracker": {"knock_row": ROW, "knock_um": [30.0, -20.0, 10.0]}}),
        pytest.param("homing-slip", {"drive": {"slip_row": ROW, "slip_mm": [0.0, 0.04, 0.0]}}, marks=pytest.mark.long),
    ],
)
def test_what_happens_between_the_stretches_is_found_to_the_row(
    tmp_path: Path, name: str, faults: dict[str, Any]
) -> None:
    problem = run_of(tmp_path, **faults)
    assert not any(
        first - 60 <= ROW < last + 60 for first, last in sample_stretches(problem, 1000, LONG_STRETCH_ROWS["three-ptt"])
    )
    found = diagnose_long(MODEL, problem, size=1000, sample_rows=1000)
    assert [step[0] for step in found.suggested] == [name]
    assert found.verdict == "missing"
    clock, after = problem.view.time.numpy(), found.candidates[0].parameters[-1][2]
    assert clock[ROW - 2] <= after <= clock[ROW]


def test_nothing_is_missing_from_a_sound_run(tmp_path: Path) -> None:
    found = diagnose_long(MODEL, run_of(tmp_path), size=1000, sample_rows=1200)
    assert found.verdict == "nothing-missing" and not found.suggested
    assert found.rows == ROWS - 1


def test_a_map_of_a_part_of_the_travel_leaves_what_its_fit_leaves() -> None:
    """Its straight part, which counts in larger units there, is written back as it was found."""
    machine, draws = build_mechanism(FILE.machine), np.random.default_rng(0)
    target = draws.uniform(-20.0, 20.0, (400, 3))
    q = machine.inverse(torch.as_tensor(target))
    place = (q[:, 1] - q[:, 1].mean()) / 30.0
    q[:, 1] += 0.15 * place + 0.03 * place.square()
    measured = machine.forward(q).numpy() + draws.normal(0.0, 0.004, target.shape)
    problem = build_problem(FILE, make_table(target).replace(measured=measured))
    model = MODEL + library()["screw-error-map"]()
    assert straight_sizes(model.terms[0].effect, problem).max() > 5.0
    found = diagnose_long(model, problem, size=100)
    assert np.square(found.fitted.residual).mean() < (1.05 * 0.004) ** 2


@pytest.mark.long
def test_what_only_all_rows_show_is_found(tmp_path: Path) -> None:
    problem = run_of(tmp_path, drive={"backlash_mm": [0.0003, 0.0003, 0.0003]})
    assert not diagnose(MODEL, take(problem, sample_stretches(problem, 400, LONG_STRETCH_ROWS["three-ptt"]))).suggested
    found = diagnose_long(MODEL, problem, size=1000, sample_rows=400)
    assert [step[0] for step in found.suggested] == ["backlash"]


@pytest.mark.long
def test_physics_that_no_effect_describes_stays_unknown(tmp_path: Path) -> None:
    def bend(frame: pd.DataFrame) -> None:
        frame["z_meas"] += 0.02 * np.sin(frame["x_cmd"] / 12.0)

    found = diagnose_long(MODEL, run_of(tmp_path, bend), size=1000, sample_rows=1600)
    assert found.verdict == "unknown" and found.depends_on
    assert found.depends_on[0].residual == "z"
    assert found.depends_on[0].on == "x"


@pytest.mark.long
def test_what_only_a_few_stretches_of_the_run_have_is_not_missed(tmp_path: Path) -> None:
    first, last = 2300, 2900

    def pull(frame: pd.DataFrame) -> None:
        frame.loc[first:last, "z_meas"] += 0.03 * np.sin(np.linspace(0.0, np.pi, last - first + 1))

    problem = run_of(tmp_path, pull)
    kept = sample_stretches(problem, 800, LONG_STRETCH_ROWS["three-ptt"])
    assert not any(start < last and stop > first for start, stop in kept if stop - start > 50)
    found = diagnose_long(MODEL, problem, size=1000, sample_rows=800)
    assert found.verdict == "unknown"
    assert any("over all rows the remaining error depends on time" in reason for reason in found.rest.reasons)


def test_stretches_cover_both_ends_and_every_range(problem: Problem) -> None:
    kept = sample_stretches(problem, 1200)
    rows = np.concatenate([np.arange(*stretch) for stretch in kept])
    q = problem.view.q.numpy()
    assert rows[0] == 0 and rows[-1] == ROWS - 1 and len(rows) < 1400
    assert (np.diff(rows) > 0).all()
    np.testing.assert_array_equal(q[rows].min(axis=0), q.min(axis=0))
    np.testing.assert_array_equal(q[rows].max(axis=0), q.max(axis=0))
