"""Jacobians of arms by joints and by geometry errors, against automatic and numerical derivatives."""

import pytest
import torch
from serial_arms import arm as arm
from serial_arms import close, some_errors, some_joints

# torch itself still scripts its forward-mode formulas on first use
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


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
