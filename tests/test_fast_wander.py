"""Poses read twice in a row by a tracker whose readings wander within a few rows, and poses that err by themselves."""

from dataclasses import replace

import numpy as np
import pytest

from ptt.challenge.challenge import bench
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.found import Found
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

POSES, STEP, WHITE = 340, 70.0, 0.003  # s between readings; mm


def wandering(random: np.random.Generator) -> np.ndarray:
    """An Ornstein-Uhlenbeck process that decays within two readings, (2 POSES, 3) mm."""
    kept, found = np.exp(-STEP / 117.0), [random.normal(0.0, 1.9 * WHITE, 3)]
    for _ in range(2 * POSES - 1):
        found.append(kept * found[-1] + np.sqrt(1.0 - kept**2) * random.normal(0.0, 1.9 * WHITE, 3))
    return np.array(found)


@pytest.mark.parametrize(("by_pose", "verdict"), [(False, "nothing-missing"), (True, "unknown")])
def test_a_fast_wander_is_no_error_of_poses_that_are_read_twice_in_a_row(
    by_pose: bool, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both make the two readings of a pose alike; those of neighbours in time are alike in a wander alone."""
    file, random = bench(), np.random.default_rng(6)
    file = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": None}))
    pose = np.repeat(random.uniform(-1.0, 1.0, (POSES, 3)) * [70.0, 70.0, 45.0], 2, axis=0)
    own = np.repeat(random.normal(0.0, 1.9 * WHITE, (POSES, 3)), 2, axis=0) if by_pose else wandering(random)
    side = np.tile([[5.0, 5.0, 5.0], [-5.0, -5.0, -5.0]], (POSES, 1))
    target = np.stack([pose - side, pose], axis=1).reshape(-1, 3)  # each is come to from one side and the other
    read = pose + own + random.normal(0.0, WHITE, pose.shape)
    measured = np.stack([np.full_like(read, np.nan), read], axis=1).reshape(-1, 3)
    table = make_table(target, measured=measured, time_s=0.5 * STEP * np.arange(len(target)))
    problem = build_problem(file, table)
    searched: list[Found] = []
    monkeypatch.setattr("ptt.diagnosis.diagnose.find", lambda *given: searched.append(find(*given)) or searched[-1])
    assert diagnose(Model(file), problem).verdict == verdict
    memory = searched[0].state.memory
    if by_pose:
        assert memory.pose and memory.wander is None
    else:
        assert not memory.pose and memory.wander is not None and 0.5 < memory.wander.constant / 117.0 < 2.0
