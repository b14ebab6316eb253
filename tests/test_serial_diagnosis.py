"""Hidden faults of virtual serial arms are named right, a sound arm gets nothing named, and compensation mends it."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from ptt.correct.compensate import compensate
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects.registry import library, make_effect
from ptt.errors import ModelError
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.rig.serial_arm import ArmFaults, ArmRig, rigid
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table, make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
ROWS, SIGMA = 220, 0.01
EXPECTED = {
    "compliance": "axis-compliance",
    "backlash": "backlash",
    "link": "dh-offsets",
    "growth": "frame-growth",
}


def arm(name: str, **tracker: object) -> MachineFile:
    file = load_machine(MACHINES / f"{name}.toml")
    own = {"sigma_mm": SIGMA, "frame": "fitted", "tool": "fitted", **tracker}
    return replace(file, tracker=file.tracker.model_copy(update=own))


def broken(kind: str, joints: int, random: np.random.Generator) -> ArmFaults:
    faults = ArmFaults.none(joints)
    if kind == "compliance":
        return replace(faults, compliance=random.uniform(0.2e-8, 1.2e-8, joints))
    if kind == "backlash":
        gap = random.uniform(3e-4, 1e-3, joints)
        # The last joint hardly moves a reflector near its axis.
        return replace(faults, gap=np.where(np.append(random.permutation(joints - 1) < 2, False), gap, 0.0))
    if kind == "link":
        link = np.zeros((joints, 4))
        link[random.integers(1, joints - 2), :3] = random.uniform(0.3, 0.8) * np.array([1.0, 2e-3, 0.0])
        return replace(faults, link=link)
    return replace(faults, growth=float(random.uniform(0.9e-5, 1.4e-5))) if kind == "growth" else faults


def measure(file: MachineFile, faults: ArmFaults, random: np.random.Generator) -> tuple[ArmRig, Table]:
    spec = file.machine
    mechanism = build_mechanism(spec)
    low, high = np.clip(mechanism.limits().numpy(), -2.0, 2.0)
    q = random.uniform(0.8 * low, 0.8 * high, (ROWS, len(spec.joint)))
    warm = 20.0 + 7.0 * (1.0 - np.exp(-np.arange(ROWS) / 60.0))
    load = np.where(np.arange(ROWS) // 55 % 2 == 0, 0.0, 5.0)
    frame = rigid(random.uniform(-0.5, 0.5, 3), random.uniform(-800.0, 800.0, 3))
    rig = ArmRig(spec, faults, random.uniform(-30.0, 30.0, 3), frame, SIGMA)
    readings = rig.measure(q, load, warm, int(random.integers(1 << 30)))
    context = {"measured": readings, "payload_kg": load, "temp_c": warm, "time_s": 30.0 * np.arange(ROWS)}
    return rig, make_table(None, q, **context)


def look(file: MachineFile, table: Table) -> Diagnosis:
    return diagnose(Model(file), build_problem(file, table))


@pytest.mark.parametrize("name", ["ur10", pytest.param("kuka_iiwa", marks=pytest.mark.long)])
@pytest.mark.parametrize(  # links of a fresh arm are asked for in another file
    "kind", [pytest.param(kind, marks=pytest.mark.long) if kind == "link" else kind for kind in EXPECTED]
)
def test_hidden_fault_is_named_first(name: str, kind: str) -> None:
    file = arm(name)
    random = np.random.default_rng([len(name), len(kind)])
    _, table = measure(file, broken(kind, len(file.machine.joint), random), random)
    found = look(file, table)
    assert found.verdict == "missing", found.words
    assert [step[0] for step in found.suggested] == [EXPECTED[kind]], found.words


@pytest.mark.parametrize("name", ["ur10", pytest.param("kuka_iiwa", marks=pytest.mark.long)])
def test_sound_arm_gets_nothing_named(name: str) -> None:
    file = arm(name)
    _, table = measure(file, ArmFaults.none(len(file.machine.joint)), np.random.default_rng(5))
    found = look(file, table)
    assert found.verdict == "nothing-missing", found.words


@pytest.mark.parametrize("name", ["ur10", "kuka_iiwa", "assembly_robot"])
def test_sound_rig_agrees_with_the_mechanism(name: str) -> None:
    file = arm(name)
    spec, joints = file.machine, len(file.machine.joint)
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (40, joints))
    rig = ArmRig(spec, ArmFaults.none(joints), np.zeros(3), np.eye(4), 0.0)
    mine = rig.measure(q, np.zeros(40), np.full(40, spec.reference_temp_c), 0)
    torch.testing.assert_close(torch.tensor(mine), build_mechanism(spec).forward(torch.tensor(q)), rtol=0, atol=1e-9)


def test_link_weights_load_the_joints_as_the_rig_feels_them() -> None:
    file = arm("ur10")
    q = np.random.default_rng(4).uniform(-2.0, 2.0, (15, 6))
    load = np.linspace(0.0, 5.0, 15)
    rig = ArmRig(file.machine, ArmFaults.none(6), np.zeros(3), np.eye(4), 0.0)
    felt = rig.torques(q, load)
    seen = build_view(file, make_table(None, q, payload_kg=load)).axis_force()
    torch.testing.assert_close(seen, torch.tensor(felt), rtol=1e-5, atol=1e-2)


def test_mount_and_frame_are_found_beside_the_links() -> None:
    file = arm("ur10")
    random = np.random.default_rng(8)
    rig, table = measure(file, broken("link", 6, random), random)
    problem: Problem = build_problem(file, table)
    fitted = fit(Model(file) + make_effect(library(), "dh-offsets"), problem)
    assert problem.mounts == 1 and fitted.layout.names[-9:-6] == tuple(f"reflector mount {axis}" for axis in "xyz")
    mount = fitted.layout.see(problem, fitted.unknowns).mount
    assert mount is not None
    torch.testing.assert_close(mount[0], torch.tensor(rig.reflector_mm), rtol=0, atol=1.0)
    assert fitted.status == "converged" and 0.8 < fitted.chi2 / fitted.freedom < 1.2


def test_corrected_commands_mend_the_arm() -> None:
    """Perturbation compensation T(p - dp): measured again on the rig, unseen poses, tool point at the reflector."""
    file = arm("ur10", tool="trusted", frame="trusted")
    random = np.random.default_rng(12)
    faults = replace(
        broken("link", 6, random), compliance=np.array([0.0, 8e-9, 6e-9, 4e-9, 0.0, 0.0]), gap=np.full(6, 2e-4)
    )
    rig = ArmRig(file.machine, faults, np.zeros(3), np.eye(4), SIGMA)
    q = random.uniform(-1.5, 1.5, (ROWS, 6))
    load = np.where(np.arange(ROWS) % 3 == 0, 4.0, 0.0)
    warm = np.full(ROWS, 20.0)
    model = Model(file)
    for name in ("dh-offsets", "axis-compliance", "backlash"):
        model = model + make_effect(library(), name)
    table = make_table(None, q, rig.measure(q, load, warm, 1), payload_kg=load)
    model = fit(model, build_problem(file, table)).model
    fresh = random.uniform(-1.3, 1.3, (80, 6))
    wanted = build_mechanism(file.machine).forward(torch.tensor(fresh)).numpy()
    commands = compensate(model, make_table(None, fresh, payload_kg=2.0))
    good = commands.sent
    assert good.mean() > 0.95 and set(commands.status[~good]) <= {"near singular"}
    quiet, rows = replace(rig, sigma_mm=0.0), int(good.sum())
    before, after = (
        np.linalg.norm(quiet.measure(sent[good], np.full(rows, 2.0), warm[:rows], 2) - wanted[good], axis=1)
        for sent in (fresh, commands.q)
    )
    assert np.abs(commands.q - fresh)[good].max() < 0.02
    assert np.sqrt(np.mean(after**2)) < 0.05 * np.sqrt(np.mean(before**2)), (before.mean(), after.mean())


@pytest.mark.parametrize("name", ["screw-growth", "tower-tilt", "screw-error-map"])
def test_effects_of_sliders_say_that_they_do_not_apply(name: str) -> None:
    with pytest.raises(ModelError, match=f"'{name}' does not apply to a serial machine"):
        Model(arm("ur10")) + make_effect(library(), name)


def test_links_and_homing_are_refused_together() -> None:
    names = ["dh-offsets", "homing-offset"]
    for first, second in (names, names[::-1]):
        with pytest.raises(ModelError, match="'homing-offset' and the dtheta of 'dh-offsets' are one thing"):
            Model(arm("ur10")) + make_effect(library(), first) + make_effect(library(), second)


def test_uneven_joints_are_found_harmonic_by_harmonic() -> None:
    file = arm("ur10")
    random = np.random.default_rng(21)
    wobble = random.normal(0.0, 1e-4, (6, 20, 2))
    rig = ArmRig(file.machine, replace(ArmFaults.none(6), wobble=wobble), np.array([30.0, 10.0, 5.0]), np.eye(4), SIGMA)
    q = random.uniform(-np.pi, np.pi, (700, 6))
    readings = rig.measure(q, np.zeros(700), np.full(700, 20.0), 3)
    problem = build_problem(file, make_table(None, q, readings))
    fitted = fit(Model(file) + make_effect(library(), "joint-error-map"), problem)
    found = fitted.model.terms[0].theta[: 2 * 32 * 6].reshape(2, 6, 32)[:, :, :20]
    assert np.abs(found[0].numpy() - wobble[..., 0])[:5].max() < 3e-5
    assert np.abs(found[1].numpy() - wobble[..., 1])[:5].max() < 3e-5


@pytest.mark.parametrize(("law", "name"), [("zero", "homing-offset"), ("play", "backlash")])
def test_a_fault_of_one_joint_alone_has_its_name_and_is_no_unknown_of_that_joint(law: str, name: str) -> None:
    file, random, joint, size = load_machine(MACHINES / "ur10.toml"), np.random.default_rng(3), 4, 1e-3
    q = random.uniform(-1.4, 1.4, (240, 6))
    came, there = np.sign(np.diff(q[:, joint], prepend=2 * q[0, joint] - q[1, joint])), q.copy()
    there[:, joint] += size if law == "zero" else -size * came / 2
    measured = build_mechanism(file.machine).forward(torch.as_tensor(there)).numpy() + random.normal(0, 0.02, (240, 3))
    found = diagnose(Model(file), build_problem(file, make_table(None, q, measured=measured)))
    assert (found.verdict, found.suggested) == ("missing", ((name,),))


def uneven(waves: np.ndarray, reach: np.ndarray, rows: int) -> Diagnosis:
    """What is said of a UR10 whose joints turn unevenly, by waves (6, m, 2), and go as far as reach (6,) both ways."""
    file, random = load_machine(MACHINES / "ur10.toml"), np.random.default_rng(8)
    rig = ArmRig(
        file.machine, replace(ArmFaults.none(6), wobble=waves), np.array([30.0, 10.0, 5.0]), np.eye(4), 2 * SIGMA
    )
    q = random.uniform(-reach, reach, (rows, 6))
    return diagnose(Model(file), build_problem(file, make_table(None, q, rig.measure(q, *np.zeros((2, rows)), 4))))


@pytest.mark.long
def test_waves_of_one_joint_that_fall_off_are_no_unknown_of_that_joint() -> None:
    waves = np.zeros((6, 16, 2))
    waves[2] = np.random.default_rng(5).normal(0.0, 3e-4, (16, 2)) / np.arange(1, 17)[:, None]
    found = uneven(waves, np.full(6, 2.8), 620)
    assert (found.verdict, found.suggested) == ("missing", (("joint-error-map",),))


def test_a_joint_that_hardly_moves_hides_no_wave_of_the_others() -> None:
    waves = np.random.default_rng(5).normal(0.0, 2e-4, (6, 1, 2))
    found = uneven(waves, np.array([0.5, 1.8, 1.8, 1.8, 1.8, 1.8]), 380)
    assert (found.verdict, found.suggested) == ("missing", (("once-per-rev",),))


def test_zeros_that_the_model_moved_to_do_not_come_back_beside_link_geometry() -> None:
    """The dtheta of dh-offsets is the same thing: a model cannot have both, whichever of them came first."""

    def atom(name: str, *, moved_to: bool) -> Atom:
        effect, none = make_effect(library(), name), np.zeros(0, dtype=int)
        return Atom(name, name, none, none, np.zeros(0), 9.0, none.astype(bool), effect, None if moved_to else {})

    for first, second in (("homing-offset", "dh-offsets"), ("dh-offsets", "homing-offset")):
        atoms = {first: atom(first, moved_to=True), second: atom(second, moved_to=False)}
        scorer = Scorer(SimpleNamespace(atoms=atoms))
        assert not any(scorer.opens([there])(atoms[other]) for there, other in ((first, second), (second, first)))


def test_joints_that_yield_to_the_stated_weight_of_the_links_are_tied_with_sag() -> None:
    """Without payloads the two are one cause; a payload moves the joints of the first alone, and is asked for."""
    file, random = arm("ur10"), np.random.default_rng(3)
    masses = (7.1, 12.7, 4.3, 2.0, 2.0, 0.4)
    links = [
        link.model_copy(update={"mass_kg": mass, "com_mm": (0.0, 0.0, 0.0)})
        for link, mass in zip(file.machine.joint, masses, strict=True)
    ]
    file = replace(file, machine=file.machine.model_copy(update={"joint": tuple(links)}))
    low, high = np.clip(build_mechanism(file.machine).limits().numpy(), -2.0, 2.0)
    q = random.uniform(0.8 * low, 0.8 * high, (ROWS, 6))

    def energy(q: np.ndarray) -> np.ndarray:
        """Of weights at the origins of the links' frames, N mm."""
        found = np.zeros(len(q))
        for number, mass in enumerate(masses, start=1):
            part = file.machine.model_copy(update={"joint": tuple(links[:number]), "tool_mm": (0.0, 0.0, 0.0)})
            height = build_mechanism(part).forward(torch.as_tensor(q[:, :number])).numpy()[:, 2]
            found += mass * 9.80665 * height
        return found

    step = 1e-5 * np.eye(6)
    torque = np.stack([energy(q - each) - energy(q + each) for each in step], axis=1) / 2e-5
    went = q + np.array([0.0, 6e-9, 1e-8, 2e-8, 0.0, 0.0]) * torque
    readings = build_mechanism(file.machine).forward(torch.as_tensor(went)).numpy()
    readings += random.normal(0.0, SIGMA, readings.shape)
    found = look(file, make_table(None, q, measured=readings))
    assert found.suggested == (("axis-compliance", "self-weight"),), found.words
    assert "Either axis-compliance or self-weight" in found.words
    assert any("payloads" in line for line in found.measure_next)
