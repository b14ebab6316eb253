"""Which poses to measure first and next: reachable, balanced, repeated, and worth what they promise."""

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from conftest import BENCH
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.commands.plan import format_plan
from ptt.effects import library
from ptt.errors import InputError
from ptt.fitting.chunks import view_chunks
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.dexterity import singularities
from ptt.model.model import Model, Term
from ptt.plan import forecast
from ptt.plan.arm import d_optimal_poses
from ptt.plan.first_run import plan_first_run, repeats_in
from ptt.plan.forecast import beside, columns_of, see_plan
from ptt.plan.space import build_space, draw_poses
from ptt.plan.visits import singles, table_of
from ptt.rig.rig import Rig
from ptt.rig.rig_file import parse_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.written import table_to_frame

ARM = """
[machine]
kind = "serial"
name = "arm"
convention = "standard"
tool_mm = [0.0, 0.0, 100.0]
joint = [
  { a_mm = 0, alpha_deg = 90, d_mm = 400, theta_offset_deg = 0, limits_deg = [-170, 170] },
  { a_mm = 500, alpha_deg = 0, d_mm = 0, theta_offset_deg = 0, limits_deg = [-90, 90] },
  { a_mm = 0, alpha_deg = 90, d_mm = 0, theta_offset_deg = 0, limits_deg = [-120, 120] },
  { a_mm = 0, alpha_deg = -90, d_mm = 450, theta_offset_deg = 0, limits_deg = [-180, 180] },
  { a_mm = 0, alpha_deg = 90, d_mm = 0, theta_offset_deg = 0, limits_deg = [-110, 110] },
  { a_mm = 0, alpha_deg = 0, d_mm = 90, theta_offset_deg = 0, limits_deg = [-300, 300] },
]
"""
BASE = """
[tracker]
frame = "measured"
sigma_mm = 0.004
base_point = [
  { name = "base 1", xyz_mm = [380, 140, -220], sigma_mm = 0.002 },
  { name = "base 2", xyz_mm = [-390, 180, -210], sigma_mm = 0.002 },
  { name = "base 3", xyz_mm = [-120, -410, -230], sigma_mm = 0.002 },
]
"""


@pytest.fixture
def arm() -> MachineFile:
    return parse_machine(ARM, "arm.toml")


def make_rig(file: MachineFile, cycles: int = 3, payloads: tuple[float, ...] = (), **faults: dict) -> Rig:
    bare = {key: value for key, value in file.machine.model_dump(mode="json").items() if value is not None}
    content = {
        "machine": {"kind": "three-ptt", **bare},
        "seed": 3,
        "conditions": {"cycles": cycles, "dwell_s": 3.0, "payload_per_cycle_kg": list(payloads)},
        "tracker": {"white_mm": 0.004, "translation_mm": [0.1, 0.2, -0.1], "rotation_mrad": [0.1, 0.2, 0.3]},
    }
    return replace(parse_rig({**content, **faults}), machine=file)


def inside(file: MachineFile, targets: np.ndarray) -> None:
    """Targets are inside the travel and no nearer to a singularity than half of home's margin."""
    mechanism = build_space(file).mechanism
    p = torch.as_tensor(targets)
    q = mechanism.inverse(p)
    low, high = file.machine.slider_travel_mm
    assert torch.isfinite(q).all() and (q > low).all() and (q < high).all()
    assert not singularities(mechanism, p).near.any()


# --- the first run


@pytest.mark.parametrize("rows", [100, 200])
def test_a_first_run_is_balanced_repeated_and_reachable(bench: MachineFile, rows: int) -> None:
    plan = plan_first_run(Model(bench), rows=rows)
    table = plan.targets
    assert abs(table.rows - rows) <= 10
    inside(bench, table.target)
    np.testing.assert_allclose(plan.rising, 0.5, atol=0.06)
    view, timed = see_plan(Model(bench), table)
    np.testing.assert_array_equal(view.direction.numpy(), table.direction)
    assert plan.freedom == repeats_in(timed, view.direction.numpy()) >= 30
    visits = np.flatnonzero(table.role == "datum")
    assert len(visits) >= rows // 20 - 1 and np.diff(visits).max() <= 32
    assert len({tuple(table.direction[row]) for row in visits}) == 1
    assert len(np.unique(table.target[visits], axis=0)) == 1


def test_a_first_run_says_what_it_can_tell(bench: MachineFile) -> None:
    plan = plan_first_run(Model(bench), rows=120)
    told = {effect.effect: effect for effect in plan.effects}
    # A fitted frame takes the common zero, and common shifts of the towers sideways and round.
    assert told["homing-offset"].seen == 2 and told["tower-position"].seen == 3
    assert all(one.std is None and one.combined for one in told["homing-offset"].parameters)
    assert told["link-length"].seen == told["link-length"].size
    assert told["column-bend"].needs and told["screw-growth"].needs and not told["axis-compliance"].needs
    loaded = plan_first_run(Model(bench), rows=180, payloads=(0.0, 2.5, 5.0))
    seen = {effect.effect: effect for effect in loaded.effects}
    assert seen["column-bend"].seen == seen["column-bend"].size

    def spread(effects: dict) -> float:
        return max(one.std for one in effects["axis-compliance"].parameters)

    assert spread(seen) < 0.5 * spread(told)
    assert set(loaded.targets.payload_kg) == {0.0, 2.5, 5.0} and loaded.targets.payload_kg[-1] == 0.0


def test_a_trusted_frame_takes_nothing_of_a_first_run(bench: MachineFile) -> None:
    trusted = replace(bench, tracker=bench.tracker.model_copy(update={"frame": "trusted"}))
    told = {effect.effect: effect for effect in plan_first_run(Model(trusted), rows=60).effects}
    assert told["homing-offset"].seen == 3 and told["tower-position"].seen == 6


def test_a_plan_for_a_model_tells_what_the_model_has_again(bench: MachineFile) -> None:
    bare = plan_first_run(Model(bench), rows=120)
    model = Model(bench) + library()["link-length"]() + library()["column-bend"]()
    plan = plan_first_run(model, rows=120)
    told, alone = ({effect.effect: effect for effect in each.effects} for each in (plan, bare))
    assert set(told) == set(alone) and [name for name in told if told[name].in_model] == ["link-length", "column-bend"]
    assert not any(effect.in_model for effect in alone.values())
    ours, theirs = (np.array([one.std for one in each["link-length"].parameters]) for each in (told, alone))
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)  # the other effect of the model moves nothing without a load
    assert "Effects of the model that this run could not determine: column-bend needs column payload_kg" in plan.words
    assert "could not determine" not in bare.words and "= link-length" in format_plan(plan, "t.csv")


def test_expected_standard_errors_are_those_of_a_fit(bench: MachineFile, tmp_path: Path) -> None:
    quiet = replace(bench, tracker=bench.tracker.model_copy(update={"sigma_mm": 0.004}))
    plan = plan_first_run(Model(quiet), rows=120)
    rig = make_rig(quiet, cycles=1, geometry={"link_mm": [0.1, -0.05, 0.08]})
    simulate(rig, table_to_frame(plan.targets), seed=5).frame.to_csv(tmp_path / "run.csv", index=False)
    problem = build_problem(quiet, read_table(tmp_path / "run.csv"))
    assert problem.noise is not None and problem.noise.source == "repeats"
    fitted = fit(Model(quiet) + library()["link-length"](), problem)
    expected = next(effect for effect in plan.effects if effect.effect == "link-length")
    np.testing.assert_allclose(fitted.std[:3], [one.std for one in expected.parameters], rtol=0.3)


def test_poses_of_an_arm_tell_more_than_random_ones(arm: MachineFile) -> None:
    plan = plan_first_run(Model(arm), rows=100)
    table = plan.targets
    assert table.command is not None and table.joint_prefix == "q" and np.isnan(table.target).all()
    limits = np.radians([joint.limits_deg for joint in arm.machine.joint])
    assert (table.command > limits[:, 0]).all() and (table.command < limits[:, 1]).all()
    assert "q1_cmd_rad" in table_to_frame(table)
    space = build_space(arm)
    random = draw_poses(space, 60, np.random.default_rng(1))

    def information(q: torch.Tensor) -> float:
        view, _ = see_plan(Model(arm), table_of(singles(q), space, straight=False))
        every = np.ones(view.rows, dtype=bool)
        own = columns_of(Model(arm), library()["dh-offsets"](), view, 0.005).reshape(3 * len(q), -1)
        own = own * np.repeat([0.5, 1e-3, 0.5, 2e-3, 1e-3], 6)
        whole = np.concatenate([own, beside(Model(arm), view, every, 0.005)[: 3 * len(q)]], axis=1)
        return float(np.linalg.slogdet(whole.T @ whole + np.eye(whole.shape[1]))[1])

    chosen = d_optimal_poses(Model(arm), space, 60, np.random.default_rng(1), library(), 0.005)
    assert information(chosen) > information(random) + 2.0
    zeros = torch.zeros(30, dtype=torch.float64)  # what the model has by now is measured as well the next time
    for solved in (Term(library()["dh-offsets"](), zeros), library()["dh-offsets"]()):
        again = d_optimal_poses(Model(arm) + solved, space, 60, np.random.default_rng(1), library(), 0.005)
        assert information(again) > information(random) + 2.0


def test_an_arms_poses_below_its_base_are_said_and_the_box_that_is_named_keeps_above(arm: MachineFile) -> None:
    plan, mechanism = plan_first_run(Model(arm), rows=60), build_mechanism(arm.machine)
    assert plan.targets.command is not None
    heights = mechanism.forward(torch.as_tensor(plan.targets.command))[:, 2]
    count, lowest = int((heights < -1.0).sum()), -float(heights.min())
    assert count and f"At {count} poses the tool is below the base's plane (z = 0), {lowest:.0f} mm" in plan.words
    (size,) = re.findall(r"--box (\d+),(\d+),(\d+),", plan.words)
    half = (float(size[0]), float(size[1]), float(size[2]))
    again = plan_first_run(Model(arm), rows=60, space=build_space(arm, half))
    assert again.targets.command is not None
    assert float(mechanism.forward(torch.as_tensor(again.targets.command))[:, 2].min()) >= 0.0
    assert "below the base" not in again.words


def test_too_few_rows_are_refused(bench: MachineFile) -> None:
    with pytest.raises(InputError, match="too few"):
        plan_first_run(Model(bench), rows=100, payloads=(0.0, 2.5, 5.0))


# --- the verb


def test_the_plan_is_the_same_bytes_again(tmp_path: Path) -> None:
    machine = tmp_path / "bench.toml"
    machine.write_text(BENCH + BASE)
    ask = ["--rows", "80", "--json"]
    outs = [str(tmp_path / name) for name in ("a.csv", "b.csv")]
    runs = [CliRunner().invoke(app, ["plan", str(machine), "--out", out, *ask]) for out in outs]
    assert [each.exit_code for each in runs] == [0, 0]
    first, second = (json.loads(each.stdout) for each in runs)
    assert first["out"] != second["out"] and {**first, "out": ""} == {**second, "out": ""}
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    table = read_table(tmp_path / "a.csv", purpose="targets")
    assert list(table.role[:3]) == ["base"] * 3 == list(table.role[-3:])
    assert first["rows"] == table.rows and {item["effect"] for item in first["effects"]} >= {"backlash", "link-length"}


@pytest.mark.parametrize("words", [("--payloads", "0,x"), ("--box", "60,60"), ("--payloads", "-1,2")])
def test_options_that_cannot_be_read_are_refused_in_one_line(words: tuple[str, str], tmp_path: Path) -> None:
    machine = tmp_path / "bench.toml"
    machine.write_text(BENCH)
    ended = CliRunner().invoke(app, ["plan", str(machine), "--out", str(tmp_path / "t.csv"), *words])
    assert ended.exit_code == 2
    assert words[0] in ended.stderr and ended.stderr.count("\n") == 1
    assert not (tmp_path / "t.csv").exists()


def test_a_long_plan_is_foreseen_in_chunks_as_in_one(bench: MachineFile, monkeypatch: pytest.MonkeyPatch) -> None:
    model = Model(bench) + library()["link-length"]() + library()["backlash"]()
    whole = plan_first_run(model, rows=300).effects
    monkeypatch.setattr(forecast, "view_chunks", partial(view_chunks, size=41))
    parts = plan_first_run(model, rows=300).effects
    assert [(one.effect, one.seen, one.size, one.in_model) for one in parts] == [
        (one.effect, one.seen, one.size, one.in_model) for one in whole
    ]
    for one, other in zip(parts, whole, strict=True):
        stds = [[value.std or 0.0 for value in each.parameters] for each in (one, other)]
        np.testing.assert_allclose(*stds, rtol=1e-7, atol=0.0)
