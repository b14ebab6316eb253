"""A run diagnosed in chunks says what the same run says as a whole."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from ptt.chunks import cut, sample_stretches
from ptt.diagnosis.design import BLOCKS, build_design, present_candidates
from ptt.diagnosis.long import diagnose_long
from ptt.diagnosis.summed import at_all_rows, sum_up
from ptt.diagnosis.verdict import diagnose
from ptt.effects import library
from ptt.fit.solve import fit
from ptt.holdout import blocks
from ptt.machine import load_machine
from ptt.model import Model
from ptt.noise import Noise
from ptt.problem import Problem, build_problem
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import draw_machine
from ptt.rig.targets import make_volume
from ptt.table import read_table

FILE = load_machine("data/sealed_one/machine.toml")
MODEL = Model(FILE)
ROWS = 6000


def _run(folder: Path, change: Any = None, **faults: Any) -> Problem:
    drawing = FILE.machine.model_dump(mode="json", exclude_none=True)
    conditions = {"dwell_s": 4.0, "room": {"start_c": 20.0, "rise_k": 6.0, "time_constant_s": 8000.0}, "cycles": 4}
    rig = replace(parse_rig({"machine": drawing, "seed": 4, "conditions": conditions, **faults}), machine=FILE)
    frame = simulate(rig, make_volume(draw_machine(rig.spec), ROWS // 4, 3)).frame
    if change is not None:
        change(frame)
    write_run(frame, folder / "run.csv")
    return build_problem(FILE, read_table(folder / "run.csv"))


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    def spoil(frame: pd.DataFrame) -> None:
        frame.loc[[777, 4100], "x_meas"] += 2.0

    return _run(
        tmp_path_factory.mktemp("run"),
        spoil,
        drive={"backlash_mm": [0.04, 0.05, 0.03], "turn_um": [6.0, 5.0, 7.0]},
        thermal={"growth_um_per_m_k": 11.5, "fixed_end_mm": 450.0},
    )


@pytest.mark.parametrize("size", [6000, 700])
def test_sums_over_chunks_are_those_of_the_whole(problem: Problem, size: int) -> None:
    noise = problem.noise or Noise(np.eye(3) * 2.5e-5, "machine file")
    known = library()
    model = MODEL + known["backlash"]() + known["windup"]()
    fitted = fit(model, problem, noise=noise, robust=False, coarse=True)
    candidates, _ = present_candidates(fitted, problem, known)
    shapes = {effect.key: list(effect.search(problem.view))[:4] for effect in candidates}
    whole = build_design(fitted, problem, candidates, noise, shapes=shapes, sift=False)
    block = blocks(problem.table, BLOCKS)
    for chunks in (cut(problem, size), cut(problem, size)[::-1]):
        summed = sum_up(problem, chunks, fitted, candidates, shapes, noise, block, sift=False)
        scale = np.sqrt(np.einsum("ii->i", whole.sums.gram.sum(axis=0)))
        scale = np.maximum(scale, 1e-6 * scale.max())
        gram, side = summed.sums.gram - whole.sums.gram, summed.sums.side - whole.sums.side
        assert np.abs(gram / np.outer(scale, scale)).max() < 1e-10
        assert np.abs(side / scale).max() < 1e-10 * np.sqrt(whole.sums.square.sum())
        np.testing.assert_allclose(summed.sums.square, whole.sums.square, rtol=1e-10)
        np.testing.assert_array_equal(summed.sums.count, whole.sums.count)
        assert summed.held_out_rms(summed.base) == pytest.approx(whole.held_out_rms(whole.base), rel=0.01)
    everywhere = at_all_rows(fitted, cut(problem, size), problem.used)
    np.testing.assert_allclose(everywhere.residual, fitted.residual, atol=1e-10)


def test_the_diagnosis_is_that_of_the_whole(problem: Problem) -> None:
    whole = diagnose(MODEL, problem)
    parts = diagnose_long(MODEL, problem, size=900, sample_rows=2500)
    assert parts.verdict == whole.verdict == "missing"
    assert [step[0] for step in parts.suggested] == [step[0] for step in whole.suggested]
    assert {"backlash", "once-per-rev", "screw-growth"} == set(parts.path.added)
    assert parts.rows == whole.rows == ROWS - 2
    assert np.flatnonzero(parts.outliers).tolist() == np.flatnonzero(whole.outliers).tolist() == [777, 4100]
    for mine, other in zip(parts.candidates, whole.candidates[: len(parts.path.added)], strict=False):
        assert mine.heldout_after == pytest.approx(other.heldout_after, rel=0.02)
        for a, b in zip(mine.parameters, other.parameters, strict=True):
            assert a[:2] == b[:2]
            assert a[2] == pytest.approx(b[2], abs=0.3 * (b[3] or 0.0), rel=1e-6)
    assert set(parts.to_dict()) == set(whole.to_dict())
    assert "in chunks of 900" in parts.words
    for key in ("before", "after"):
        assert parts.rms_um[key]["total"] == pytest.approx(whole.rms_um[key]["total"], rel=0.01)


def test_a_knock_between_the_stretches_is_found_to_the_row(tmp_path: Path) -> None:
    problem = _run(tmp_path, tracker={"knock_row": 3333, "knock_um": [30.0, -20.0, 10.0]})
    kept = sample_stretches(problem, 2000)
    assert not any(first <= 3333 < last for first, last in kept)
    found = diagnose_long(MODEL, problem, size=1000, sample_rows=2000)
    assert found.path.added == ("setup-jump",)
    after = found.candidates[0].parameters[-1][2]
    clock = problem.view.time.numpy()
    assert clock[3331] <= after <= clock[3333]


def test_nothing_is_missing_from_a_sound_run(tmp_path: Path) -> None:
    found = diagnose_long(MODEL, _run(tmp_path), size=1000, sample_rows=2000)
    assert found.verdict == "nothing-missing" and not found.path.added
    assert found.rows == ROWS


def test_what_only_a_few_stretches_of_the_run_have_is_not_missed(tmp_path: Path) -> None:
    def pull(frame: pd.DataFrame) -> None:
        frame.loc[4000:4600, "z_meas"] += 0.03 * np.sin(np.linspace(0.0, np.pi, 601))

    problem = _run(tmp_path, pull)
    assert not any(first < 4600 and last > 4000 for first, last in sample_stretches(problem, 1200) if last - first > 50)
    found = diagnose_long(MODEL, problem, size=1000, sample_rows=1200)
    assert found.verdict == "unknown"
    assert any("over all rows the rest follows time" in reason for reason in found.rest.reasons)


def test_stretches_cover_both_ends_and_every_range(problem: Problem) -> None:
    kept = sample_stretches(problem, 1600)
    rows = np.concatenate([np.arange(*stretch) for stretch in kept])
    q = problem.view.q.numpy()
    assert rows[0] == 0 and rows[-1] == ROWS - 1 and len(rows) < 2000
    assert (np.diff(rows) > 0).all()
    np.testing.assert_array_equal(q[rows].min(axis=0), q.min(axis=0))
    np.testing.assert_array_equal(q[rows].max(axis=0), q.max(axis=0))
