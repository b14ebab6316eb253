"""Sag under the arm's own weight: found beside the potential energy of a virtual arm, whichever way gravity points."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.effects.registry import library, make_effect
from ptt.effects.self_weight import link_lines
from ptt.errors import MachineError
from ptt.fitting.solve import fit
from ptt.machine import MachineFile, load_machine, parse_machine
from ptt.model.chain import predict
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model, parameter_names
from ptt.rig.draw_arm import draw_masses, unweighed
from ptt.rig.serial_arm import ArmFaults, ArmRig
from ptt.run.mounts import place_mounts
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
SIGMA = 0.01
DOWN, WALL, SLANTED = (0.0, 0.0, -1.0), (0.0, -1.0, 0.0), (0.5, 0.0, -2.0)
WAYS = [DOWN, WALL, SLANTED]


def arm(name: str, gravity: tuple[float, float, float] = DOWN, **machine: object) -> MachineFile:
    file = load_machine(MACHINES / f"{name}.toml")
    own = {"sigma_mm": SIGMA, "frame": "fitted", "tool": "fitted"}
    spec = unweighed(file.machine).model_copy(update={"gravity": gravity, **machine})
    return replace(file, machine=spec, tracker=file.tracker.model_copy(update=own))


def sagging(file: MachineFile, random: np.random.Generator) -> ArmRig:
    joints = len(file.machine.joint)
    soft = np.exp(random.uniform(np.log(2e-9), np.log(1.5e-8), joints))
    faults = replace(ArmFaults.none(joints), compliance=soft, mass=draw_masses(file.machine, random))
    return ArmRig(file.machine, faults, np.array([20.0, -10.0, 40.0]), np.eye(4), SIGMA)


def read(rig: ArmRig, q: np.ndarray, seed: int) -> np.ndarray:
    return rig.measure(q, np.zeros(len(q)), np.full(len(q), 20.0), seed)


def torques(rig: ArmRig, q: np.ndarray) -> np.ndarray:
    return rig.torques(q, 0.0)


@pytest.mark.parametrize("gravity", WAYS)
@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_levers_hold_every_torque_that_masses_can_make_and_no_more(convention: str, gravity: tuple) -> None:
    random = np.random.default_rng(2)
    file = arm("kuka_iiwa", gravity, convention=convention)
    q = random.uniform(-2.0, 2.0, (120, 7))
    effect = make_effect(library(), "self-weight")
    basis = effect.basis(build_view(file, make_table(None, q)), {}).numpy()
    felt = torques(sagging(file, random), q)
    owner = [int(name.split()[1].split(".")[0]) - 1 for name in parameter_names(effect, "serial", 7)]
    for joint in range(7):
        own = basis[:, joint][:, np.array(owner) == joint]
        assert not basis[:, joint][:, np.array(owner) != joint].any()
        rest = felt[:, joint] - own @ np.linalg.lstsq(own, felt[:, joint], rcond=1e-9)[0]
        assert np.abs(rest).max() < 1e-4 * max(np.abs(felt[:, joint]).max(), 1.0)
        assert np.linalg.matrix_rank(own, 1e-6) == (own.shape[1] if np.abs(felt[:, joint]).max() > 1.0 else 0)


@pytest.mark.parametrize(("name", "gravity"), [("ur10", WALL), ("kuka_iiwa", SLANTED)])
def test_sag_is_found_and_predicts_fresh_poses(name: str, gravity: tuple) -> None:
    random = np.random.default_rng(11)
    file = arm(name, gravity)
    rig = sagging(file, random)
    joints = len(file.machine.joint)
    q, fresh = random.uniform(-2.0, 2.0, (300, joints)), random.uniform(-2.0, 2.0, (100, joints))
    table = make_table(
        None, np.vstack([q, fresh]), np.vstack([read(rig, q, 3), read(replace(rig, sigma_mm=0.0), fresh, 0)])
    )
    problem = build_problem(file, table)
    told = np.arange(400) >= 300
    plain = fit(Model(file), problem.masked(told)).residual[told]
    fitted = fit(Model(file) + make_effect(library(), "self-weight"), problem.masked(told))
    assert fitted.status == "converged" and 0.85 < fitted.chi2 / fitted.freedom < 1.15
    before, after = (np.sqrt(np.square(residual).sum(axis=1).mean()) for residual in (plain, fitted.residual[told]))
    assert before > 0.2 and after < SIGMA, (before, after)


def test_amplitudes_are_compliance_times_moment() -> None:
    """One mass on the forearm: the elbow sags by compliance x weight x distance, and the shoulder by its own."""
    file = arm(
        "ur10", joint=tuple(link.model_copy() for link in unweighed(load_machine(MACHINES / "ur10.toml").machine).joint)
    )
    mass = np.zeros((6, 4))
    mass[2] = [4.0, 300.0, 0.0, 50.0]
    soft = np.array([0.0, 4e-9, 9e-9, 0.0, 0.0, 0.0])
    rig = ArmRig(file.machine, replace(ArmFaults.none(6), compliance=soft, mass=mass), np.zeros(3), np.eye(4), 1e-4)
    q = np.random.default_rng(1).uniform(-2.5, 2.5, (200, 6))
    trusted = replace(
        file, tracker=file.tracker.model_copy(update={"frame": "trusted", "tool": "trusted", "sigma_mm": 1e-4})
    )
    problem = build_problem(trusted, make_table(None, q, read(rig, q, 5)))
    fitted = fit(Model(trusted) + make_effect(library(), "self-weight"), problem)
    (term,) = fitted.model.terms
    found = dict(zip(parameter_names(term.effect, "serial", 6), term.theta.tolist(), strict=True))
    weight = 4.0 * 9.80665
    # The link's far end lies 572.3 mm along -x of its joint, so the mass hangs 272.3 mm from the elbow.
    expected = {
        "along_rad 3.3": -272.3 * weight * 9e-9,
        "along_rad 2.3": -272.3 * weight * 4e-9,
        "along_rad 2.2": -612.0 * weight * 4e-9,
    }
    for name, value in found.items():
        assert abs(value - expected.get(name, 0.0)) < 2e-6, (name, value)


def test_the_wrong_way_of_gravity_does_not_explain_the_sag() -> None:
    random = np.random.default_rng(4)
    wall = arm("ur10", WALL)
    rig = sagging(wall, random)
    q = random.uniform(-2.0, 2.0, (250, 6))
    table = make_table(None, q, read(rig, q, 2))
    left = []
    for file in (wall, arm("ur10", DOWN)):
        problem = build_problem(file, table)
        fitted = fit(Model(file) + make_effect(library(), "self-weight"), problem)
        left.append(fitted.chi2 / fitted.freedom)
    assert left[0] < 1.15 and left[1] > 10.0


def test_an_arm_that_only_turns_about_plumb_axes_cannot_show_it() -> None:
    links = "[[machine.joint]]\na_mm = 300.0\n" * 3
    file = parse_machine(f'[machine]\nkind = "serial"\nconvention = "standard"\n{links}')
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (30, 3))
    view = build_view(file, make_table(None, q))
    assert make_effect(library(), "self-weight").needs(view) == "poses that turn the arm against gravity"


def test_gravity_of_no_direction_is_refused() -> None:
    text = '[machine]\nkind = "serial"\nconvention = "standard"\ngravity = [0, 0, 0]\n[[machine.joint]]\na_mm = 300.0\n'
    with pytest.raises(MachineError, match="gravity"):
        parse_machine(text)


def test_payload_pulls_along_the_machines_gravity() -> None:
    file = arm("ur10", WALL)
    q = np.random.default_rng(6).uniform(-2.0, 2.0, (12, 6))
    load = np.full(12, 3.0)
    rig = ArmRig(file.machine, ArmFaults.none(6), np.zeros(3), np.eye(4), 0.0)
    felt = rig.torques(q, 3.0)
    seen = build_view(file, make_table(None, q, payload_kg=load)).axis_force()
    torch.testing.assert_close(seen, torch.tensor(felt), rtol=1e-5, atol=1e-2)


def test_zero_sag_is_nominal_and_a_saved_model_reads_back() -> None:
    file = arm("ur10")
    random = np.random.default_rng(3)
    q = random.uniform(-2.0, 2.0, (80, 6))
    problem = build_problem(file, make_table(None, q, read(sagging(file, random), q, 1)))
    fitted = fit(Model(file) + make_effect(library(), "self-weight"), problem).model
    again = read_model(write_model(fitted))
    terms = [[(term.effect, term.theta) for term in model.terms] for model in (fitted, again)]
    assert torch.equal(predict(terms[0], problem.view).p, predict(terms[1], problem.view).p)


def test_payload_hangs_on_the_tool_wherever_the_reflector_sits() -> None:
    file = arm("ur10")
    q = np.random.default_rng(7).uniform(-2.0, 2.0, (10, 6))
    rig = ArmRig(file.machine, ArmFaults.none(6), np.array([60.0, -40.0, 80.0]), np.eye(4), 0.0)
    felt = rig.torques(q, 3.0)
    view = build_view(file, make_table(None, q, payload_kg=np.full(10, 3.0)))
    seen = place_mounts(view, np.zeros(10, dtype=int), rig.reflector_mm[None]).axis_force()
    torch.testing.assert_close(seen, torch.tensor(felt), rtol=1e-5, atol=1e-2)


@pytest.mark.long
def test_stated_errors_hold_the_true_amplitudes() -> None:
    """The truth is the rig's own torque times compliance, spread over the levers of the poses driven."""
    pulls = []
    for seed, name in enumerate(("ur10", "kuka_iiwa")):
        random = np.random.default_rng(seed)
        file = arm(name)
        rig = sagging(file, random)
        q = random.uniform(-2.0, 2.0, (220, len(file.machine.joint)))
        problem = build_problem(file, make_table(None, q, read(rig, q, seed)))
        (term,) = fit(Model(file) + make_effect(library(), "self-weight"), problem).model.terms
        basis = term.effect.basis(problem.view, {}).numpy()
        sag = torques(rig, q) * rig.faults.compliance
        true = sum(np.linalg.lstsq(basis[:, joint], sag[:, joint], rcond=1e-9)[0] for joint in range(q.shape[1]))
        assert term.std is not None and term.measured is not None
        pulls.append(((term.theta.numpy() - true) / term.std.numpy())[term.measured.numpy()])
    every = np.abs(np.concatenate(pulls))
    assert len(every) > 50 and every.max() < 5.0 and (every < 2.0).mean() > 0.9, (len(every), every.max())


MOUNT = """
[machine]
kind = "serial"
convention = "CONVENTION"
tool_mm = [1000.0, 0.0, 0.0]
joint = JOINTS
[tracker]
frame = "trusted"
sigma_mm = 0.03
"""
AXES = {"standard": "[{ alpha_deg = 90 }, {}]", "modified": "[{}, { alpha_deg = 90 }]"}


@pytest.mark.parametrize("convention", list(AXES))
def test_a_tube_that_sags_is_no_tube_that_is_out_of_balance(convention: str) -> None:
    """Over the altitudes of a sky cosine, sine and an offset look alike: a tube's mass lies along it."""
    file = parse_machine(MOUNT.replace("CONVENTION", convention).replace("JOINTS", AXES[convention]))
    offset, sag, found = -8e-5, 5e-5, []
    low, high = np.radians([[-180.0, 25.0], [180.0, 85.0]])
    for seed in range(6):
        random = np.random.default_rng(seed)
        q = random.uniform(low, high, (200, 2))
        stands = q + np.column_stack([np.zeros(200), offset - sag * np.cos(q[:, 1])])
        read = build_view(file, make_table(None, stands)).p.numpy() + random.normal(0.0, 0.03, (200, 3))
        model = Model(file) + make_effect(library(), "homing-offset") + make_effect(library(), "self-weight")
        terms = fit(model, build_problem(file, make_table(None, q, read))).model.terms
        names = [name for term in terms for name in parameter_names(term.effect, "serial", 2)]
        value = dict(zip(names, np.concatenate([term.theta.numpy() for term in terms]), strict=True))
        found.append([value["offset_rad 2"] - offset, value["across_rad 2.2"], abs(value["along_rad 2.2"]) - sag])
    error = np.sqrt(np.square(found).mean(axis=0)) / sag
    assert (error < [0.3, 0.15, 0.35]).all(), error  # alike in size, they would be off by 0.8, 0.6 and 0.5


def test_the_drawing_tells_along_which_line_the_mass_of_a_link_lies() -> None:
    """By the far end of each link; what hangs along the next axis counts with the link before it."""
    for convention in ("standard", "modified"):
        file = arm("kuka_iiwa", convention=convention)
        mechanism = build_view(file, make_table(None, np.zeros((4, 7)))).mechanism
        q = torch.tensor(np.random.default_rng(4).uniform(-np.pi, np.pi, (20, 7)))
        half = torch.pi * torch.cartesian_prod(*[torch.arange(2, dtype=torch.float64)] * 7)
        q = (q[:, None] + half).reshape(-1, 7)
        chain, tip = mechanism.walk(q), mechanism.forward(q)
        for link, line in zip(chain, link_lines(mechanism), strict=True):
            away = tip - link.before_z.origin
            across = torch.linalg.cross(link.before_z.z.expand_as(away), link.end.x.expand_as(away))
            seen = [float((away * way).sum(dim=-1).mean()) for way in (link.end.x, across)]
            # half turns of the joints behind take out all but their axes
            torch.testing.assert_close(torch.tensor(seen, dtype=torch.float64), line, atol=1e-6, rtol=0.0)
