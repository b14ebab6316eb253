"""Two commands that print two errors of one run say why; what is left out is named by the lines of the file."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

import ptt
from ptt.door.diagnosing import format_diagnosis
from ptt.mechanisms import build_mechanism
from ptt.run.named import named_rows
from ptt.run.table import concat_tables, make_table, take_rows
from ptt.run.written import write_table

REFLECTORS = np.array([[380.0, 140, -220], [-390, 180, -210], [-120, -410, -230], [260, 330, 420]])
BENCH = """[machine]
kind = "three-ptt"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_travel_mm = [150.0, 420.0]
screw_lead_mm = 5.0

[tracker]
frame = "measured"
sigma_mm = 0.003
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A slider that stands 0.4 mm off, seen from a tracker whose place four reflectors tell; two broken beams."""
    place, random = tmp_path_factory.mktemp("figures"), np.random.default_rng(4)
    points = [f'[[tracker.base_point]]\\nname = "base {i}"\\nxyz_mm = {list(at)}\\nsigma_mm = 0.002\\n'
              for i, at in enumerate(REFLECTORS.tolist())]  # fmt: skip
    (place / "machine.toml").write_text(BENCH + "".join(points).replace("\\n", "\n"))
    model = ptt.load(place / "machine.toml")
    target = random.uniform(-50.0, 50.0, (64, 3))
    mechanism = build_mechanism(model.file.machine)
    command = mechanism.inverse(torch.as_tensor(target))
    reached = mechanism.forward(command + torch.tensor([0.4, 0.0, 0.0], dtype=torch.float64)).numpy()
    read = np.concatenate([REFLECTORS, reached]) + random.normal(0.0, 0.002, (68, 3))
    read[[20, 41]] += [[0.0, 3.0, 0.0], [-2.0, 0.0, 0.0]]
    blank = np.full((4, 3), np.nan)
    run = make_table(
        np.concatenate([blank, target]), np.concatenate([blank, command.numpy()]), read,
        role=np.array(["base"] * 4 + ["pose"] * 64), name=np.array([*(f"base {i}" for i in range(4)), *[""] * 64]),
    )  # fmt: skip
    write_table(run, place / "run.csv")
    rows = ptt.read(place / "run.csv", model)
    return ptt.compare(model, rows), ptt.diagnose(model, rows)


def test_a_frame_that_reflectors_hold_elsewhere_is_said_with_the_error_that_they_leave(found):
    compared, diagnosed = found
    said = re.search(r"In the frame of the base reflectors, which .* use, .* is ([\d.]+) um", diagnosed.words)
    assert said is not None
    held, free = compared.to_dict()["rms_um"]["total"], diagnosed.to_dict()["rms_um"]["before"]["total"]
    assert float(said[1]) == pytest.approx(held, abs=0.06)
    assert held > 1.2 * free  # else there was nothing to say
    assert "`ptt add` refits\nat each step" in str(diagnosed)


def test_gross_errors_are_named_by_their_lines(found):
    assert re.search(r"run\.csv lines 22 and 43(;|$)", str(found[1]))  # behind them, what else was left aside
    assert "2 left out as gross errors: " in str(found[1])


def test_rows_that_were_paired_with_the_readings_of_others_are_left_out(tmp_path):
    """Eight readings were paired with the row behind their own; all else says what it says without that."""
    folder = Path(__file__).parents[1] / "data" / "sealed_one"
    model, frame = ptt.load(folder / "machine.toml"), pd.read_csv(folder / "run.csv")
    read = ["x_meas", "y_meas", "z_meas"]
    frame.loc[100:107, read] = np.roll(frame.loc[100:107, read].to_numpy(), 1, axis=0)
    frame.to_csv(tmp_path / "run.csv", index=False)
    found = ptt.diagnose(model, ptt.read(tmp_path / "run.csv", model))
    assert "lines 102 to 109 come one after another" in str(found)
    assert (found.result.verdict, found.result.suggested) == ("missing", (("backlash",),))
    assert "one after another" not in str(ptt.diagnose(model, ptt.read(folder / "run.csv", model)))


def test_rows_that_are_left_out_one_after_another_are_no_scatter(found):
    result, problem = found[1].result, found[1].opened.problem
    apart, beside = (np.isin(np.arange(68), rows) for rows in ([10, 12, 14, 16, 18], [10, 11, 12, 13, 14]))
    assert "lines 12 to 16 come one after another" in format_diagnosis(replace(result, outliers=beside), problem)
    assert "one after another" not in format_diagnosis(replace(result, outliers=apart), problem)


def test_rows_are_named_by_file_and_no_more_than_a_handful():
    table = make_table(np.zeros((9, 3)), measured=np.zeros((9, 3))).replace(source="a.csv")
    assert named_rows(table, np.zeros(9, dtype=bool)) == ""
    assert named_rows(table, np.array([4])) == "a.csv line 6"
    assert named_rows(table, np.arange(9)) == "a.csv lines 2, 3, 4, 5, 6 and 4 more"
    both = concat_tables([take_rows(table, np.arange(5)), take_rows(table, np.arange(5, 9)).replace(source="b.csv")])
    assert named_rows(both, np.array([1, 3, 8])) == "a.csv lines 3 and 5; b.csv line 10"
