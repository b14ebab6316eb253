"""What a first user meets: an arm checked alone, a table that was sorted, a law of two variables written down."""

from pathlib import Path

import numpy as np
import pytest

from ptt.challenge.challenge import bench
from ptt.commands.main import run
from ptt.effects.prefilled import prefilled
from ptt.run.table import make_table
from ptt.setup.order import find_disorder
from ptt.setup.setup import Setup

ARM = Path(__file__).resolve().parents[1] / "data" / "machines" / "ur10.toml"


def test_an_arm_s_file_alone_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", str(ARM)]) == 0
    assert "6 joints" in capsys.readouterr().out


@pytest.mark.parametrize(("sort", "timed", "said"), [(True, False, 1), (False, False, 0), (True, True, 0)])
def test_rows_sorted_by_a_coordinate_are_said_where_no_clock_tells(sort: bool, timed: bool, said: int) -> None:
    target = np.random.default_rng(3).uniform(-50.0, 50.0, (80, 3))
    target = target[np.argsort(target[:, 0])] if sort else target
    table = make_table(target, measured=target, time_s=np.arange(80.0) if timed else None)
    findings, _ = find_disorder(Setup(bench(), table))
    assert [(item.mistake, item.sure) for item in findings] == [("row-order", False)] * said


def test_rows_sorted_by_their_readings_are_said_with_names_that_may_tell_the_order() -> None:
    random = np.random.default_rng(4)
    target = random.uniform(-50.0, 50.0, (80, 3))
    reading = target + random.normal(0.0, 0.1, target.shape)
    order = np.argsort(reading[:, 0])
    assert (np.diff(target[order, 0]) < 0.0).any()
    names = np.array([f"p{number}" for number in order])
    for named, hint in ((names, True), (np.full(80, ""), False)):
        table = make_table(target[order], measured=reading[order], name=named)
        (only,) = find_disorder(Setup(bench(), table))[0]
        assert only.mistake == "row-order" and ("by the numbers in their names" in only.fix) == hint


def test_a_line_that_rises_is_no_sorted_table() -> None:
    target = np.linspace(-40.0, 40.0, 60)[:, None] * np.array([1.0, 0.5, -0.3])
    assert find_disorder(Setup(bench(), make_table(target, measured=target)))[0] == []


def test_a_side_that_loses_more_at_one_end_is_written_with_both_variables() -> None:
    found = {
        "residual": "slider 2", "on": "direction2", "shape": "smooth", "with": None, "acts_on": "slider 2",
        "curve": {"at": [-1.0, 1.0]}, "size": {"kind": "varying", "along": "b2", "low": 420.0, "high": 346.0},
    }  # fmt: skip
    text = prefilled("my-stick", [found]).text
    assert 'on, shape = "direction2", "varying"' in text and 'along = "b2"' in text and "(346, 420)" in text
