"""Play that turns over with the sign of a move: rows within a gap from a reversal, which the play operator waits at."""

import numpy as np
import pytest
import torch

from ptt.challenge.challenge import bench
from ptt.diagnosis.opening import unwaited_rows
from ptt.diagnosis.verdict import diagnose
from ptt.effects import library
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

ROWS, GAP, SIGMA = 300, 0.03, 0.003


def helix() -> tuple[np.ndarray, np.ndarray]:
    """Targets and slider heights, (n, 3) mm."""
    way = np.linspace(0.0, 1.0, ROWS)
    target = np.stack([60.0 * np.cos(8.0 * np.pi * way), 60.0 * np.sin(8.0 * np.pi * way), 80.0 * way - 40.0], axis=1)
    return target, build_mechanism(bench().machine).inverse(torch.as_tensor(target)).numpy()


def signs(joints: np.ndarray) -> np.ndarray:
    """Of each move, the last one's where a slider stands; the first row arrives as the second moves."""
    sign = np.sign(np.diff(joints, axis=0, prepend=2.0 * joints[:1] - joints[1:2]))
    for row in range(1, ROWS):
        sign[row] = np.where(sign[row] == 0.0, sign[row - 1], sign[row])
    return sign


def followed(joints: np.ndarray) -> np.ndarray:
    """How far behind a nut with play stays, one move after the other."""
    nut = joints - 0.5 * GAP * signs(joints)
    for row in range(1, ROWS):
        nut[row] = np.clip(nut[row - 1], joints[row] - 0.5 * GAP, joints[row] + 0.5 * GAP)
    return nut - joints


def problem_of(error: np.ndarray) -> Problem:
    target, joints = helix()
    measured = build_mechanism(bench().machine).forward(torch.as_tensor(joints + error)).numpy()
    measured += np.random.default_rng(3).normal(0.0, SIGMA, (ROWS, 3))
    return build_problem(bench(), make_table(target, joints, measured=measured, time_s=10.0 * np.arange(ROWS)))


@pytest.mark.parametrize("waits", [False, True])
def test_play_is_told_whether_or_not_it_waits_for_the_gap(waits: bool) -> None:
    """Three rows of 300 that do not wait would else make gaps of 30 um ones of 5 to 18, beside something unknown."""
    joints = helix()[1]
    found = diagnose(Model(bench()), problem_of(followed(joints) if waits else -0.5 * GAP * signs(joints)))
    assert found.verdict == "missing" and found.suggested == (("backlash",),)
    np.testing.assert_allclose(found.model.terms[0].theta.numpy(), GAP, atol=1.5e-3)


def test_rows_are_left_out_only_where_the_machine_did_not_wait() -> None:
    """Of play that waits none goes: rows within the gap tell how wide it is."""
    joints, noise = helix()[1], Noise(np.eye(3) * SIGMA**2, "machine file")
    terms = [Term(library()["backlash"](), torch.full((3,), GAP, dtype=torch.float64))]
    problem = problem_of(-0.5 * GAP * signs(joints))
    plain = np.zeros((ROWS, 3))  # what is left where gaps are taken up at once
    gone = unwaited_rows(terms, problem, noise, plain)
    behind = np.abs(followed(joints) + 0.5 * GAP * signs(joints)).max(axis=1) > SIGMA
    assert 0 < gone.sum() < 0.05 * ROWS and behind[gone].mean() > 0.5
    waited = (followed(joints) + 0.5 * GAP * signs(joints))[..., None]
    left = (problem.view.jacobian.numpy() @ waited)[..., 0] / SIGMA
    assert not unwaited_rows(terms, problem, noise, left).any()
    assert not unwaited_rows([], problem, noise, plain).any()
