import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ptt.commands.main import run
from ptt.machine import load_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.dexterity import condition_number, manipulability
from ptt.mechanisms.dexterity_serial import (
    dexterity_map,
    joint_map,
    most_isotropic,
    nearest_singular,
    scaled_jacobian,
)
from ptt.mechanisms.rotations import (
    from_quaternion,
    quaternion_of,
    rotation_vector,
)
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_inverse import middle, solve_inverse, spread
from ptt.model.chain import predict
from ptt.model.entries import read_model
from ptt.run.table import make_table
from ptt.run.viewing import build_view

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
# torch itself still scripts its forward-mode formulas on first use
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")
PRESETS = ("kuka_iiwa", "assembly_robot", "ur10")


def preset(name: str) -> Serial:
    return Serial.from_spec(load_machine(MACHINES / f"{name}.toml").machine)


@pytest.fixture(params=PRESETS)
def arm(request) -> Serial:
    return preset(request.param)


def some_joints(arm: Serial, n: int, seed: int = 0) -> torch.Tensor:
    low, high = arm.limits().clamp(-2 * torch.pi, 2 * torch.pi)
    return low + (high - low) * torch.rand(n, arm.joints, dtype=torch.float64, generator=generator(seed))


def some_errors(arm: Serial, n: int, seed: int = 1, size: float = 0.01) -> torch.Tensor:
    return size * torch.randn(n, len(arm.slots), dtype=torch.float64, generator=generator(seed))


def generator(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def close(actual, expected, tolerance: float) -> None:
    actual, expected = (torch.as_tensor(value, dtype=torch.float64) for value in (actual, expected))
    torch.testing.assert_close(actual, expected, rtol=0.0, atol=tolerance)


# --- an independent chain: 4x4 matrices from axis-angle exponentials, one pose at a time


def elementary(kind: str, axis: int, value: float) -> np.ndarray:
    matrix = np.eye(4)
    if kind == "shift":
        matrix[axis, 3] = value
        return matrix
    u, v = (axis + 1) % 3, (axis + 2) % 3
    matrix[u, u] = matrix[v, v] = math.cos(value)
    matrix[v, u], matrix[u, v] = math.sin(value), -math.sin(value)
    return matrix


def reference_pose(arm: Serial, q, errors=None) -> np.ndarray:
    errors = np.zeros(len(arm.slots)) if errors is None else np.asarray(errors)
    pose = np.eye(4)
    for i in range(arm.joints):
        da, dalpha, dd, dtheta, dbeta = errors[5 * i : 5 * i + 5]
        screw_z = elementary("turn", 2, float(q[i]) + arm.offset_rad[i] + dtheta) @ elementary(
            "shift", 2, arm.d_mm[i] + dd
        )
        screw_x = (
            elementary("shift", 0, arm.a_mm[i] + da)
            @ elementary("turn", 0, arm.alpha_rad[i] + dalpha)
            @ elementary("turn", 1, dbeta)
        )
        pose = pose @ (screw_z @ screw_x if arm.convention == "standard" else screw_x @ screw_z)
    shift = np.eye(4)
    shift[:3, 3] = np.asarray(arm.tool_mm) + errors[-3:]
    return pose @ shift


def stacked_reference(arm: Serial, q, errors=None) -> torch.Tensor:
    rows = [reference_pose(arm, q[i], None if errors is None else errors[i]) for i in range(len(q))]
    return torch.from_numpy(np.stack(rows))


# --- forward


def test_forward_and_pose_match_matrix_products(arm):
    q = some_joints(arm, 50)
    expected = stacked_reference(arm, q)
    p, rotation = arm.pose(q)
    close(arm.forward(q), expected[:, :3, 3], 1e-9)
    close(p, expected[:, :3, 3], 1e-9)
    close(rotation, expected[:, :3, :3], 1e-12)


def test_geometry_errors_match_matrix_products(arm):
    q, errors = some_joints(arm, 30), some_errors(arm, 30, size=0.1)
    expected = stacked_reference(arm, q, errors.numpy())
    p, rotation = arm.pose(q, errors)
    close(arm.forward(q, errors), expected[:, :3, 3], 1e-9)
    close(p, expected[:, :3, 3], 1e-9)
    close(rotation, expected[:, :3, :3], 1e-12)


def test_zero_errors_are_the_drawing(arm):
    q = some_joints(arm, 20)
    zero = torch.zeros(1, len(arm.slots), dtype=torch.float64)
    close(arm.forward(q, zero), arm.forward(q), 1e-12)


def test_batch_equals_loop_and_shared_errors_equal_repeated_ones(arm):
    q, errors = some_joints(arm, 8), some_errors(arm, 1)
    together = arm.forward(q, errors)
    close(together, arm.forward(q, errors.expand(8, -1)), 1e-12)
    close(together, torch.stack([arm.forward(row, errors[0]) for row in q]), 1e-12)
    assert arm.forward(q[:0]).shape == (0, 3)


def test_slots_are_named_in_the_order_they_act(arm):
    assert len(arm.slots) == 5 * arm.joints + 3 == len(set(arm.slots))
    q = some_joints(arm, 1)
    tool_x = torch.zeros(1, len(arm.slots), dtype=torch.float64)
    tool_x[0, arm.slots.index("tool x [mm]")] = 2.0
    p, rotation = arm.pose(q)
    close(arm.forward(q, tool_x), p + 2.0 * rotation[:, :, 0], 1e-9)
    turned = torch.zeros(1, len(arm.slots), dtype=torch.float64)
    turned[0, arm.slots.index("joint 2 dtheta [rad]")] = 0.1
    q2 = q + 0.1 * torch.eye(arm.joints, dtype=torch.float64)[1]
    close(arm.forward(q, turned), arm.forward(q2), 1e-9)


def test_frames_end_at_the_tool(arm):
    q, errors = some_joints(arm, 6), some_errors(arm, 6)
    origins, rotations = arm.frames(q, errors)
    assert origins.shape == (6, arm.joints, 3)
    assert rotations.shape == (6, arm.joints, 3, 3)
    tool = torch.tensor(arm.tool_mm, dtype=torch.float64) + errors[:, -3:]
    close(origins[:, -1] + (rotations[:, -1] @ tool[..., None]).squeeze(-1), arm.forward(q, errors), 1e-9)
    # distances along a link do not depend on the pose
    lengths = torch.linalg.vector_norm(arm.frames(q)[0].diff(dim=1), dim=-1)
    close(lengths, lengths[:1].expand_as(lengths), 1e-9)


def test_reach_is_never_exceeded_and_attained_by_the_stretched_iiwa(arm):
    assert float(torch.linalg.vector_norm(arm.forward(spread(arm, 2000)), dim=-1).max()) <= arm.reach_mm
    iiwa = preset("kuka_iiwa")
    close(torch.linalg.vector_norm(iiwa.forward(iiwa.home())), iiwa.reach_mm, 1e-9)


def test_parallel_axes():
    assert preset("ur10").parallel_axes() == (False, True, True, False, False, False)
    assert preset("assembly_robot").parallel_axes() == (False, True, True, False)
    assert preset("kuka_iiwa").parallel_axes() == (False,) * 7
    modified = parse_machine(
        '[machine]\nkind = "serial"\nconvention = "modified"\n[[machine.joint]]\n[[machine.joint]]\na_mm = 300.0\n'
        "[[machine.joint]]\nalpha_deg = 90.0\n"
    )
    assert Serial.from_spec(modified.machine).parallel_axes() == (False, True, False)


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_where_axes_are_parallel_dd_repeats_its_neighbour_and_dbeta_is_new(convention):
    arm = planar((300.0, 250.0), convention)
    pair = 0 if convention == "standard" else 1
    assert arm.parallel_axes()[pair]
    jacobian = arm.geometry_jacobian(some_joints(arm, 12))
    close(jacobian[..., 2], jacobian[..., 7], 1e-12)  # dd of joint 1 and of joint 2
    beta = jacobian[..., 5 * pair + 4].flatten()
    others = [i for i in range(len(arm.slots)) if i % 5 != 4 or i >= 10]
    rest = jacobian[..., others].movedim(-1, 0).flatten(1).T
    fit = torch.linalg.lstsq(rest, beta[:, None], driver="gelsd").solution
    assert float(torch.linalg.vector_norm(rest @ fit - beta[:, None])) > 0.05 * float(torch.linalg.vector_norm(beta))


def planar(lengths: tuple[float, ...], convention: str = "standard") -> Serial:
    k = len(lengths)
    a, tool = (lengths, 0.0) if convention == "standard" else ((0.0, *lengths[:-1]), lengths[-1])
    zero = (0.0,) * k
    return Serial("planar", convention, a, zero, zero, zero, (tool, 0.0, 0.0), ((-math.inf, math.inf),) * k)


def test_both_conventions_describe_the_same_planar_arm():
    q = torch.randn(20, 3, dtype=torch.float64, generator=generator(3))
    lengths = (300.0, 200.0, 100.0)
    close(planar(lengths).forward(q), planar(lengths, "modified").forward(q), 1e-9)
    reach = torch.tensor(lengths, dtype=torch.float64)
    angle = q.cumsum(-1)
    expected = torch.stack([(reach * angle.cos()).sum(-1), (reach * angle.sin()).sum(-1), 0 * q[:, 0]], -1)
    close(planar(lengths).forward(q), expected, 1e-9)


def test_build_mechanism_gives_the_arm():
    assert build_mechanism(load_machine(MACHINES / "ur10.toml").machine) == preset("ur10")


# --- peers from the package index


def test_against_roboticstoolbox(arm):
    rtb = pytest.importorskip("roboticstoolbox")
    link = rtb.RevoluteDH if arm.convention == "standard" else rtb.RevoluteMDH
    rows = zip(arm.a_mm, arm.alpha_rad, arm.d_mm, arm.offset_rad, strict=True)
    tool = np.eye(4)
    tool[:3, 3] = arm.tool_mm
    peer = rtb.DHRobot([link(a=a, alpha=alpha, d=d, offset=offset) for a, alpha, d, offset in rows], tool=tool)
    q = some_joints(arm, 25)
    p, rotation = arm.pose(q)
    expected = np.stack([peer.fkine(row).A for row in q.numpy()])
    close(p, expected[:, :3, 3], 1e-9)
    close(rotation, expected[:, :3, :3], 1e-9)
    close(arm.pose_jacobian(q), np.stack([peer.jacob0(row) for row in q.numpy()]), 1e-9)


def test_against_pybotics(arm):
    robot = pytest.importorskip("pybotics.robot")
    tool = pytest.importorskip("pybotics.tool").Tool(matrix=np.eye(4))
    a, alpha = list(arm.a_mm), list(arm.alpha_rad)
    matrix = np.eye(4)
    matrix[:3, 3] = arm.tool_mm
    if arm.convention == "standard":  # the peer knows the modified convention only: each x screw moves to the next link
        last = elementary("shift", 0, a[-1]) @ elementary("turn", 0, alpha[-1])
        matrix, a, alpha = last @ matrix, [0.0, *a[:-1]], [0.0, *alpha[:-1]]
    tool.matrix = matrix
    peer = robot.Robot.from_parameters(np.array(list(zip(alpha, a, arm.offset_rad, arm.d_mm, strict=True))).ravel())
    peer.tool = tool
    q = some_joints(arm, 25)
    p, rotation = arm.pose(q)
    expected = np.stack([peer.fk(row) for row in q.numpy()])
    close(p, expected[:, :3, 3], 1e-9)
    close(rotation, expected[:, :3, :3], 1e-9)
    close(arm.pose_jacobian(q), np.stack([peer_jacobian(robot, peer, row) for row in q.numpy()]), 1e-9)
    if arm.joints == 6:  # the peer's own Jacobian is written for six joints
        close(arm.pose_jacobian(q), np.stack([peer.jacobian_world(row) for row in q.numpy()]), 1e-9)


def peer_jacobian(robot, peer, q: np.ndarray) -> np.ndarray:
    """The geometric Jacobian from the axes that the peer's forward kinematics of ever longer chains gives."""
    parameters, tip = np.asarray(peer.kinematic_chain.vector), peer.fk(q)[:3, 3]
    columns = []
    for joint in range(1, len(q) + 1):
        frame = robot.Robot.from_parameters(parameters[: 4 * joint].copy()).fk(q[:joint])
        columns.append(np.concatenate([np.cross(frame[:3, 2], tip - frame[:3, 3]), frame[:3, 2]]))
    return np.stack(columns, axis=-1)


# --- derivatives


def test_joint_jacobian_matches_autograd(arm):
    q, errors = some_joints(arm, 20), some_errors(arm, 20)
    expected = torch.func.vmap(torch.func.jacfwd(arm.forward))(q, errors)
    close(arm.jacobian(q, errors), expected, 1e-9)
    close(arm.jacobian(q), arm.jacobian(q, torch.zeros_like(errors)), 1e-9)


def test_geometry_jacobian_matches_autograd(arm):
    q, errors = some_joints(arm, 20), some_errors(arm, 20)
    expected = torch.func.vmap(torch.func.jacfwd(arm.forward, argnums=1))(q, errors)
    close(arm.geometry_jacobian(q, errors)[:, :3], expected, 1e-9)


def test_angular_rows_match_autograd(arm):
    q, errors = some_joints(arm, 10), some_errors(arm, 10)

    def spin(q_row, errors_row, argnum):
        rotation = arm.pose(q_row, errors_row)[1]
        change = torch.func.jacfwd(lambda *x: arm.pose(*x)[1], argnums=argnum)(q_row, errors_row)
        skew = torch.einsum("ijm,kj->mik", change, rotation)
        return torch.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])

    by_joint = torch.func.vmap(lambda a, b: spin(a, b, 0))(q, errors)
    by_slot = torch.func.vmap(lambda a, b: spin(a, b, 1))(q, errors)
    close(arm.pose_jacobian(q, errors)[:, 3:], by_joint, 1e-9)
    close(arm.geometry_jacobian(q, errors)[:, 3:], by_slot, 1e-9)


def test_jacobians_match_finite_differences(arm):
    q, step = some_joints(arm, 5), 1e-6
    for j in range(arm.joints):
        shift = step * torch.eye(arm.joints, dtype=torch.float64)[j]
        numeric = (arm.forward(q + shift) - arm.forward(q - shift)) / (2 * step)
        close(arm.jacobian(q)[..., j], numeric, 1e-6)


def test_jvp_and_reverse_mode_agree(arm):
    q, errors = some_joints(arm, 4), some_errors(arm, 1)
    tangent = torch.ones_like(errors)
    _, forward_mode = torch.func.jvp(lambda x: arm.forward(q, x), (errors,), (tangent,))
    reverse = torch.func.jacrev(lambda x: arm.forward(q, x))(errors)
    close(forward_mode, (reverse * tangent).sum((-1, -2)), 1e-9)


# --- inverse


@pytest.mark.parametrize("with_rotation", [False, True])
def test_inverse_reaches_the_pose_from_near(arm, with_rotation):
    q = some_joints(arm, 400)
    low, high = arm.limits()
    noise = torch.rand(q.shape, dtype=torch.float64, generator=generator(5)) - 0.5
    near = torch.clamp(q + 0.4 * noise, low, high)
    p, rotation = arm.pose(q)
    result = solve_inverse(arm, p, rotation=rotation if with_rotation else None, near=near)
    assert float(result.converged.double().mean()) >= 0.99
    found = result.q[result.converged]
    reached, turned = arm.pose(found)
    close(reached, p[result.converged], 2e-9)
    if with_rotation:
        close(turned, rotation[result.converged], 1e-10)
    assert bool(((found >= low) & (found <= high)).all())
    assert bool(torch.isnan(result.q[~result.converged]).all())


@pytest.mark.parametrize("with_rotation", [False, True])
def test_inverse_needs_no_start(arm, with_rotation):
    q = some_joints(arm, 120, seed=7)
    p, rotation = arm.pose(q)
    result = solve_inverse(arm, p, rotation=rotation if with_rotation else None)
    assert float(result.converged.double().mean()) >= 0.99
    close(arm.forward(result.q[result.converged]), p[result.converged], 2e-9)


def test_inverse_from_the_answer_is_the_answer(arm):
    q = some_joints(arm, 50)
    close(arm.inverse(arm.forward(q), near=q), q, 1e-9)


def test_inverse_with_geometry_errors_lands_on_the_target(arm):
    q, errors = some_joints(arm, 200), some_errors(arm, 1, size=2e-3)
    p = arm.forward(q, errors)
    near = q + 1e-3
    for geometry in (errors, errors.expand(200, -1)):
        found = arm.inverse(p, geometry, near)
        ok = torch.isfinite(found).all(-1)
        assert float(ok.double().mean()) >= 0.99
        close(arm.forward(found[ok], errors), p[ok], 2e-9)


def test_inverse_says_nan_where_it_cannot(arm):
    far = torch.tensor([[2 * arm.reach_mm, 0.0, 0.0], [math.nan, 0.0, 0.0]], dtype=torch.float64)
    good = arm.forward(middle(arm)[None])
    result = solve_inverse(arm, torch.cat([far, good]))
    assert result.converged.tolist() == [False, False, True]
    assert bool(torch.isnan(result.q[:2]).all())
    assert bool(torch.isinf(result.error_mm[:2]).all())
    assert arm.inverse(good[:0]).shape == (0, arm.joints)


def test_inverse_just_out_of_reach_gives_up():
    arm = planar((300.0, 200.0))
    p = torch.tensor([[500.001, 0.0, 0.0], [499.0, 0.0, 0.0], [99.0, 0.0, 0.0], [101.0, 0.0, 0.0]], dtype=torch.float64)
    assert solve_inverse(arm, p, starts=3).converged.tolist() == [False, True, False, True]


def test_limits_refuse_what_lies_behind_them():
    free, held = planar((300.0, 200.0)), ((-0.5, 0.5), (0.0, 2.5))
    arm = Serial(**{**vars(free), "limits_rad": held})
    inside = torch.tensor([[0.2, 1.0]], dtype=torch.float64)
    close(arm.inverse(arm.forward(inside)), inside, 1e-9)
    behind = free.forward(torch.tensor([[2.0, 1.0]], dtype=torch.float64))
    assert bool(solve_inverse(free, behind).converged)
    assert not bool(solve_inverse(arm, behind).converged)


def test_redundant_arm_stays_as_near_as_it_can():
    arm = preset("kuka_iiwa")
    q = 0.6 * some_joints(arm, 60)
    p, rotation = arm.pose(q)
    near = q + 0.05 * torch.randn(q.shape, dtype=torch.float64, generator=generator(2))
    found = arm.inverse(p, near=near, rotation=rotation)
    distance = torch.linalg.vector_norm(found - near, dim=-1)
    assert bool((distance <= torch.linalg.vector_norm(q - near, dim=-1) + 1e-9).all())
    # nothing of the way back to `near` lies along the self-motion
    self_motion = torch.linalg.svd(arm.pose_jacobian(found))[2][:, -1]
    close(((near - found) * self_motion).sum(-1), torch.zeros(60), 1e-6)


@settings(max_examples=12, deadline=None)
@given(
    lengths=st.lists(st.floats(50.0, 400.0), min_size=2, max_size=4),
    angles=st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4),
    convention=st.sampled_from(["standard", "modified"]),
)
def test_inverse_undoes_forward_for_any_planar_arm(lengths, angles, convention):
    arm = planar(tuple(lengths), convention)
    q = torch.tensor([angles[: arm.joints]], dtype=torch.float64)
    p = arm.forward(q)
    found = arm.inverse(p, near=q + 0.05)
    # a stretched or folded arm stands on the edge of its reach, where a root is double
    if float(manipulability(arm.jacobian(q)[:, :2])) > 0.01 * max(lengths) ** 2:
        close(arm.forward(found), p, 2e-9)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), name=st.sampled_from(PRESETS))
def test_turning_the_first_joint_turns_the_tool_about_the_base(seed, name):
    arm = preset(name)
    q = some_joints(arm, 1, seed)
    turn = torch.zeros_like(q)
    turn[0, 0] = 0.7
    about_z = torch.from_numpy(elementary("turn", 2, 0.7)[:3, :3])
    close(arm.forward(q + turn), arm.forward(q) @ about_z.T, 1e-9)
    close(condition_number(scaled_jacobian(arm, q + turn)) / condition_number(scaled_jacobian(arm, q)), [1.0], 1e-6)


# --- orientation


ANGLE = st.floats(-math.pi, math.pi)


def turned(alpha: float, beta: float, gamma: float) -> torch.Tensor:
    """Rot(z, alpha) Rot(x, beta) Rot(z, gamma)."""
    product = elementary("turn", 2, alpha) @ elementary("turn", 0, beta) @ elementary("turn", 2, gamma)
    return torch.from_numpy(product[:3, :3])


def about(vector: torch.Tensor) -> torch.Tensor:
    """The rotation of a rotation vector near zero, by its definition; farther off torch keeps ten digits of it."""
    x, y, z = vector.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.linalg.matrix_exp(torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3))


@settings(max_examples=100, deadline=None)
@example(vector=(0.0, 0.03125, 0.0))
@given(vector=st.tuples(ANGLE, st.sampled_from([0.0, 1e-9, 0.3, 1.5, math.pi]) | ANGLE, ANGLE))
def test_quaternion_and_rotation_vector_rebuild_the_rotation(vector):
    rotation = turned(*vector)
    close(rotation @ rotation.T, torch.eye(3), 1e-12)
    close(torch.linalg.det(rotation), 1.0, 1e-12)
    close(from_quaternion(quaternion_of(rotation)), rotation, 1e-12)
    close(torch.from_numpy(Rotation.from_rotvec(rotation_vector(rotation).numpy()).as_matrix()), rotation, 1e-12)


def test_rotation_vector_is_smooth_at_no_rotation():
    jacobian = torch.func.jacfwd(lambda v: rotation_vector(about(v)))(torch.zeros(3, dtype=torch.float64))
    close(jacobian, torch.eye(3), 1e-12)
    tiny = torch.tensor([1e-10, -2e-10, 3e-10], dtype=torch.float64)
    close(rotation_vector(about(tiny)), tiny, 1e-20)


# --- dexterity


def iiwa_at(**degrees: float) -> torch.Tensor:
    values = {"q1": 20.0, "q2": 25.0, "q3": 30.0, "q4": 40.0, "q5": 35.0, "q6": 50.0, "q7": 60.0, **degrees}
    return torch.tensor([[math.radians(value) for value in values.values()]], dtype=torch.float64)


SINGULAR = {
    "elbow": {"q4": 0.0},
    "shoulder": {"q2": 90.0, "q3": 90.0},
    "wrist": {"q6": 0.0, "q5": 90.0},
    "shoulder and wrist": {"q2": 90.0, "q6": 0.0},
}


@pytest.mark.parametrize("case", SINGULAR)
def test_iiwa_is_singular_where_theory_says(case):
    arm, q = preset("kuka_iiwa"), iiwa_at(**SINGULAR[case])
    regular = float(manipulability(scaled_jacobian(arm, iiwa_at())))
    assert regular > 0.1
    assert float(manipulability(scaled_jacobian(arm, q))) < 1e-12 * regular
    assert float(condition_number(scaled_jacobian(arm, q))) > 1e12
    # a degree aside it is near, not singular
    aside = iiwa_at(**{joint: value + 1.0 for joint, value in SINGULAR[case].items()})
    assert 1e-5 < float(manipulability(scaled_jacobian(arm, aside))) < 0.1 * regular


@pytest.mark.parametrize("case", [{"q2": 90.0}, {"q6": 0.0}])
def test_iiwa_avoids_shoulder_and_wrist_singularities_by_its_spare_joint(case):
    assert float(manipulability(scaled_jacobian(preset("kuka_iiwa"), iiwa_at(**case)))) > 0.1


def test_spherical_shoulder_and_wrist_of_the_iiwa_follow_their_middle_joint():
    arm, q = preset("kuka_iiwa"), some_joints(preset("kuka_iiwa"), 200)
    turning = scaled_jacobian(arm, q, "orientation")
    close(manipulability(turning[..., 4:]), q[:, 5].sin().abs(), 1e-12)
    close(manipulability(turning[..., :3]), q[:, 1].cos().abs(), 1e-12)
    close(manipulability(turning[..., 2:5]), q[:, 3].sin().abs(), 1e-12)


def test_nearest_singular_finds_the_families_of_the_iiwa():
    arm = preset("kuka_iiwa")
    q, ratio = nearest_singular(arm, spread(arm, 100))
    found = q[ratio < 1e-8]
    assert len(found) >= 80
    q2, q3, q4, q5, q6 = (found[:, i] for i in range(1, 6))
    elbow = q4.sin().abs() < 1e-3  # where two families cross, each is met to the root of the precision only
    shoulder = torch.maximum(q2.cos().abs(), q3.cos().abs()) < 1e-3
    wrist = torch.maximum(q6.sin().abs(), q5.cos().abs()) < 1e-3
    both = torch.maximum(q2.cos().abs(), q6.sin().abs()) < 1e-3
    assert bool((elbow | shoulder | wrist | both).all())
    assert bool(elbow.any())
    assert bool(shoulder.any())


def test_two_link_arm_is_isotropic_where_the_textbook_says():
    # Salisbury and Craig: links in the ratio sqrt(2) to 1, elbow at 135 degrees
    arm = planar((math.sqrt(2.0) * 100.0, 100.0))
    q = torch.tensor([[0.3, math.radians(135.0)]], dtype=torch.float64)
    close(condition_number(arm.jacobian(q)), [1.0], 1e-12)
    close(manipulability(arm.jacobian(q)), [1e4], 1e-8)
    found, number = most_isotropic(arm, "position")
    assert number == pytest.approx(1.0, abs=1e-3)
    assert abs(math.cos(float(found[1])) - math.cos(math.radians(135.0))) < 1e-3


@pytest.mark.parametrize("name", PRESETS)
def test_most_isotropic_beats_every_sample(name):
    arm = preset(name)
    q, number = most_isotropic(arm)
    samples = condition_number(scaled_jacobian(arm, some_joints(arm, 5000, seed=9)))
    assert number <= float(samples.min())
    low, high = arm.limits()
    assert bool(((q >= low) & (q <= high)).all())


def test_manipulability_is_the_determinant(arm):
    jacobian = scaled_jacobian(arm, some_joints(arm, 20), "position")
    close(manipulability(jacobian), torch.linalg.det(jacobian @ jacobian.mT).clamp(min=0).sqrt(), 1e-9)


def test_characteristic_length_balances_the_rows(arm):
    jacobian = scaled_jacobian(arm, spread(arm, 4096))
    close(jacobian[:, :3].square().sum(), jacobian[:, 3:].square().sum(), 1e-6 * jacobian.numel())


def test_maps_hold_the_workspace():
    arm = preset("kuka_iiwa")
    found = dexterity_map(arm, samples=20_000, cells=20)
    filled = np.isfinite(found.condition)
    assert filled.any()
    assert (found.condition[filled] >= 1.0).all()
    assert np.array_equal(filled, np.isfinite(found.manipulability))
    radius = (found.radius_mm[1:] + found.radius_mm[:-1]) / 2
    height = (found.height_mm[1:] + found.height_mm[:-1]) / 2
    reach = np.hypot(radius[None, :], height[:, None])
    assert reach[filled].max() <= arm.reach_mm + 40.0
    # stretched out, the elbow is singular: the rim is worse than the middle
    middle_cells, rim = filled & (reach > 450) & (reach < 650), filled & (reach > 780)
    assert found.manipulability[middle_cells].mean() > 1.8 * found.manipulability[rim].mean()


def test_joint_map_shows_the_elbow():
    arm = preset("kuka_iiwa")
    found = joint_map(arm, first=5, second=3, cells=41)
    row = np.argmin(np.abs(found.height_mm))
    assert found.manipulability[row].max() < 1e-12
    assert np.median(found.manipulability) > 1e-2


PLANAR = """
[[effect]]
name = "dh-offsets"
[effect.parameters]
da_mm = {value = [0.3, -0.2, 0.1, 0.2]}
dalpha_rad = {value = [0.0, 2e-4, 0.0, 0.0]}
dd_mm = {value = [0.05, 0.0, 0.0, 0.0]}
dtheta_rad = {value = [1e-3, -2e-3, 1e-3, 0.0]}
"""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_an_arm_that_stays_in_a_plane_is_corrected_in_it_and_what_lies_across_stays(tmp_path: Path, capsys) -> None:
    """Four parallel axes: no joint moves the tool along them, and J J^T has no inverse."""
    lengths = ((0.0, 130.0), (350.0, 0.0), (340.0, -20.0), (70.0, 0.0))
    joints = "".join(f"[[machine.joint]]\na_mm = {a}\nd_mm = {d}\nlimits_deg = [-170.0, 170.0]\n" for a, d in lengths)
    head = '[machine]\nkind = "serial"\nconvention = "modified"\ntool_mm = [50.0, 0.0, 0.0]\n'
    (tmp_path / "m.toml").write_text(head + joints + PLANAR)
    turns = np.random.default_rng(1).uniform(0.3, 1.2, (12, 4))
    pd.DataFrame(turns, columns=[f"q{j}_cmd_rad" for j in (1, 2, 3, 4)]).to_csv(tmp_path / "t.csv", index=False)
    out, model = tmp_path / "s.csv", read_model(load_machine(tmp_path / "m.toml"))
    assert run(["predict", str(tmp_path / "t.csv"), "--model", str(tmp_path / "m.toml"), "--out", str(out)]) == 0
    sent = pd.read_csv(out)
    assert set(sent["status"]) <= {"ok", "uncertain"}
    file = model.file
    wanted = build_view(file, make_table(None, command=turns)).p
    view = build_view(file, make_table(None, command=sent[["q1", "q2", "q3", "q4"]].to_numpy()))
    missed = (predict([(term.effect, term.theta) for term in model.terms], view).p - wanted).numpy()
    assert np.abs(missed[:, :2]).max() < 1e-6 and 0.03 < np.abs(missed[:, 2]).max() < 0.3
    assert "no joint moves the tool that way" in capsys.readouterr().err
    made = ["export", "--model", str(tmp_path / "m.toml"), "--to", "c", "--out", str(tmp_path / "c")]
    assert run(made) == 0
    build = ["gcc", "-std=c99", "-O2", "-Werror", "ptt_model.c", "ptt_selftest.c", "-lm"]
    subprocess.run(build, cwd=tmp_path / "c", check=True)
    assert subprocess.run(["./a.out"], cwd=tmp_path / "c", check=False).returncode == 0


def test_an_arm_that_stays_in_a_plane_has_commands_without_effects(tmp_path: Path, capsys) -> None:
    joints = "".join(
        f"[[machine.joint]]\na_mm = {length}\nlimits_deg = [-170.0, 170.0]\n" for length in (350.0, 340.0, 70.0)
    )
    (tmp_path / "m.toml").write_text(f'[machine]\nkind = "serial"\nconvention = "standard"\n{joints}')
    turns = np.random.default_rng(1).uniform(0.3, 1.5, (6, 3))
    pd.DataFrame(turns, columns=[f"q{j}_cmd_rad" for j in (1, 2, 3)]).to_csv(tmp_path / "t.csv", index=False)
    out = tmp_path / "s.csv"
    assert run(["predict", str(tmp_path / "t.csv"), "--model", str(tmp_path / "m.toml"), "--out", str(out)]) == 0
    assert set(pd.read_csv(out)["status"]) == {"ok"}
    told = capsys.readouterr().out
    assert "6 rows (6 ok)" in told and "largest static correction 0.0 um" in told
