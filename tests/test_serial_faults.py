"""A draw of hidden faults of arms beside the sweep of benchmarks/serial_sweep.py, gear lines, what to measure next."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ptt.diagnosis.diagnose import diagnose
from ptt.effects.registry import library, make_effect
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, load_machine
from ptt.model.model import Model
from ptt.plan import separation
from ptt.plan.separation import plan_separation
from ptt.rig.draw_arm import ARM_FAULTS, ArmFault, draw_arm
from ptt.rig.serial_arm import ArmFaults, ArmRig
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
SIGMA = 0.01
NAMES = {
    "compliance": "axis-compliance",
    "backlash": "backlash",
    "link": "dh-offsets",
    "growth": "frame-growth",
    "weight": "self-weight",
}
# The others are asked of another draw in test_serial_diagnosis.
ASKED = [("kuka_iiwa", "link"), ("kuka_iiwa", "weight"), ("kuka_iiwa", "none")]


def arm(name: str, **machine: object) -> MachineFile:
    file = load_machine(MACHINES / f"{name}.toml")
    own = {"sigma_mm": SIGMA, "frame": "fitted", "tool": "fitted"}
    file = replace(file, tracker=file.tracker.model_copy(update=own))
    return replace(file, machine=file.machine.model_copy(update=machine))


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        pytest.param(name, fault, marks=() if (name, fault) in ASKED else pytest.mark.long)
        for fault in ARM_FAULTS
        for name in ("ur10", "kuka_iiwa")
    ],
)
def test_faults_of_fresh_arms_are_named_first_and_alone(name: str, fault: ArmFault) -> None:
    file = arm(name)
    run = draw_arm(file.machine, fault, 90001 if name == "ur10" else 90002, sigma_mm=SIGMA)
    context = {"measured": run.readings, "payload_kg": run.payload_kg, "temp_c": run.temp_c, "time_s": run.time_s}
    file = replace(file, machine=run.rig.spec)
    found = diagnose(Model(file), build_problem(file, make_table(None, run.q, **context)))
    assert [step[0] for step in found.suggested] == ([] if fault == "none" else [NAMES[fault]]), found.words
    assert found.verdict == ("nothing-missing" if fault == "none" else "missing"), found.words


def test_drawn_faults_follow_their_seed_and_move_the_reflector() -> None:
    spec = arm("ur10").machine
    for fault in ARM_FAULTS:
        one, again, other = (draw_arm(spec, fault, seed, rows=40) for seed in (5, 5, 6))
        np.testing.assert_array_equal(one.readings, again.readings)
        assert np.abs(one.q - other.q).max() > 0.1
        sound = replace(one.rig, faults=ArmFaults.none(6)).measure(one.q, one.payload_kg, one.temp_c, one.seed)
        assert np.array_equal(one.readings, sound) == (fault == "none")


def geared(random: np.random.Generator, harmonics: tuple[int, ...], teeth: int = 100) -> tuple[ArmRig, np.ndarray]:
    """A UR10 whose joints err by 40 urad with some harmonics of a gear's turn, and random poses."""
    wobble = np.zeros((6, max(harmonics) * teeth, 2))
    for harmonic in harmonics:
        wobble[:, harmonic * teeth - 1] = random.choice([-1.0, 1.0], (6, 2)) * 4e-5
    faults = replace(ArmFaults.none(6), wobble=wobble)
    rig = ArmRig(arm("ur10").machine, faults, np.array([40.0, 10.0, 5.0]), np.eye(4), SIGMA)
    return rig, random.uniform(-2.5, 2.5, (300, 6))


@pytest.mark.parametrize("harmonics", [(1,), (1, 2)])
def test_gear_lines_are_found_at_the_gears_turn(harmonics: tuple[int, ...]) -> None:
    random = np.random.default_rng(7)
    rig, q = geared(random, harmonics)
    file = arm("ur10", gear_period_rad=2.0 * np.pi / 100)
    readings = rig.measure(q, np.zeros(300), np.full(300, 20.0), 3)
    found = diagnose(Model(file), build_problem(file, make_table(None, q, readings)))
    named = {step[0] for step in found.suggested}
    assert named == {"once-per-rev", "once-per-rev[harmonic 2]"} or (harmonics == (1,) and named == {"once-per-rev"})
    assert ("once-per-rev[harmonic 2]" in named) == (2 in harmonics)
    values = {name: value for name, _, value, _ in found.candidates[0].parameters if "cosine" in name or "sine" in name}
    assert np.abs(np.abs(list(values.values())[:5]) - 4e-5).max() < 1.5e-5


def test_few_phases_of_the_gear_are_asked_for_in_words_of_an_arm() -> None:
    q = np.random.default_rng(0).integers(-3, 4, (50, 6)) * 0.25
    file = arm("ur10", gear_period_rad=0.25)
    lack = make_effect(library(), "once-per-rev").needs(build_view(file, make_table(None, q)))
    assert lack is not None and "gear_period_rad" in lack and "height" not in lack


def test_next_poses_part_what_a_run_of_an_arm_confuses(monkeypatch: pytest.MonkeyPatch) -> None:
    """A payload that never changes makes yielding joints and links that are off alike near one posture."""
    file = arm("ur10")
    run = draw_arm(file.machine, "compliance", 4, rows=60)
    q = np.array([0.2, -1.2, 1.0, 0.4, 0.9, 0.3]) + 0.08 * run.q
    load = np.full(60, 3.0)
    problem = build_problem(file, make_table(None, q, run.rig.measure(q, load, run.temp_c, 1), payload_kg=load))
    fitted = fit(Model(file) + make_effect(library(), "axis-compliance"), problem)
    monkeypatch.setattr(separation, "MOST_ROWS", 24)
    plan = plan_separation(fitted, problem, [("axis-compliance", "homing-offset")], library())
    assert plan is not None and plan.targets is not None and plan.targets.command is not None
    assert plan.targets.command.shape[1] == 6 and plan.targets.rows <= 24 + 4
    assert plan.after > plan.before or np.isnan(plan.before)
    assert np.ptp(plan.targets.command, axis=0)[1:3].max() > 3.0 * np.ptp(q, axis=0)[1:3].max()
