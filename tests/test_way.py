"""What follows the tool's own way, its turns or its feed is told as that, not as knocks nor as lost motion."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptt.dependence.contexts import moves_of
from ptt.dependence.way import REACHES, last_moves, ways_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table

FILE = load_machine(Path(__file__).resolve().parents[1] / "data" / "sealed_one" / "machine.toml")
TARGET, READING = ["x_cmd", "y_cmd", "z_cmd"], ["x_meas", "y_meas", "z_meas"]


def test_the_way_is_that_of_the_last_move() -> None:
    p = np.array([[0, 0, 0], [2, 0, 0], [2, 3, 0], [2, 3, 0], [2, 3, -1], [9, 9, 9], [9, 8, 9]], dtype=float)
    starts = np.array([True, False, False, False, False, True, False])
    came, turns = ways_of(p, starts)
    x, y, z = np.eye(3)
    np.testing.assert_allclose(came[0], [x, x, y, y, -z, -y, -y], atol=1e-12)
    np.testing.assert_allclose(turns, [0 * x, y - x, 0 * x, -z - y, 0 * x, 0 * x, 0 * x], atol=1e-12)


def test_a_pause_is_the_time_since_the_row_before_the_last_move() -> None:
    p = np.array([[0, 0, 0], [2, 0, 0], [2, 3, 0], [2, 3, 0], [9, 9, 9], [9, 9, 9], [9, 8, 9]], dtype=float)
    starts = np.array([True, False, False, False, True, False, False])
    far, since = last_moves(p, np.array([0.0, 5.0, 9.0, 30.0, 100.0, 107.0, 109.0]), starts)
    np.testing.assert_array_equal(far, [np.nan, 2.0, 3.0, 3.0, np.nan, np.nan, 1.0])
    np.testing.assert_array_equal(since, [np.nan, 5.0, 4.0, 25.0, np.nan, np.nan, 2.0])


def test_a_remembered_way_forgets_over_its_stretch() -> None:
    p = np.zeros((400, 3))
    p[:, 0] = np.abs(np.arange(400.0) - 200.0)  # there and back again
    came, _ = ways_of(p, np.arange(400) == 0)
    for remembered, reach in zip(came[1:], REACHES, strict=True):
        expected = 1.0 - 2.0 * np.exp(-np.arange(1, 200) / (200.0 * reach))
        np.testing.assert_allclose(remembered[201:, 0], expected, atol=1e-6)
        np.testing.assert_allclose(remembered[:200, 0], -1.0, atol=1e-12)


def _told(folder: Path, lacks: str) -> Diagnosis:
    """A sound machine, but for what this adds to its readings."""
    drawing = FILE.machine.model_dump(mode="json", exclude_none=True)
    tracker = {"white_mm": 0.004}
    rig = replace(parse_rig({"machine": drawing, "seed": 8, "tracker": tracker}), machine=FILE)
    frame: pd.DataFrame = simulate(rig, make_volume(ideal_machine(rig.spec), 240, 5)).frame
    frame["feed_mm_s"] = np.random.default_rng(2).choice([10.0, 40.0, 90.0], len(frame))
    p = frame[TARGET].ffill().bfill().to_numpy()
    came, turns = ways_of(p, np.arange(len(p)) == 0)
    feed = frame[["feed_mm_s"]].to_numpy() / 90.0
    pull = {"hose": -0.04 * came[0], "corners": 0.03 * turns * feed, "feed": 0.05 * feed**2 * [[0.3, -0.5, 0.8]]}
    frame[READING] += pull[lacks]
    write_run(frame, folder / "run.csv")
    return diagnose(Model(FILE), build_problem(FILE, read_table(folder / "run.csv")))


@pytest.mark.parametrize(("lacks", "follows"), [("hose", "way"), ("corners", "turn"), ("feed", "feed")])
def test_what_follows_the_tools_way_is_told_as_that(tmp_path: Path, lacks: str, follows: str) -> None:
    found = _told(tmp_path, lacks)
    assert found.verdict == "unknown" and not found.suggested
    assert found.depends_on[0].on.split()[0] == follows
    # What pulls aslant is told by laws that act one way each: together they are the pull.
    assert sum(item.share for item in found.depends_on if item.on.split()[0] == follows) > 0.8


@pytest.mark.parametrize(("waits", "found"), [([7.0] * 39 + [67.0], set()), ([5.0, 9.0] * 20, {"pause"})])
def test_one_break_makes_no_pauses_that_vary(waits: list[float], found: set[str]) -> None:
    away = np.tile(np.array([[20.0, 0.0, 0.0], [0.0, 20.0, 10.0], [-20.0, 5.0, 0.0], [0.0, 0.0, -15.0]]), (10, 1))
    table = make_table(away, measured=away, time_s=np.cumsum(waits))
    assert set(moves_of(build_problem(FILE, table))) - {"step"} == found
