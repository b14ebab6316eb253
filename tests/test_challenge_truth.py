"""Challenges: what is hidden, how large it is, and what stays in the readings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from test_challenge import drawn_with

from ptt.challenge.challenge import (
    bench,
    new_challenge,
    open_challenge,
)
from ptt.challenge.remeasure import remeasure
from ptt.challenge.truth import UM_PER_MM, reading_noise, table_of, without_rigid_motion, without_set_up
from ptt.effects import library
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.rig.draw import draw_rig
from ptt.run.axes import rms_length
from ptt.run.problem import build_problem
from ptt.run.reading import read_table

KNOWN = library()


def test_off_frame_takes_rigid_motions_off_and_nothing_else() -> None:
    random = np.random.default_rng(0)
    place = random.uniform(-60, 60, (40, 3))
    moved = np.cross([1e-4, -2e-4, 3e-4], place) + np.array([0.1, -0.2, 0.3])
    np.testing.assert_allclose(without_rigid_motion(moved, place), 0.0, atol=1e-12)
    shift = random.normal(size=(40, 3))
    np.testing.assert_allclose(
        without_rigid_motion(shift + moved, place), without_rigid_motion(shift, place), atol=1e-12
    )
    assert rms_length(without_rigid_motion(shift, place)) > 0.8 * rms_length(shift)


def test_a_known_set_up_holds_nothing_and_one_for_each_run_holds_more() -> None:
    random = np.random.default_rng(2)
    place, run = random.uniform(-60, 60, (40, 3)), np.repeat([0, 1], 20)
    moved = np.where(run[:, None] == 0, 0.0, np.cross([1e-4, -2e-4, 3e-4], place) + np.array([0.1, -0.2, 0.3]))
    left = {}
    for policy in ("trusted", "measured", "fitted", "fitted-per-run"):
        file = bench()
        file = replace(file, tracker=file.tracker.model_copy(update={"frame": policy}))
        rig = replace(draw_rig(1, bench(), "volume", rows=40).rig, machine=file)
        left[policy] = rms_length(without_set_up(rig, moved, place, run))
    assert left["trusted"] == left["measured"] == rms_length(moved)
    assert 0.1 * left["trusted"] < left["fitted"] < left["trusted"]
    assert left["fitted-per-run"] < 1e-9


def test_the_tool_error_is_taken_as_the_set_up_allows() -> None:
    """A homing error in a trusted frame is all there; fitted frames take most of it off."""
    drawn = drawn_with("homing-offset", seed=3)
    sizes = {}
    for policy in ("trusted", "fitted"):
        file = replace(drawn.rig.machine, tracker=drawn.rig.machine.tracker.model_copy(update={"frame": policy}))
        rig = replace(drawn.rig, machine=file)
        tracker = rig.tracker.model_copy(update={"translation_mm": (0.0,) * 3, "rotation_mrad": (0.0,) * 3})
        known = replace(drawn, rig=replace(rig, tracker=tracker))
        sizes[policy] = remeasure(Model(file), known).to_dict()["before"]["total"]
        run = simulate(known.rig, known.targets, noise=False)
        error = run.truth - run.frame[["x_cmd", "y_cmd", "z_cmd"]].to_numpy(float)
        if policy == "trusted":
            assert sizes[policy] == pytest.approx(UM_PER_MM * rms_length(error))
    assert sizes["fitted"] < 0.8 * sizes["trusted"]


def test_reading_noise_is_what_readings_scatter_by() -> None:
    drawn = draw_rig(2, bench(), "volume", rows=300)
    frames = [simulate(drawn.rig, drawn.targets, noise=noise).frame for noise in (True, False)]
    scatter = np.subtract(*(frame[["x_meas", "y_meas", "z_meas"]].to_numpy(float) for frame in frames))
    noise = reading_noise(drawn.rig, simulate(drawn.rig, drawn.targets, noise=False).truth)
    assert np.sqrt(np.square(scatter).sum(axis=1).mean()) == pytest.approx(noise.total, rel=0.06)
    whitened = scatter @ noise.whitener.T
    assert np.square(whitened).mean() == pytest.approx(1.0, abs=0.1)


def test_a_table_of_a_frame_is_the_table_of_its_file(tmp_path: Path) -> None:
    folder = new_challenge(tmp_path / "c", "single", seed=0, rows=60).folder
    opened = open_challenge(folder).drawn
    direct = build_problem(bench(), table_of(simulate(opened.rig, opened.targets).frame))
    read = build_problem(load_machine(folder / "machine.toml"), read_table(folder / "run.csv"))
    np.testing.assert_allclose(direct.measured, read.measured, atol=2e-4)
    assert direct.view.varies == read.view.varies
    torch.testing.assert_close(direct.view.direction, read.view.direction)
