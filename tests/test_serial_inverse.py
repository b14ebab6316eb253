"""Joint values of a pose: found from near and without a start, refused where there are none, posture kept."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from serial_arms import PRESETS, close, elementary, generator, planar, preset, some_errors, some_joints
from serial_arms import arm as arm

from ptt.mechanisms.dexterity import condition_number, manipulability
from ptt.mechanisms.dexterity_serial import (
    scaled_jacobian,
)
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_inverse import middle, solve_inverse

# torch itself still scripts its forward-mode formulas on first use
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


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
