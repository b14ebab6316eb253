"""A whole run that lies elsewhere: targets in a frame of their own, a reflector aside, a frame not the base's."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from test_check_arm import arm

from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.machine_schema import TargetsSpec
from ptt.mechanisms.serial import Serial
from ptt.run.table import Table, make_table
from ptt.setup import Check, check_setup

TURN = Rotation.from_rotvec([0.0, 0.0, np.radians(30.0)]).as_matrix()


def framed(file: MachineFile, **changes: str) -> MachineFile:
    return replace(file, tracker=file.tracker.model_copy(update=changes))


def said(found: Check) -> list[tuple[str, bool]]:
    return [(item.mistake, item.sure) for item in found.findings]


def in_base(table: Table) -> Table:
    """Readings where the targets are, with a fault of some hundredths."""
    random = np.random.default_rng(1)
    return table.replace(measured=table.target + random.normal(0.0, 0.02, table.target.shape))


@pytest.mark.parametrize("shift", [(100.0, 50.0, 0.0), (10.0, 5.0, 3.0), (0.0, 0.0, 500.0)])
def test_targets_in_a_frame_of_their_own_are_told_though_commands_absorb_it(sound, shift: Sequence[float]) -> None:
    file, table = sound
    moved = table.replace(target=table.target + np.array(shift))
    found = check_setup(file, moved)
    assert said(found) == [("target-frame", False)] and found.ok
    origin = ", ".join(f"{-value + 0.0:.3f}" for value in shift)
    assert f"write origin_mm = [{origin}] under [targets]" in found.findings[0].fix
    stated = replace(file, targets=TargetsSpec(origin_mm=tuple(-value for value in shift)))
    assert check_setup(stated, moved).findings == ()
    assert check_setup(replace(file, targets=TargetsSpec(frame="unknown")), moved).findings == ()


def test_targets_as_far_from_commands_as_a_correction_are_in_no_frame_of_their_own(sound) -> None:
    file, table = sound
    assert check_setup(file, table.replace(target=table.target + np.array([0.9, -0.5, 1.5]))).findings == ()


@pytest.mark.parametrize(("turn", "shift"), [(np.eye(3), [100.0, 50.0, 0.0]), (TURN, [10.0, 5.0, 0.0])])
def test_targets_alone_that_one_rigid_motion_brings_to_trusted_readings_are_in_another_frame(
    sound, turn: np.ndarray, shift: list[float]
) -> None:
    file, table = sound
    trusted, own = framed(file, frame="trusted"), in_base(table)
    apart = own.replace(target=own.target @ turn.T + shift, command=None)
    found = check_setup(trusted, apart)
    assert said(found) == [("target-frame", True)] and "no known" not in found.unexplained
    assert ("turn_deg" in found.findings[0].fix) == (turn is TURN)
    assert found.table is not None and check_setup(found.file, found.table).findings == ()
    np.testing.assert_allclose(found.table.target, table.target, atol=0.1)


@pytest.mark.parametrize(("turn", "shift"), [(np.eye(3), [30.0, 0.0, -20.0]), (TURN, [100.0, 20.0, 3.0])])
def test_readings_of_a_trusted_frame_that_all_lie_aside_are_of_another_reflector_or_frame(
    sound, turn: np.ndarray, shift: list[float]
) -> None:
    file, table = sound
    own = in_base(table)
    found = check_setup(framed(file, frame="trusted"), own.replace(measured=own.measured @ turn.T + shift))
    assert said(found) == [("wrong-reflector", True)] and not found.unexplained
    (item,) = found.findings
    assert ("the reflector, or the origin of the frame" in item.words) == (turn is not TURN)
    assert item.before_um is not None and item.after_um is not None and item.after_um < 0.01 * item.before_um
    assert found.file.tracker.frame == "fitted" and found.table is not None
    assert check_setup(found.file, found.table).findings == ()


def test_sliders_that_all_count_from_another_zero_are_said_to_do_the_same(sound) -> None:
    own = in_base(sound[1])
    found = check_setup(
        framed(sound[0], frame="trusted"), own.replace(measured=own.measured + np.array([0.3, -0.4, 12.0]))
    )
    assert "all sliders count from another zero" in found.findings[0].words


@pytest.mark.parametrize("shift", [[0.0, 0.0, 0.0], [2.5, 0.0, -2.5]])
def test_what_a_fault_may_shift_is_no_other_reflector(sound, shift: list[float]) -> None:
    own = in_base(sound[1])
    assert check_setup(framed(sound[0], frame="trusted"), own.replace(measured=own.measured + shift)).findings == ()


def reflected(mount: list[float], shift: list[float]) -> tuple[MachineFile, Table]:
    """Readings of an arm's reflector so far beside the tool point, in its axes, and so far aside in the base's."""
    file, table = arm("kuka_iiwa")
    place, turn = Serial.from_spec(file.machine).pose(torch.as_tensor(table.command))  # type: ignore[arg-type]
    random = np.random.default_rng(2)
    reading = place.numpy() + turn.numpy() @ np.array(mount) + shift + random.normal(0.0, 0.03, place.shape)
    return file, make_table(None, table.command, reading, joint_prefix="q")


CASES = [
    ([0.0, 0.0, 200.0], [0.0, 0.0, 0.0], "fitted", {"tool"}),
    ([30.0, 40.0, 60.0], [0.0, 0.0, 0.0], "trusted", {"tool"}),
    ([0.0, 0.0, 0.0], [30.0, 0.0, -20.0], "trusted", {"frame"}),
    ([30.0, 0.0, 0.0], [30.0, 0.0, -20.0], "trusted", {"tool", "frame"}),
]


@pytest.mark.parametrize(("mount", "shift", "frame", "wrong"), CASES)
def test_an_arms_reflector_that_is_not_where_it_is_trusted_to_be_is_found(
    mount: list[float], shift: list[float], frame: str, wrong: set[str]
) -> None:
    file, table = reflected(mount, shift)
    file = framed(file, frame=frame, tool="trusted")
    found = check_setup(file, table)
    assert said(found) == [("wrong-reflector", True)]
    assert ("tool_mm = [" in found.findings[0].fix) == ("tool" in wrong)
    before, after = file.tracker, found.file.tracker
    assert {key for key in ("tool", "frame") if getattr(before, key) != getattr(after, key)} == wrong
    assert check_setup(found.file, table).findings == ()
    assert check_setup(framed(file, frame="fitted", tool="fitted"), table).findings == ()


def test_a_reflector_a_few_millimetres_aside_is_left_to_the_fit() -> None:
    file, table = reflected([1.0, 2.0, 1.0], [0.0, 0.0, 0.0])
    assert check_setup(framed(file, frame="fitted", tool="trusted"), table).findings == ()


def test_a_trusted_frame_can_be_written_back(sound) -> None:
    own = in_base(sound[1])
    file = parse_machine(format_machine(framed(replace(sound[0], text=""), frame="trusted")))
    found = check_setup(file, own.replace(measured=own.measured + np.array([30.0, 0.0, -20.0])))
    assert parse_machine(found.file.text).tracker.frame == "fitted"
