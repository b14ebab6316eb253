"""Where a run begins: the machine stands while base reflectors are read, and nobody knows how it arrived there."""

from dataclasses import replace

import numpy as np
import pytest

from ptt.challenge.challenge import bench
from ptt.fitting.opening import opening_rows
from ptt.machine import MachineFile
from ptt.run.problem import build_problem
from ptt.run.table import Table, make_table
from ptt.run.viewing import build_view

POSES, VISIT = 70, 4


@pytest.fixture(scope="module")
def file() -> MachineFile:
    machine = bench()
    return replace(machine, tracker=machine.tracker.model_copy(update={"frame": "trusted", "base_point": ()}))


def run_of(*, standing: int = 1, runs: int = 2) -> Table:
    """Runs that each begin with a visit to base reflectors and `standing` readings of one pose."""
    random = np.random.default_rng(3)
    parts, roles, codes = [], [], []
    for run in range(runs):
        poses = random.uniform(-40.0, 40.0, (POSES, 3))
        poses[:standing] = [0.0, 0.0, 35.0] if run == 0 else [0.0, 0.0, -35.0]
        parts += [np.full((VISIT, 3), np.nan), poses]
        roles += ["base"] * VISIT + ["pose"] * POSES
        codes += [run] * (VISIT + POSES)
    target = np.concatenate(parts)
    read = np.where(np.isfinite(target), target, 500.0) + random.normal(0.0, 1e-3, target.shape)
    return make_table(target, measured=read, role=np.array(roles), run=np.array(codes))


def test_rows_before_a_run_first_moves_open_it(file: MachineFile) -> None:
    for standing in (1, 3):
        table = run_of(standing=standing)
        first = VISIT + np.arange(standing)
        expected = np.concatenate([first, first + VISIT + POSES])
        np.testing.assert_array_equal(np.flatnonzero(opening_rows(build_problem(file, table))), expected)


def test_while_base_reflectors_are_read_first_the_machine_stands_where_its_run_begins(file: MachineFile) -> None:
    table = run_of()
    view = build_view(file, table)
    second = VISIT + POSES  # the visit that opens the second run: the first ended elsewhere
    for start in (0, second):
        stands = view.q[start : start + VISIT + 1]
        assert (stands == stands[-1]).all()
        np.testing.assert_array_equal(view.direction[start + VISIT], view.direction[start + VISIT + 1])
    assert view.read is not None
    np.testing.assert_array_equal(view.read.numpy(), table.role == "pose")


def test_while_base_reflectors_are_read_later_the_machine_stands_where_it_was(file: MachineFile) -> None:
    table = run_of(runs=1)
    last = np.flatnonzero(table.role == "pose")[40:44]
    role, target = table.role.copy(), table.target.copy()
    role[last], target[last] = "base", np.nan
    view = build_view(file, table.replace(role=role, target=target))
    assert (view.q[last] == view.q[last[0] - 1]).all()
