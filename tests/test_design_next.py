"""What to measure next: what cannot be told apart yet is, by the poses that a plan adds."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from conftest import BENCH
from test_design import BASE, inside, make_rig

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import library
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, parse_machine
from ptt.model.model import Model
from ptt.plan.separation import Separation, plan_separation
from ptt.rig.rig import Rig
from ptt.rig.simulate import simulate
from ptt.rig.targets import as_targets, make_helix, there_and_back
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.written import table_to_frame, write_table


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


def test_links_and_skew_joints_are_told_apart_by_the_poses_chosen(bench: MachineFile, tmp_path: Path) -> None:
    rig = make_rig(bench, geometry={"link_mm": [0.1, 0.0, 0.0]})
    path, problem, found = measure(rig, tmp_path)
    assert set(found.suggested[0]) == {"link-length", "joint-offset"}
    plan = plan_separation(found.fitted, problem, found.suggested)
    assert plan is not None and plan.targets is not None
    assert plan.before < 3.0 and plan.after > 8.0 and plan.reached
    assert plan.targets.rows <= 80
    assert f"Measure {plan.targets.rows} rows further out in x and y" in plan.words
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
