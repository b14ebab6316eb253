"""How evenly arms move: singular where theory says, isotropic where the textbook says, maps of the workspace."""

import math

import numpy as np
import pytest
import torch
from serial_arms import PRESETS, close, planar, preset, some_joints
from serial_arms import arm as arm

from ptt.mechanisms.dexterity import condition_number, manipulability
from ptt.mechanisms.dexterity_serial import (
    dexterity_map,
    joint_map,
    most_isotropic,
    nearest_singular,
    scaled_jacobian,
)
from ptt.mechanisms.serial_inverse import sample_joints

# torch itself still scripts its forward-mode formulas on first use
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


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
    q, ratio = nearest_singular(arm, sample_joints(arm, 100))
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
    jacobian = scaled_jacobian(arm, sample_joints(arm, 4096))
    close(jacobian[:, :3].square().sum(), jacobian[:, 3:].square().sum(), 1e-6 * jacobian.numel())


def test_maps_hold_the_workspace():
    arm = preset("kuka_iiwa")
    found = dexterity_map(arm, samples=20_000, cells=20)
    filled = np.isfinite(found.condition)
    assert filled.any()
    assert (found.condition[filled] >= 1.0).all()
    assert np.array_equal(filled, np.isfinite(found.manipulability))
    radius = (found.across[1:] + found.across[:-1]) / 2
    height = (found.up[1:] + found.up[:-1]) / 2
    reach = np.hypot(radius[None, :], height[:, None])
    assert reach[filled].max() <= arm.reach_mm + 40.0
    # stretched out, the elbow is singular: the rim is worse than the middle
    middle_cells, rim = filled & (reach > 450) & (reach < 650), filled & (reach > 780)
    assert found.manipulability[middle_cells].mean() > 1.8 * found.manipulability[rim].mean()


def test_joint_map_shows_the_elbow():
    arm = preset("kuka_iiwa")
    found = joint_map(arm, first=5, second=3, cells=41)
    row = np.argmin(np.abs(found.up))
    assert found.manipulability[row].max() < 1e-12
    assert np.median(found.manipulability) > 1e-2
