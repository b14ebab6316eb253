"""An arm's tracker that was set up anew is named as a 3-PTT's is; a joint that slipped is no such thing."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_check_arm import arm

from ptt.run.problem import build_problem
from ptt.run.table import Table, concat_tables, take_rows
from ptt.setup import check_setup


def elsewhere(readings: np.ndarray, turned_deg: float, shift: tuple[float, float, float]) -> np.ndarray:
    turn = Rotation.from_rotvec(np.radians(turned_deg) * np.array([0.2, -0.4, 0.9])).as_matrix()
    return readings @ turn.T + shift


def moved(table: Table, moves: dict[int, tuple[float, tuple[float, float, float]]]) -> Table:
    measured = table.measured.copy()
    for first, (turned_deg, shift) in moves.items():
        measured[first:] = elsewhere(table.measured[first:], turned_deg, shift)
    return table.replace(measured=measured)


def slipped(table: Table, joint: int, degrees: float) -> Table:
    command = np.array(table.command)
    command[table.rows // 2 :, joint] += np.radians(degrees)
    return table.replace(command=command)


@pytest.mark.parametrize("name", ["ur10", "kuka_iiwa"])
@pytest.mark.parametrize(
    "share", [0.2, pytest.param(0.5, marks=pytest.mark.long), pytest.param(0.8, marks=pytest.mark.long)]
)
@pytest.mark.parametrize("move", [(0.0, (30.0, 0.0, 0.0)), (2.0, (40.0, 9.0, 5.0)), (130.0, (900.0, -400.0, 250.0))])
def test_an_arms_tracker_that_was_moved_in_a_file(
    move: tuple[float, tuple[float, float, float]], share: float, name: str
) -> None:
    file, table = arm(name)
    first = int(share * table.rows)
    found = check_setup(file, moved(table, {first: move}))
    (accused,) = found.sure
    line = table.line[first]
    assert accused.mistake == "wrong-reflector" and f"the tracker stood elsewhere from row {line} on:" in accused.words
    assert f"give the rows from {line} on another run in the column run" in accused.fix
    assert found.table is not None and check_setup(found.file, found.table).findings == ()
    problem = build_problem(found.file, found.table)
    left = (problem.measured - problem.target)[problem.used]
    assert accused.after_um is not None
    assert 1e3 * np.sqrt((left**2).sum(axis=1).mean()) < 1.5 * accused.after_um < 5e3


@pytest.mark.parametrize("last", [(-30.0, (100.0, 0.0, 600.0)), (0.0, (0.0, 0.0, 0.0))])
def test_an_arms_tracker_that_was_moved_twice(last: tuple[float, tuple[float, float, float]]) -> None:
    file, table = arm("ur10")
    firsts = [int(share * table.rows) for share in (0.35, 0.7)]
    moves = {firsts[0]: (20.0, (100.0, 200.0, 30.0)), firsts[1]: last}
    found = check_setup(file, moved(table, moves))
    first, second = table.line[firsts]
    assert f"from row {first} on, and again from row {second} on" in found.sure[0].words
    assert found.table is not None and check_setup(found.file, found.table).findings == ()


@pytest.mark.parametrize("degrees", [1.0, pytest.param(5.0, marks=pytest.mark.long), -25.0])
@pytest.mark.parametrize("joint", range(6))
def test_a_joint_that_slipped_is_no_tracker_that_was_moved(joint: int, degrees: float) -> None:
    """The slip of the first one turns all readings as one: the tracker would have had to turn about that very axis."""
    file, table = arm("ur10")
    assert check_setup(file, slipped(table, joint, degrees)).findings == ()


@pytest.mark.parametrize("seed", range(4))
def test_arms_far_off_their_drawing_are_not_accused_of_a_tracker_that_was_moved(seed: int) -> None:
    file, table = arm("kuka_iiwa", "none", seed)
    random = np.random.default_rng(seed)
    zeros = np.radians(random.normal(0.0, 2.0, np.shape(table.command)[1]))
    assert check_setup(file, table.replace(command=np.array(table.command) + zeros)).findings == ()
    off = [
        joint.model_copy(update={"a_mm": joint.a_mm + a, "d_mm": joint.d_mm + d})
        for joint, a, d in zip(file.machine.joint, *random.normal(0.0, 5.0, (2, len(zeros))), strict=True)
    ]
    other = replace(file, machine=file.machine.model_copy(update={"joint": tuple(off)}))
    assert check_setup(other, table).findings == ()
    few = take_rows(table, np.arange(0, table.rows, table.rows // 26))
    assert check_setup(other, few).findings == ()


def test_gross_errors_of_an_arm_are_no_tracker_that_was_moved() -> None:
    file, table = arm("ur10")
    random, measured = np.random.default_rng(3), table.measured.copy()
    measured[random.choice(table.rows, 20, replace=False)] += random.normal(0.0, 300.0, (20, 3))
    assert check_setup(file, table.replace(measured=measured)).findings == ()


def two_files(table: Table, second: Table) -> Table:
    return concat_tables([table.replace(source="first.csv"), second.replace(source="second.csv")])


def test_files_of_an_arm_that_the_tracker_read_from_two_places() -> None:
    file, table = arm("ur10")
    run = two_files(table, table.replace(measured=elsewhere(table.measured, 15.0, (200.0, 0.0, 40.0))))
    found = check_setup(file, run)
    (accused,) = found.sure
    assert "the tracker stood elsewhere in second.csv than in first.csv" in accused.words
    assert check_setup(found.file, run).findings == ()
    assert check_setup(file, two_files(table, table)).findings == ()


@pytest.mark.parametrize("joint", [0, 2])
def test_a_joint_that_was_mastered_anew_between_files_is_no_other_place_of_the_tracker(joint: int) -> None:
    file, table = arm("ur10")
    command = np.array(table.command)
    command[:, joint] += np.radians(5.0)
    assert check_setup(file, two_files(table, table.replace(command=command))).findings == ()
