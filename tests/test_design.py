"""Which poses to measure first and next: reachable, balanced, repeated, and worth what they promise."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from conftest import BENCH
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.commands.plan import format_plan
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.verdict import diagnose
from ptt.effects import library
from ptt.errors import InputError, WorkspaceError
from ptt.fitting.chunks import view_chunks
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, parse_machine
from ptt.mechanisms.dexterity import singularities
from ptt.model.model import Model, Term
from ptt.plan import foresight
from ptt.plan.arm import telling_poses
from ptt.plan.contest import open_contest
from ptt.plan.first_run import plan_first_run, repeats_in
from ptt.plan.foresight import beside, columns_of, see_plan
from ptt.plan.separation import Separation, plan_separation
from ptt.plan.space import build_space, can_drive, directions, draw_poses
from ptt.plan.visits import both_ways, in_driving_order, singles, table_of
from ptt.rig.rig import Rig, parse_rig
from ptt.rig.simulate import simulate
from ptt.rig.targets import as_targets, make_helix, there_and_back
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.table import table_to_frame, write_table
from ptt.run.viewing import build_view

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


def short_helix(radius: float = 20.0, rise: float = 0.5) -> object:
    return as_targets(there_and_back(make_helix(40, radius=radius, rise=rise, turns=2.0, start=-20.0 * rise)))


def measure(rig: Rig, folder: Path, radius: float = 20.0, rise: float = 0.5) -> tuple[Path, Problem, Diagnosis]:
    path = folder / "path.csv"
    simulate(rig, short_helix(radius, rise), seed=1).frame.to_csv(path, index=False)
    problem = build_problem(rig.machine, read_table(path))
    return path, problem, diagnose(Model(rig.machine), problem)


def drive_next(rig: Rig, plan: Separation, path: Path, folder: Path) -> Diagnosis:
    assert plan.targets is not None
    write_table(plan.targets, folder / "next.csv")
    wanted = read_table(folder / "next.csv", purpose="targets")
    once = rig.conditions.model_copy(update={"cycles": 1, "payload_per_cycle_kg": ()})
    again = simulate(replace(rig, conditions=once), table_to_frame(wanted).assign(role=wanted.role), seed=2)
    again.frame.to_csv(folder / "more.csv", index=False)
    both = read_table(path, also=[folder / "more.csv"])
    return diagnose(Model(rig.machine), build_problem(rig.machine, both))


def inside(file: MachineFile, targets: np.ndarray) -> None:
    """Targets are inside the travel and no nearer to a singularity than half of home's margin."""
    mechanism = build_space(file).mechanism
    p = torch.as_tensor(targets)
    q = mechanism.inverse(p)
    low, high = file.machine.slider_travel_mm
    assert torch.isfinite(q).all() and (q > low).all() and (q < high).all()
    assert not singularities(mechanism, p).near.any()


# --- space and visits


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10**6), half=st.floats(20.0, 120.0))
def test_poses_lie_in_the_box_the_travel_and_away_from_singularities(seed: int, half: float) -> None:
    file = parse_machine(BENCH, "bench.toml")
    space = build_space(file, (half, half, half))
    q = draw_poses(space, 40, np.random.default_rng(seed))
    p = space.mechanism.forward(q)
    assert (p.abs() <= half + 1e-9).all()
    inside(file, p.numpy())
    assert can_drive(space, q).all()


def test_a_box_that_cannot_be_reached_is_refused(bench: MachineFile) -> None:
    high = bench.machine.model_copy(update={"slider_travel_mm": (500.0, 600.0)})  # home is at 283 mm
    with pytest.raises(WorkspaceError, match=r"box"):
        draw_poses(build_space(replace(bench, machine=high), (10.0, 10.0, 10.0)), 50, np.random.default_rng(0))


def test_slider_heights_meet_every_phase_of_the_screw(bench: MachineFile) -> None:
    q = draw_poses(build_space(bench), 200, np.random.default_rng(0)).numpy()
    phase = np.floor((q % 5.0) / 5.0 * 8).astype(int)
    counts = np.array([np.bincount(column, minlength=8) for column in phase.T])
    assert counts.min() >= 10  # 25 each if even


def test_directions_come_in_opposite_pairs() -> None:
    ways = directions(3)
    assert len({tuple(way) for way in ways}) == 8
    np.testing.assert_array_equal(ways[::2], -ways[1::2])
    assert len(directions(7)) == 64


def test_a_visit_arrives_from_either_side_of_every_joint(bench: MachineFile) -> None:
    space = build_space(bench)
    visits = both_ways(space, 12, np.random.default_rng(4), repeats=2)
    assert len(visits) == 12
    for visit in visits:
        table = table_of([visit], space, straight=False)
        direction = build_view(bench, table).direction.numpy()
        np.testing.assert_array_equal(direction[1], -direction[3])
        np.testing.assert_array_equal(direction[1], direction[5])
        np.testing.assert_array_equal(table.target[1], table.target[3])


def test_the_order_of_driving_is_short_and_complete(bench: MachineFile) -> None:
    space = build_space(bench)
    visits = both_ways(space, 20, np.random.default_rng(4))
    loaded = [replace(visit, payload=5.0 * (number % 2)) for number, visit in enumerate(visits)]
    ordered = in_driving_order(loaded, space)
    assert {id(visit) for visit in ordered} == {id(visit) for visit in loaded}
    assert [visit.payload for visit in ordered] == [0.0] * 10 + [5.0] * 10

    def way(items: list) -> float:
        places = space.mechanism.forward(torch.stack([visit.q[1] for visit in items]))
        return float(places.diff(dim=0).norm(dim=1).sum())

    assert way(ordered) < 0.8 * way(sorted(loaded, key=lambda visit: visit.payload))


# --- contests


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_gain_is_what_adding_the_rows_brings(seed: int) -> None:
    random = np.random.default_rng(seed)
    known, truth = random.normal(size=(30, 7)), np.zeros(7)
    truth[5:] = random.normal(size=2)
    contest = open_contest(known, np.arange(5), truth)
    left = known @ truth - known[:, :5] @ np.linalg.lstsq(known[:, :5], known @ truth, rcond=None)[0]
    np.testing.assert_allclose(contest.misfit, left @ left, rtol=1e-9)
    groups = random.normal(size=(4, 6, 7))
    gains = contest.gains(groups)
    for group, gain in zip(groups, gains, strict=True):
        np.testing.assert_allclose(contest.add(group).misfit - contest.misfit, gain, rtol=1e-7)
        assert gain >= 0.0


def test_columns_that_are_known_only_make_a_contest_easier() -> None:
    random = np.random.default_rng(0)
    truth = np.array([0.0, 0.0, 0.0, 1.0])
    contest = open_contest(random.normal(size=(20, 4)), np.arange(3), truth)
    assert contest.without(np.array([1])).misfit >= contest.misfit


# --- what to measure next


def test_links_and_skew_joints_are_told_apart_by_the_poses_chosen(bench: MachineFile, tmp_path: Path) -> None:
    rig = make_rig(bench, geometry={"link_mm": [0.1, 0.0, 0.0]})
    path, problem, found = measure(rig, tmp_path)
    assert set(found.suggested[0]) == {"link-length", "joint-offset"}
    plan = plan_separation(found.fitted, problem, found.suggested)
    assert plan is not None and plan.targets is not None
    assert plan.before < 3.0 and plan.after > 8.0 and plan.reached
    assert plan.targets.rows <= 80
    assert f"Drive {plan.targets.rows} rows far out in x and y" in plan.words
    inside(bench, plan.targets.target)
    assert drive_next(rig, plan, path, tmp_path).suggested == (("link-length",),)


def test_the_separation_that_is_promised_is_reached(bench: MachineFile, tmp_path: Path) -> None:
    """Without noise, the wrong effect fitted to old and new rows leaves what was promised, by second order more."""
    rig = make_rig(bench, geometry={"link_mm": [0.1, -0.05, 0.08]})
    path, problem, found = measure(rig, tmp_path)
    fitted = found.fitted
    plan = plan_separation(fitted, problem, (("link-length", "joint-offset"),))
    assert plan is not None and plan.targets is not None
    drive_next(rig, plan, path, tmp_path)
    once = rig.conditions.model_copy(update={"cycles": 1})
    for name, targets, conditions in (
        ("path", short_helix(), rig.conditions),
        ("more", table_to_frame(plan.targets), once),
    ):
        frame = simulate(replace(rig, conditions=conditions), targets, noise=False).frame
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
    both = build_problem(bench, read_table(tmp_path / "path.csv", also=[tmp_path / "more.csv"]))
    wrong = fit(Model(bench) + library()["joint-offset"](), both, noise=fitted.noise, robust=False)
    assert 0.85 * plan.after < np.sqrt(wrong.chi2) < 1.5 * plan.after


def test_a_path_that_picked_wrong_is_put_right(bench: MachineFile, tmp_path: Path) -> None:
    rig = make_rig(bench, geometry={"lean_radial_mrad": [1.0, 0.0, 0.0]})
    path, problem, found = measure(rig, tmp_path, 15.0, 1.0)
    assert "tower-tilt" in found.suggested[0] and len(found.suggested[0]) > 1
    plan = plan_separation(found.fitted, problem, found.suggested)
    assert plan is not None
    told = drive_next(rig, plan, path, tmp_path).suggested
    assert [step[0] for step in told] == ["tower-tilt"]


def test_exact_ambiguities_are_named_with_an_instrument(bench: MachineFile, tmp_path: Path) -> None:
    rig = make_rig(bench, drive={"homing_mm": [0.2, 0.0, -0.1]})
    _, problem, found = measure(rig, tmp_path)
    fitted = found.fitted
    plan = plan_separation(fitted, problem, (("homing-offset", "joint-offset", "tower-tilt"),))
    assert plan is not None and plan.targets is None and not plan.reached
    assert all(pair.exact and pair.ceiling < 2.0 for pair in plan.pairs)
    joint, tilt = plan.pairs
    assert "linear scale" in joint.instrument
    assert "base" in tilt.instrument and "measured" in tilt.instrument
    assert all(line.startswith("No pose tells homing-offset from") for line in plan.lines)
    json.dumps(plan.to_dict())


def test_loads_are_asked_for_where_they_matter(bench: MachineFile, tmp_path: Path) -> None:
    rig = make_rig(bench, payloads=(0.0, 5.0, 0.0), drive={"compliance_um_per_n": [0.2, 0.4, 0.1]})
    _, problem, _ = measure(rig, tmp_path, 8.0, 0.1)
    fitted = fit(Model(bench) + library()["axis-compliance"](), problem)
    plan = plan_separation(fitted, problem, (("axis-compliance", "column-bend"),))
    assert plan is not None and plan.targets is not None
    loads = plan.targets.payload_kg
    assert loads is not None and set(loads) <= {0.0, 2.5, 5.0} and loads.max() == 5.0
    assert (np.diff(loads) >= 0.0).all()
    assert plan.after > plan.before and "payload_kg" in plan.words


def test_base_reflectors_are_read_with_the_rows(bench: MachineFile, tmp_path: Path) -> None:
    file = parse_machine(BENCH + BASE, "bench.toml")
    _, problem, _ = measure(make_rig(file, geometry={"link_mm": [0.1, 0.0, 0.0]}), tmp_path)
    fitted = fit(Model(file) + library()["link-length"](), problem)
    plan = plan_separation(fitted, problem, (("link-length", "joint-offset"),))
    assert plan is not None and plan.targets is not None
    names = plan.targets.name[plan.targets.role == "base"]
    assert list(names) == ["base 1", "base 2", "base 3"] * 2
    write_table(plan.targets, tmp_path / "next.csv")
    assert (read_table(tmp_path / "next.csv", purpose="targets").role == plan.targets.role).all()


def test_nothing_confused_needs_no_poses(bench: MachineFile, tmp_path: Path) -> None:
    _, problem, found = measure(make_rig(bench, drive={"backlash_mm": [0.1, 0.1, 0.1]}), tmp_path)
    assert found.suggested == (("backlash",),)
    assert plan_separation(found.fitted, problem, found.suggested) is None


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
    assert all(std is None for _, _, std, _ in told["homing-offset"].parameters)
    assert told["link-length"].seen == told["link-length"].size
    assert told["column-bend"].needs and told["screw-growth"].needs and not told["axis-compliance"].needs
    loaded = plan_first_run(Model(bench), rows=180, payloads=(0.0, 2.5, 5.0))
    seen = {effect.effect: effect for effect in loaded.effects}
    assert seen["column-bend"].seen == seen["column-bend"].size

    def spread(effects: dict) -> float:
        return max(std for _, _, std, _ in effects["axis-compliance"].parameters)

    assert spread(seen) < 0.5 * spread(told)
    assert set(loaded.targets.payload_kg) == {0.0, 2.5, 5.0} and loaded.targets.payload_kg[-1] == 0.0


def test_a_plan_for_a_model_tells_what_the_model_has_again(bench: MachineFile) -> None:
    bare = plan_first_run(Model(bench), rows=120)
    model = Model(bench) + library()["link-length"]() + library()["column-bend"]()
    plan = plan_first_run(model, rows=120)
    told, alone = ({effect.effect: effect for effect in each.effects} for each in (plan, bare))
    assert set(told) == set(alone) and [name for name in told if told[name].in_model] == ["link-length", "column-bend"]
    assert not any(effect.in_model for effect in alone.values())
    ours, theirs = (np.array([std for _, _, std, _ in each["link-length"].parameters]) for each in (told, alone))
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)  # the other effect of the model moves nothing without a load
    assert "Of what the model has, this run would not tell: column-bend needs column payload_kg" in plan.words
    assert "would not tell" not in bare.words and "= link-length" in format_plan(plan, "t.csv")


def test_expected_standard_errors_are_those_of_a_fit(bench: MachineFile, tmp_path: Path) -> None:
    quiet = replace(bench, tracker=bench.tracker.model_copy(update={"sigma_mm": 0.004}))
    plan = plan_first_run(Model(quiet), rows=120)
    rig = make_rig(quiet, cycles=1, geometry={"link_mm": [0.1, -0.05, 0.08]})
    simulate(rig, table_to_frame(plan.targets), seed=5).frame.to_csv(tmp_path / "run.csv", index=False)
    problem = build_problem(quiet, read_table(tmp_path / "run.csv"))
    assert problem.noise is not None and problem.noise.source == "repeats"
    fitted = fit(Model(quiet) + library()["link-length"](), problem)
    expected = next(effect for effect in plan.effects if effect.effect == "link-length")
    np.testing.assert_allclose(fitted.std[:3], [std for _, _, std, _ in expected.parameters], rtol=0.3)


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

    chosen = telling_poses(Model(arm), space, 60, np.random.default_rng(1), library(), 0.005)
    assert information(chosen) > information(random) + 2.0
    zeros = torch.zeros(30, dtype=torch.float64)  # what the model has by now is measured as well the next time
    for solved in (Term(library()["dh-offsets"](), zeros), library()["dh-offsets"]()):
        again = telling_poses(Model(arm) + solved, space, 60, np.random.default_rng(1), library(), 0.005)
        assert information(again) > information(random) + 2.0


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
    monkeypatch.setattr(foresight, "view_chunks", partial(view_chunks, size=41))
    parts = plan_first_run(model, rows=300).effects
    assert [(one.effect, one.seen, one.size, one.in_model) for one in parts] == [
        (one.effect, one.seen, one.size, one.in_model) for one in whole
    ]
    for one, other in zip(parts, whole, strict=True):
        stds = [[value.std or 0.0 for value in each.parameters] for each in (one, other)]
        np.testing.assert_allclose(*stds, rtol=1e-7, atol=0.0)
