"""Random laws of virtual arms: as large as they say, and of their variables alone."""

import itertools

import numpy as np
import pytest
from test_rig_arm import crane, poses, reading
from test_rig_arm_faults import law

from ptt.rig.arm_odd import shift_arm
from ptt.rig.odd_law import variable
from ptt.rig.odd_state import ArmState


def anywhere(rows: int, seed: int = 0) -> ArmState:
    random = np.random.default_rng(seed)
    return ArmState(
        joint=random.uniform(-1.0, 1.0, (rows, 3)),
        direction=random.choice([-1.0, 1.0], (rows, 3)),
        step=random.uniform(0.0, 1.0, (rows, 3)),
        reversals=np.zeros((rows, 3)),
        speed=np.zeros((rows, 3)),
        lever=random.uniform(-5000.0, 5000.0, (rows, 3)),
        tool=random.uniform(-600.0, 600.0, (rows, 3)),
        down=np.array([0.0, 0.0, -1.0]),
        payload=random.uniform(0.0, 6.0, rows),
        temperature=random.uniform(20.0, 28.0, rows),
        time=np.sort(random.uniform(0.0, 5000.0, rows)),
    )


@pytest.mark.parametrize("form", ["smooth", "jumpy", "periodic"])
def test_a_law_is_as_large_as_it_says_and_depends_on_its_variables_alone(form: str) -> None:
    state = anywhere(20000)
    for seed in range(6):
        value = 1e6 * shift_arm([law(form=form, law_seed=seed)], state).joint
        assert abs(value[:, 1].mean()) < 1.5 and value[:, 1].std() == pytest.approx(20.0, rel=0.08)
        np.testing.assert_array_equal(value[:, [0, 2]], 0.0)
    one, two = anywhere(300, 1), anywhere(300, 2)
    here = np.column_stack([one.joint[:, 0], two.joint[:, 1:]])
    same = ArmState(**{**vars(two), "joint": here, "direction": one.direction})
    first, second, third = (shift_arm([law(form=form)], each).joint for each in (one, same, two))
    np.testing.assert_array_equal(first, second)
    assert not np.allclose(first, third)


def test_a_law_acts_where_it_says() -> None:
    state = anywhere(50)
    size = shift_arm([law()], state).joint[:, 1]
    lean = shift_arm([law(place="lean-y")], state)
    np.testing.assert_allclose(lean.tilt[:, 1, 1], size)
    assert not lean.joint.any() and not lean.tilt[:, [0, 2]].any() and not lean.tilt[..., 0].any()
    for place, axis in itertools.product(("tool", "sight"), range(3)):
        shifts = shift_arm([law(place=f"{place}-{'xyz'[axis]}", joint=None)], state)
        part = shifts.hand if place == "tool" else shifts.sight
        np.testing.assert_allclose(part[:, axis], 1e3 * size)
        assert np.count_nonzero(part) == np.count_nonzero(part[:, axis]) > 0


def test_laws_of_tool_and_sight_end_in_the_readings() -> None:
    """A step in one joint's angle: the sight is off along the base's y, the tool along its own, which is up."""
    targets = poses((0.0, 0.0, 0.0), (0.9, 0.0, 0.0), (-0.9, 0.0, 0.0))
    steps = {"form": "jumpy", "variables": ["q1"], "span": [[-1.0, 1.0]], "size": 50.0, "joint": None}
    for place, axis in (("sight-y", 1), ("tool-y", 2)):
        rig = crane(odd=[law(place=place, **steps).model_dump(exclude_none=True)])
        moved = reading(rig, targets) - reading(crane(), targets)
        assert np.ptp(moved[:, axis]) > 0.02
        np.testing.assert_allclose(np.delete(moved, axis, axis=1), 0.0, atol=1e-9)


def test_a_memory_lags_behind_the_room() -> None:
    """The room is half as much warmer while it warms from one row to the next."""
    warm = {"time": np.array([0.0, 100.0, 200.0]), "temperature": np.array([20.0, 24.0, 24.0])}
    keep = np.exp(-100.0 / 150.0)
    first = 22.0 - 2.0 * keep
    got = variable("memory", ArmState(**{**vars(anywhere(3)), **warm}), 150.0)
    np.testing.assert_allclose(got, [20.0, first, 24.0 - (24.0 - first) * keep])
