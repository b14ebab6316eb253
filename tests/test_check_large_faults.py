"""Faults of construction that are larger than usual are no mistakes in the set-up, nor said to be of some rows only."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import empty_run, machine, term

from ptt.machine import MachineFile
from ptt.model.chain import predict
from ptt.run.table import Table, make_table
from ptt.run.viewing import build_view
from ptt.setup import check_setup
from ptt.setup.faults import fault_columns, left_after_faults
from ptt.setup.setup import Setup

FILE = machine(frame="trusted")
TURN = np.linspace(0.0, 12.0, 20)


def built(table: Table, file: MachineFile = FILE, **sizes: list[float]) -> Table:
    """Readings, in the base frame, of a machine with faults of these sizes: `homing_offset=[...]`."""
    view = build_view(file, table)
    table = replace(table, command=view.q.numpy())
    terms = [term(name.replace("_", "-"), view, size) for name, size in sizes.items()]
    reading = predict([(each.effect, each.theta) for each in terms], view).reading.numpy()
    noise = np.random.default_rng(2).normal(0.0, 0.005, reading.shape)
    return replace(table, measured=reading + noise)


def test_what_faults_leave_does_not_jump_where_one_passes_its_bound() -> None:
    """The ridge grew thirtyfold there, and a wrong drawing that stayed below the bound seemed to explain the rest."""
    table, left = empty_run(), []
    for size in np.linspace(1.4, 2.0, 25):
        run = built(table, homing_offset=[size, -0.5, 0.3])
        columns = fault_columns(Setup(FILE, run), table.target)
        assert columns is not None
        left.append(float(np.sqrt(np.mean(left_after_faults(table.target, run.measured, columns, False) ** 2))))
    assert max(np.diff(left)) < 0.002 and left[0] < 0.01


TRIED = [(-1.0, 1.0, -1.0, 1.0, -1.0, -1.0), (1.0, 1.0, -1.0, 0.3, -1.0, 0.3), (0.3, 0.3, 1.0, 1.0, -1.0, -1.0)]


@pytest.mark.parametrize("signs", TRIED)
@pytest.mark.parametrize("size", [1.6, 1.8])
def test_homing_and_links_that_are_off_by_two_millimetres_are_no_diameter(
    size: float, signs: tuple[float, ...]
) -> None:
    """Both explain the readings alike, so that neither is sure."""
    faults = {"homing_offset": [size * one for one in signs[:3]], "link_length": [size * one for one in signs[3:]]}
    found = check_setup(FILE, replace(built(empty_run(), **faults), command=None))
    assert not [item for item in found.sure if item.mistake != "target-frame"], str(found)


def test_readings_that_faults_move_by_five_millimetres_are_not_said_to_be_some_of_them() -> None:
    """It was said of 200 of 200 readings that the others are not off, and that no machine behaves like that."""
    run = built(empty_run(), homing_offset=[0.3, -1.0, -1.0], link_length=[-1.0, 1.0, 0.2])
    assert check_setup(FILE, replace(run, command=None)).unexplained == ""


@pytest.mark.parametrize("columns", ["targets", "both"])
def test_a_frame_in_which_rows_would_be_shifted_is_compared_with_the_frame_as_it_is(columns: str) -> None:
    """The error fell from that with z negated, which nobody had, to one as large as that of the files."""
    table = make_table(np.outer(np.sin(TURN), [0.0, 0.0, 60.0]))
    run = built(table, homing_offset=[-1.4, -1.9, 1.6], link_length=[1.9, -1.5, 1.5], tower_tilt=[2e-3, -2e-3, 1e-3])
    found = check_setup(FILE, replace(run, command=None) if columns == "targets" else run)
    assert not {"row-shift", "axis-sign"} & {item.mistake for item in found.findings}, str(found)


@pytest.mark.parametrize("kept", ["target", "command", "both"])
def test_readings_of_a_single_pose_prove_no_mistake(kept: str) -> None:
    """Three zeros fit any reading there, and in another unit all errors are small."""
    table = make_table(np.tile([12.0, -30.0, 8.0], (60, 1)))
    run = built(table, homing_offset=[2.6, -0.5, -2.7], link_length=[-2.0, 1.4, -2.5])
    run = replace(run, command=None) if kept == "target" else run
    run = replace(run, target=np.full_like(run.target, np.nan)) if kept == "command" else run
    found = check_setup(FILE, run)
    # A trusted frame is another matter: where one reading is off by more than any fault, all are.
    assert not {item.mistake for item in found.findings} - {"wrong-reflector", "target-frame"}, str(found)
