"""Rows far off: single ones are gross errors, rows in a row are another reflector, a knock or the machine."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_runs import empty_run, machine, measure
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.fitting.outliers import MOST_EXCEPTIONS, inside
from ptt.fitting.report import report_fit
from ptt.fitting.solve import residual_of
from ptt.fitting.stretches import confirmed_by_pose
from ptt.judge.compare.comparison import compare_run
from ptt.judge.compare.text import format_comparison
from ptt.model.model import Model
from ptt.run.holdout import pose_groups
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table

SEALED = Path(__file__).resolve().parents[1] / "data" / "sealed_three"
NAMES = ("backlash", "axis-compliance", "frame-growth")


def bare(table: Table, **tracker: object) -> tuple[Problem, Model]:
    file = machine(**tracker)
    return build_problem(file, table), Model(file)


def run_of(rows: int = 200, **columns: object) -> Table:
    file, table = machine(), replace(empty_run(rows), **columns)
    return measure(table, file, [])


def moved(table: Table, rows: object, shift: object) -> Table:
    reading = table.measured.copy()
    reading[rows] += np.asarray(shift)
    return replace(table, measured=reading)


def command(*words: object) -> dict:
    done = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("repeats", [pytest.param(True, marks=pytest.mark.long), False])
def test_thirty_rows_on_another_reflector_are_shown_as_a_block_and_spoil_nothing(repeats: bool, tmp_path: Path) -> None:
    frame = pd.read_csv(SEALED / "run.csv")
    if not repeats:
        frame = (
            frame.drop(columns="repeat")
            .drop_duplicates(["x_cmd", "y_cmd", "z_cmd", "payload_kg"])
            .reset_index(drop=True)
        )
    frame.to_csv(tmp_path / "sound.csv", index=False)
    frame.loc[120:149, ["x_meas", "y_meas", "z_meas"]] += [3.0, -1.0, 4.0]
    frame.to_csv(tmp_path / "block.csv", index=False)
    told = [
        command(
            "add",
            tmp_path / name,
            *NAMES,
            "--model",
            SEALED / "machine.toml",
            "--out",
            tmp_path / "out.toml",
            "--anyway",
        )
        for name in ("sound.csv", "block.csv")
    ]
    assert told[0]["stretches"] == []
    (block,) = told[1]["stretches"]
    assert (block["lines"], block["rows"]) == ([122, 151], 30)
    assert [block["shift_um"][axis] for axis in "xyz"] == pytest.approx([3000, -1000, 4000], abs=60)
    assert "lines 122 to 151 (30 readings in a row)" in block["words"] and "reflector" in block["words"]
    assert told[1]["fit"]["outliers"] == told[0]["fit"]["outliers"]
    assert told[1]["noise_um"]["total"] == pytest.approx(told[0]["noise_um"]["total"], rel=0.15)
    for one, other in zip(told[0]["steps"], told[1]["steps"], strict=True):
        assert other["heldout_rms_um"]["total"] == pytest.approx(one["heldout_rms_um"]["total"], rel=0.2)


def test_compare_shows_the_block_first_and_leaves_it_out() -> None:
    problem, model = bare(moved(run_of(), slice(60, 90), [0.0, 2.0, 0.0]))
    result = compare_run(model, problem)
    (block,) = result.stretches
    assert block.lines == (62, 91) and result.outliers == () and result.rows == 170
    assert format_comparison(result).splitlines()[2].startswith("lines 62 to 91 (30 readings in a row) are off by")
    assert result.to_dict()["rms_um"]["total"] < 10.0


def test_a_stretch_that_only_its_payload_sets_apart_is_the_machine() -> None:
    """Sixty rows under a load, the others without: a bend, not another reflector."""
    load = np.where((np.arange(200) >= 100) & (np.arange(200) < 140), 5.0, 0.0)
    table = run_of(payload_kg=load)
    problem, model = bare(moved(table, slice(100, 140), [1.6, 0.0, 0.0]))
    fitted = residual_of(model, problem)
    assert not fitted.outliers.any()
    elsewhere, _ = bare(moved(table, slice(30, 70), [1.6, 0.0, 0.0]))
    assert residual_of(model, elsewhere).outliers.sum() == 40


@pytest.mark.parametrize("rows", [slice(30, 50), slice(150, 200)])
def test_steps_of_a_machines_own_size_stay_in_every_figure(rows: slice) -> None:
    """A splice in a scale, a slider that slipped, a knock of a few tenths: for effects to explain."""
    problem, model = bare(moved(run_of(), rows, [0.03, 0.0, 0.3]))
    fitted = residual_of(model, problem)
    assert not fitted.outliers.any()


def test_the_ends_of_a_curve_that_the_model_lacks_are_not_gross() -> None:
    """A cubic along one axis: its largest values are few and stand alone in a random order."""
    table = run_of(300)
    across = table.target[:, 0] / 60.0
    problem, model = bare(moved(table, slice(None), 0.03 * (across**3)[:, None] * [1.0, 0.0, 0.0]))
    assert not residual_of(model, problem).outliers.any()


def test_half_a_run_is_no_exception() -> None:
    problem, model = bare(moved(run_of(), slice(110, 200), [0.0, 0.0, 3.0]))
    assert not residual_of(model, problem).outliers.any()


@pytest.mark.parametrize("share", [0.15, 0.2, 0.3])
def test_what_every_fifth_row_has_is_not_gross_and_a_broken_beam_still_is(share: float) -> None:
    random = np.random.default_rng(3)
    used, left = np.ones(300, dtype=bool), random.normal(size=(300, 3))
    many = random.random(300) < share
    left[many] += 12.0 * random.choice([-1.0, 1.0], (many.sum(), 3))  # a fault, say on rows that reversed
    broken = np.array([20, 150, 280])
    left[broken] += 400.0
    np.testing.assert_array_equal(np.flatnonzero(~inside(left, used)), broken)


def test_never_more_than_one_row_in_twelve_is_gross() -> None:
    random = np.random.default_rng(5)
    for rows in (12, 30, 100, 300):
        for share in (0.02, 0.05, 0.1, 0.4):
            left = random.normal(size=(rows, 3)) * np.where(random.random(rows) < share, 100.0, 1.0)[:, None]
            lost = rows - inside(left, np.ones(rows, dtype=bool)).sum()
            assert lost <= np.ceil(MOST_EXCEPTIONS * rows)


def test_rows_in_a_row_that_differ_are_not_gross() -> None:
    table = run_of()
    bump = 0.4 * np.sin(np.linspace(0.3, np.pi - 0.3, 7))[:, None] * [1.0, 0.0, 1.0]
    problem, model = bare(moved(moved(table, slice(50, 57), bump), [120], [0.5, 0.5, 0.5]))
    fitted = residual_of(model, problem)
    np.testing.assert_array_equal(np.flatnonzero(fitted.outliers), [120])


def test_a_knock_there_and_back_by_different_ways_is_two_stretches() -> None:
    table = moved(moved(run_of(), slice(50, 65), [2.0, 0.0, 0.0]), slice(65, 80), [0.0, 0.0, -2.0])
    problem, model = bare(table)
    report = report_fit(residual_of(model, problem), problem)
    assert [stretch.lines for stretch in report.stretches] == [(52, 66), (67, 81)] and report.outliers == ()


def test_visits_of_a_pose_that_show_the_same_place_need_not_follow_each_other() -> None:
    """A beam that breaks at the second of three visits takes nothing from what the first and the third say."""
    problem, _ = bare(run_of(90, target=np.repeat(empty_run(30).target, 3, axis=0)))
    pose, far, error = pose_groups(problem.table), np.zeros(90, dtype=bool), np.zeros((90, 3))
    far[:3] = True
    error[:3] = [[0.5, 0.0, 0.1], [-3.0, 2.0, 0.0], [0.52, 0.02, 0.1]]
    assert len(np.unique(pose[:3])) == 1 and len(np.unique(pose)) == 30
    assert confirmed_by_pose(far, error, problem).nonzero()[0].tolist() == [0, 2]
