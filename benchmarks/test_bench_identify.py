"""Identification of an arm, 100 poses and 24 Denavit-Hartenberg parameters, beside pybotics on the same readings.

The peer comes by `pip install --no-deps -r tests/peers.txt`.
"""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from scipy import optimize

from ptt.effects.registry import library, make_effect
from ptt.fitting.solve import fit
from ptt.machine import JointSpec, MachineFile, SerialSpec, load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
POSES, SIGMA = 100, 0.01
pytestmark = [
    pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning:pybotics"),
]


def peer_robot() -> Any:
    """The peer's own UR10, modified convention."""
    models = pytest.importorskip("pybotics.predefined_models")
    return pytest.importorskip("pybotics.robot").Robot.from_parameters(models.ur10())


def same_arm(robot: Any) -> MachineFile:
    """The peer's arm as a machine file, base and tool trusted as in the peer's handler."""
    rows = np.asarray(robot.kinematic_chain.vector).reshape(-1, 4)  # alpha, a, theta, d
    joints = tuple(
        JointSpec(a_mm=a, alpha_deg=float(np.degrees(alpha)), d_mm=d, theta_offset_deg=float(np.degrees(theta)))
        for alpha, a, theta, d in rows.tolist()
    )
    spec = SerialSpec(kind="serial", name="peer", convention="modified", tool_mm=(0.0, 0.0, 0.0), joint=joints)
    file = replace(load_machine(MACHINES / "ur10.toml"), machine=spec)
    return replace(
        file, tracker=file.tracker.model_copy(update={"frame": "trusted", "tool": "trusted", "sigma_mm": SIGMA})
    )


class Case:
    """One machine off by known amounts, read at random poses, and fresh poses to judge by."""

    def __init__(self) -> None:
        self.robot = peer_robot()
        self.file = same_arm(self.robot)
        random = np.random.default_rng(3)
        true = self.robot.kinematic_chain.vector + random.normal(0.0, [1e-3, 0.3, 1e-3, 0.3] * 6)
        self.robot.random_state = np.random.RandomState(1)
        self.q, self.fresh = random.uniform(-2.5, 2.5, (2, POSES, 6))
        moved = peer_robot()
        moved.kinematic_chain.vector = true
        place = [np.stack([moved.fk(row)[:3, 3] for row in q]) for q in (self.q, self.fresh)]
        self.readings, self.wanted = place[0] + random.normal(0.0, SIGMA, place[0].shape), place[1]

    def ours(self) -> float:
        """Fit; return the error at fresh poses, um."""
        model = Model(self.file) + make_effect(library(), "dh-offsets")
        fitted = fit(model, build_problem(self.file, make_table(None, self.q, self.readings)))
        term = fitted.model.terms[0]
        view = build_view(self.file, make_table(None, self.fresh))
        return self.judge(predict([(term.effect, term.theta)], view).p.numpy())

    def peer(self, method: str) -> float:
        """Fit by the peer with one of its solvers; return the same."""
        tools = pytest.importorskip("pybotics.optimization")
        handler = tools.OptimizationHandler(peer_robot(), kinematic_chain_mask=True)
        found = optimize.least_squares(
            tools.optimize_accuracy, handler.generate_optimization_vector(), method=method,
            args=(handler, self.q, self.readings),
        )  # fmt: skip
        handler.apply_optimization_vector(found.x)
        return self.judge(np.stack([handler.robot.fk(row)[:3, 3] for row in self.fresh]))

    def judge(self, place: np.ndarray) -> float:
        return float(np.sqrt(np.square(place - self.wanted).sum(axis=1).mean()) * 1e3)


@pytest.fixture(scope="module")
def case() -> Case:
    torch.set_num_threads(1)
    return Case()


def test_drawings_agree(case: Case) -> None:
    mine = build_mechanism(case.file.machine).forward(torch.tensor(case.q))
    peer = torch.tensor(np.stack([case.robot.fk(row)[:3, 3] for row in case.q]))
    torch.testing.assert_close(mine, peer, rtol=0, atol=1e-9)


@pytest.mark.benchmark(group="identify 100 poses x 24 parameters")
def test_ours(benchmark, case: Case) -> None:
    assert benchmark(case.ours) < 4.0 * SIGMA * 1e3


@pytest.mark.benchmark(group="identify 100 poses x 24 parameters")
@pytest.mark.parametrize("method", ["trf", "lm"])
def test_pybotics(benchmark, case: Case, method: str) -> None:
    assert benchmark.pedantic(case.peer, args=(method,), rounds=1) < 1e3


def test_ours_is_faster_and_no_worse(case: Case) -> None:
    case.ours()  # the first run compiles
    times, errors = {}, {}
    for label, run in {"ours": case.ours, "trf": lambda: case.peer("trf"), "lm": lambda: case.peer("lm")}.items():
        started = time.perf_counter()
        errors[label] = run()
        times[label] = time.perf_counter() - started
    print({label: f"{times[label]:.3f} s, {errors[label]:.1f} um at fresh poses" for label in times})
    assert times["ours"] < 0.5 * min(times["trf"], times["lm"])
    assert errors["ours"] < SIGMA * 1e3 and errors["ours"] < 1.3 * min(errors["trf"], errors["lm"])
