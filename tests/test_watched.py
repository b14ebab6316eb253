"""Columns of the user's own: watched where named, and an error that follows one is said to follow it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

import ptt
from ptt.challenge.challenge import bench
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.long import diagnose_long
from ptt.diagnosis.unknown.laws import laws_of
from ptt.errors import TableError
from ptt.machine import save_machine
from ptt.mechanisms import build_mechanism
from ptt.model.chain import linearise
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import build_problem
from ptt.run.table import make_table, take_rows
from ptt.run.watched import watch, watched_values
from ptt.run.written import table_to_frame

TITLE, IDLE = "coolant flow [l/min]", "shift"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A machine whose second slider creeps by 15 um for a litre of coolant a minute more; no fault of the library."""
    place = tmp_path_factory.mktemp("coolant")
    drawn = draw_rig(7, bench(), rows=150)
    random = np.random.default_rng(3)
    target = drawn.targets[["x_cmd", "y_cmd", "z_cmd"]]
    flow = np.round(4.0 + 1.5 * np.sin(np.arange(len(target)) / 5.0) + random.normal(0.0, 0.4, len(target)), 2)
    mechanism = build_mechanism(bench().machine)
    q = mechanism.inverse(torch.tensor(target.to_numpy()))
    q[:, 1] += torch.tensor(0.015 * (flow - 4.0))
    went = drawn.targets.assign(**dict(zip(target, mechanism.forward(q).numpy().T, strict=True)))
    frame = table_to_frame(table_of(simulate(drawn.rig, went).frame, drawn.absent)).assign(**target)
    frame = frame.drop(columns=[name for name in frame if name.startswith("b")])
    frame[TITLE], frame[IDLE] = flow, "early"
    frame.to_csv(place / "run.csv", index=False)
    save_machine(bench(), place / "machine.toml")
    return place


def test_an_error_that_follows_a_column_of_ones_own_is_said_to_follow_it(folder):
    machine = ptt.load(folder / "machine.toml")
    blind = ptt.diagnose(machine, folder / "run.csv")
    assert not any(line.on == TITLE for line in blind.result.depends_on)
    run = ptt.read(folder / "run.csv", machine, context=[TITLE])
    found = ptt.diagnose(machine, run)
    assert found.verdict == "unknown" and not found.suggested
    assert (found.result.depends_on[0].residual, found.result.depends_on[0].on) == ("slider 2", TITLE)
    assert found.result.depends_on[0].share > 0.8
    summed = diagnose_long(found.opened.model, found.opened.problem, found.opened.library, size=60)
    assert [(line.residual, line.on) for line in summed.depends_on][:1] == [("slider 2", TITLE)]
    assert ptt.compare(machine, run).to_dict()["depends_on"][0]["on"] == TITLE


@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.long)])
def test_a_shift_that_follows_a_column_is_no_wander_of_the_tracker(seed: int) -> None:
    """Of few rows, where nothing states their noise: a field over the workspace would be too much to ask for."""
    random, rows = np.random.default_rng(seed), 90
    target = random.uniform(-60.0, 60.0, (rows, 3))
    flow = np.cumsum(random.normal(0.0, 0.3, rows))
    read = target + random.normal(0.0, 0.004, (rows, 3)) + 0.01 * flow[:, None] * [0.0, 0.0, 1.0]
    file = bench()
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": None, "frame": "fitted"}))
    table = replace(make_table(target, measured=read), extra={TITLE: tuple(f"{value:.3f}" for value in flow)})
    found = diagnose(Model(file), build_problem(file, watch(table, [TITLE])))
    assert found.verdict == "unknown" and not found.suggested
    assert (found.depends_on[0].residual, found.depends_on[0].on) == ("z", TITLE)


def test_what_cannot_be_watched_is_refused_with_the_way_out(folder, tmp_path):
    machine = ptt.load(folder / "machine.toml")
    for given, said in (
        ("coolant flow", f"did you mean '{TITLE[:10]}"),
        ("x", "examined in any case"),
        (IDLE, "row 2, column shift: 'early' is not a number"),
    ):
        with pytest.raises(TableError) as refused:
            ptt.read(folder / "run.csv", machine, context=given)
        assert said in str(refused.value)
    frame = pd.read_csv(folder / "run.csv").assign(**{TITLE: 4.0})
    with pytest.raises(TableError, match="nothing can depend on it"):
        ptt.read(frame, machine, context=TITLE)


def test_values_stay_beside_their_rows(folder):
    table = watch(ptt.read(folder / "run.csv", folder / "machine.toml").table, [TITLE])
    rows = np.arange(table.rows)[::-7]
    np.testing.assert_array_equal(watched_values(take_rows(table, rows))[TITLE], watched_values(table)[TITLE][rows])


def test_what_is_watched_is_said_once_and_not_as_unused(folder):
    lines = ptt.read(folder / "run.csv", folder / "machine.toml", context=TITLE).table.understood.lines
    assert [line for line in lines if TITLE in line] == [f"also examined: {TITLE}"]
    assert f"not used: {IDLE}" in lines


@pytest.mark.parametrize("title", ["turn", "way x", "direction", "reversal"])
def test_a_title_that_is_the_programs_own_word_is_refused(title: str) -> None:
    table = make_table(np.zeros((3, 3)), extra={title: np.array(["1", "2", "3"])})
    with pytest.raises(TableError, match="give the column another title"):
        watch(table, [title])


@pytest.mark.parametrize("title", ["turntable", "runout", "directional valve", "T1"])
def test_a_title_like_a_variable_of_the_run_is_a_column_like_any_other(title: str) -> None:
    values = np.cumsum(np.random.default_rng(0).normal(size=80))
    poses = np.random.default_rng(1).uniform(-50.0, 50.0, (80, 3))
    table = make_table(poses, measured=poses, extra={title: np.array([f"{value:.3f}" for value in values])})
    problem = build_problem(bench(), watch(table, [title]))
    offered = [block for laws in laws_of(problem, linearise([], problem.view).chain) for block in laws]
    own = [block for block in offered if block.on == (title,) and not block.jumps]
    assert {block.place.kind for block in own} >= {"tool", "slider", "rail", "link"}
    assert not any(block.is_curve for block in own)
