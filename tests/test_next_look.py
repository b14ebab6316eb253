"""What is to be measured next of an unknown: in words, and as poses."""

import json
from pathlib import Path

import numpy as np
import pytest
from test_report_chinese import SAY, latin
from typer.testing import CliRunner

from ptt.challenge.challenge import bench
from ptt.commands.main import app
from ptt.dependence.dependence import Dependence
from ptt.diagnosis.telling.next_look import NOTE_MORE, OTHER_STAND, SPREAD, asks_for_poses, next_look
from ptt.model.model import Model
from ptt.plan.again import plan_again
from ptt.plan.first_run import LEAST_ROWS
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

FLAT = np.zeros((2, 3))


def follows(residual: str, on: str, shape: str = "smooth", **more) -> Dependence:
    return Dependence(residual, on, 0.9, 1e-9, None, shape, FLAT, **more)


@pytest.mark.parametrize(
    ("first", "told"),
    [
        (follows("slider 1", "z", acts_on="rail 1 sideways"),
         ("Look for the cause in rail 1 (sideways).",
          "More poses over the range of z, each approached from both sides, would show it better.")),
        (follows("slider 2", "x", acts_on="link 2", together=("x", "y", "z")),
         ("Look for the cause in link 2.",
          "More poses over the range of x, y and z, each approached from both sides, would show it better.")),
        (follows("slider 2", "direction2"),
         ("Look for the cause in slider 2.", "More poses, each approached from both sides, would show it better.")),
        (follows("set-up", "payload"),
         ("Look for the cause in the set-up.", "More readings over the range of payload would show it better.")),
        (follows("slider 2", "feed"),
         ("Look for the cause in slider 2.", "More readings over the range of feed would show it better.")),
        (follows("slider 2", "run"),
         ("Look for the cause in slider 2.", "Another run would show it better.")),
        (follows("joint 1", "pause"),
         ("Look for the cause in joint 1.",
          "More readings after longer and after shorter rests would show it better.")),
        (follows("joint 1", "step"),
         ("Look for the cause in joint 1.", "More poses in another order would show it better.")),
        (follows("x", "z"),
         ("Look for what moves the readings along x.",
          "More poses over the range of z, each approached from both sides, would show it better.", OTHER_STAND)),
        (follows("joint 2", "time"),
         ("Look for the cause in joint 2.", "A longer run, or another one, would show it better.")),
        (follows("joint 2", "time", "step", place=(15.9, 62.1), unit="s"),
         ("Look for what changed 16 to 62 s after the first row: a load, a clamp, the tool, a stop.",)),
        (follows("z", "time", "levels", moments=(526.0, 746.0), unit="s"),
         ("Look for what was switched 526 and 746 s after the first row: a pump, a clamp, a door, another machine.",)),
        (follows("z", "time", "levels", moments=(9.5, 20.5)),
         ("Look for what was switched after rows 10 and 21: a pump, a clamp, a door, another machine.",)),
    ],
)  # fmt: skip
def test_where_to_look_and_what_would_show_it_better(first, told):
    assert next_look([first], untold=False) == told
    assert [latin(SAY(line)) for line in told] == [[]] * len(told)
    assert asks_for_poses([first], untold=False) == (first.on not in ("time", "feed", "run", "pause"))


def test_what_follows_next_to_nothing_asks_for_poses_everywhere_and_what_follows_nothing_for_columns():
    assert next_look([follows("slider 1", "time")], untold=True) == (SPREAD,)
    assert asks_for_poses([follows("slider 1", "time")], untold=True)
    assert next_look([], untold=False) == (NOTE_MORE,) and not asks_for_poses([], untold=False)
    assert [latin(SAY(line)) for line in (SPREAD, NOTE_MORE)] == [[], []]
    assert SAY("target x [mm], target y [mm], target z [mm]") == "目标 x [mm]、目标 y [mm]、目标 z [mm]"


def run_of(target: np.ndarray, **columns) -> Problem:
    return build_problem(bench(), make_table(target, measured=target + 0.01, **columns))


def test_a_further_run_stays_within_the_joint_ranges_and_loads_of_the_first():
    random = np.random.default_rng(3)
    target = random.uniform([-40.0, -40.0, 10.0], [40.0, 40.0, 50.0], (60, 3))
    problem = run_of(target, payload_kg=np.repeat([0.0, 1.0, 2.0, 3.0, 5.0], 12))
    table = plan_again(Model(bench()), problem)
    again = build_problem(bench(), table.replace(measured=table.target))
    driven, wider = problem.view.q.numpy(), again.view.q.numpy()
    for one, other in ((wider, driven), (table.target, target)):
        assert (one.min(axis=0) >= other.min(axis=0) - 1e-3).all()
        assert (one.max(axis=0) <= other.max(axis=0) + 1e-3).all()
    assert (np.ptp(table.target, axis=0) > 0.9 * np.ptp(target, axis=0)).all()
    assert set(np.unique(table.payload_kg)) == {0.0, 2.0, 5.0} and table.rows >= 3 * LEAST_ROWS
    up = (again.view.direction.numpy() > 0).mean(axis=0)
    assert ((up > 0.35) & (up < 0.65)).all()


def test_a_run_along_a_line_asks_for_poses_on_it_and_one_at_a_place_for_none():
    place, line = np.tile([[0.0, 0.0, 30.0]], (20, 1)), np.linspace([-40.0, 0.0, 30.0], [40.0, 0.0, 30.0], 20)
    assert plan_again(Model(bench()), run_of(place)) is None
    table = plan_again(Model(bench()), run_of(line))
    np.testing.assert_allclose(table.target[:, 1:], np.tile([0.0, 30.0], (table.rows, 1)), atol=1e-3)


@pytest.mark.long
def test_the_poses_that_are_advised_show_what_ran_together_on_the_first_path(tmp_path):
    """A scale's pitch error along slider 1, which 300 readings of a smooth path tell as curves over b1, x and y."""
    folder, rig, more = tmp_path / "sealed", tmp_path / "rig.toml", tmp_path / "next.csv"
    told = {}

    def follow(*words: str | Path) -> None:
        outcome = CliRunner().invoke(app, [str(word) for word in words])
        assert outcome.exit_code == 0, outcome.output
        if "--json" in words:
            told.update(json.loads(outcome.stdout))

    follow("challenge", "new", folder, "--level", "unknown", "--foreign", "--seed", "3774424")
    model = ("--model", folder / "machine.toml", "--json")
    follow("diagnose", folder / "run.csv", *model, "--measure-next", more)
    assert told["verdict"] == "unknown" and told["depends_on"][0]["period_mm"] is None
    assert "slider 1" in {entry["residual"] for entry in told["depends_on"]} and more.exists()
    follow("challenge", "reveal", folder, "--rig", rig)
    follow("simulate", rig, more, "--out", tmp_path / "run2.csv")
    follow("diagnose", folder / "run.csv", "--also", tmp_path / "run2.csv", *model)
    first = told["depends_on"][0]
    assert (first["residual"], first["on"]) == ("slider 1", "b1")
    assert first["period_mm"] == pytest.approx(2.657, rel=2e-3)
