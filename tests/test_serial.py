"""Serial arms: chains against matrices multiplied out, reach, parallel axes, other libraries of kinematics."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from serial_arms import MACHINES, close, elementary, generator, planar, preset, some_errors, some_joints
from serial_arms import arm as arm

from ptt.machine import load_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.rotations import (
    from_quaternion,
    quaternion_of,
    rotation_vector,
)
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_inverse import sample_joints
from ptt.mechanisms.serial_reach import reach_within_limits

# torch itself still scripts its forward-mode formulas on first use
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


# --- an independent chain: 4x4 matrices from axis-angle exponentials, one pose at a time


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
    assert float(torch.linalg.vector_norm(arm.forward(sample_joints(arm, 2000)), dim=-1).max()) <= arm.reach_mm
    iiwa = preset("kuka_iiwa")
    close(torch.linalg.vector_norm(iiwa.forward(iiwa.home())), iiwa.reach_mm, 1e-9)


def test_reach_within_limits_is_that_of_many_poses_and_no_more(arm):
    away, low, high = reach_within_limits(arm)
    p = arm.forward(some_joints(arm, 100_000))
    tried = torch.linalg.vector_norm(p[:, :2], dim=-1).max(), p[:, 2].min(), p[:, 2].max()
    assert -0.1 <= away - float(tried[0]) < 6.0 and away <= arm.reach_mm + 1e-9
    assert (
        -0.1 <= float(tried[1]) - low < 6.0 and -0.1 <= high - float(tried[2]) < 6.0
    )  # a grid of 2 deg misses so much


def test_reach_of_two_links_that_fold_by_a_right_angle_at_the_least():
    """Links of 300 and 250 mm, the elbow from 90 to 170 deg: the farthest is the right angle, hypot(300, 250)."""
    arm = dataclasses.replace(planar((300.0, 250.0)), limits_rad=((-math.pi, math.pi), (math.pi / 2, 3.0)))
    away, low, high = reach_within_limits(arm)
    assert away == pytest.approx(math.hypot(300.0, 250.0), abs=1e-9) and (low, high) == pytest.approx((0.0, 0.0))


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
