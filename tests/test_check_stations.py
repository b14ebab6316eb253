"""A tracker that was moved between runs is named; one that was set up anew for each is not accused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import run_verb
from scipy.spatial.transform import Rotation

from ptt.machine import MachineFile
from ptt.run.problem import build_problem
from ptt.run.table import Table, concat_tables
from ptt.run.written import write_table
from ptt.setup import check_setup, rows

DATA = Path(__file__).parent.parent / "data" / "sealed_one"


def set_up_anew(file: MachineFile, table: Table) -> tuple[MachineFile, Table]:
    """All but the first third as a run of its own, its readings in another frame of the tracker."""
    run = (np.arange(table.rows) >= table.rows // 3).astype(int)
    turn = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()
    measured = np.where(run[:, None] == 0, table.measured, table.measured @ turn.T + [900.0, -400.0, 250.0])
    own = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted-per-run"}))
    return own, table.replace(measured=measured, run=run, run_label=("1", "2"))


def test_a_tracker_set_up_anew_for_each_run_is_no_other_reflector(sound: tuple[MachineFile, Table]) -> None:
    file, table = set_up_anew(*sound)
    found = check_setup(file, table)
    assert found.findings == () and found.table is not None
    np.testing.assert_array_equal(found.table.measured, table.measured)
    one_frame = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted"}))
    accused = check_setup(one_frame, table).sure
    assert [item.mistake for item in accused] == ["wrong-reflector"] and "fitted-per-run" in accused[0].fix
    one_run = table.replace(run=np.zeros(table.rows, int), run_label=("",))
    assert "another run in the column run" in check_setup(one_frame, one_run).sure[0].fix


@pytest.mark.parametrize("turned_deg", [0.0, 0.5, -20.0, 30.0, 45.0, 170.0])
@pytest.mark.parametrize(
    "share", [0.25, pytest.param(0.5, marks=pytest.mark.long), pytest.param(0.8, marks=pytest.mark.long)]
)
def test_what_is_promised_of_a_tracker_that_was_moved_in_a_file_is_left_after_the_cure(
    sound: tuple[MachineFile, Table], turned_deg: float, share: float
) -> None:
    file, table = sound
    file = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted"}))
    first = int(share * table.rows)
    turn = Rotation.from_euler("z", turned_deg, degrees=True).as_matrix()
    measured = table.measured.copy()
    measured[first:] = measured[first:] @ turn.T + [100.0, 200.0, 30.0]
    found = check_setup(file, table.replace(measured=measured))
    (accused,) = found.sure
    assert accused.mistake == "wrong-reflector"
    assert ("another run in the column run" in accused.fix) == (turned_deg != 0.0)
    assert turned_deg == 0.0 or f"from row {table.line[first]} on" in accused.words
    assert check_setup(found.file, found.table).ok
    problem = build_problem(found.file, found.table)
    left = (problem.measured - problem.target)[problem.used]
    assert 1e3 * np.sqrt((left**2).sum(axis=1).mean()) < 1.5 * accused.after_um < 1e3


@pytest.mark.parametrize(("shares", "back"), [((1 / 3, 2 / 3), True), ((0.3, 0.7), False), ((0.5, 0.85), False)])
def test_a_tracker_that_was_moved_twice_is_named_at_both_rows(
    sound: tuple[MachineFile, Table], shares: tuple[float, float], back: bool
) -> None:
    file, table = sound
    file = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted"}))
    firsts, measured = [int(share * table.rows) for share in shares], table.measured.copy()
    turn = Rotation.from_euler("z", 30.0, degrees=True).as_matrix()
    measured[firsts[0] :] = measured[firsts[0] :] @ turn.T + [100.0, 200.0, 30.0]
    measured[firsts[1] :] = table.measured[firsts[1] :] if back else measured[firsts[1] :] @ turn.T - [300.0, 0.0, 90.0]
    found = check_setup(file, table.replace(measured=measured))
    (accused,) = found.sure
    first, second = table.line[firsts]
    assert f"from row {first} on, and again from row {second} on" in accused.words
    assert f"the rows from {first} on and those from {second} on another run each" in accused.fix
    assert found.table is not None and len(set(found.table.run)) == 3
    assert check_setup(found.file, found.table).ok
    problem = build_problem(found.file, found.table)
    left = (problem.measured - problem.target)[problem.used]
    assert 1e3 * np.sqrt((left**2).sum(axis=1).mean()) < 1.5 * (accused.after_um or 0.0) < 1e3


@pytest.mark.parametrize(("aside_mm", "accused"), [(100.0, True), (15.0, False)])
def test_files_in_one_frame_that_the_tracker_read_from_two_places(
    sound: tuple[MachineFile, Table], aside_mm: float, accused: bool
) -> None:
    """Sliders that were homed anew between two files move readings as well: no other place of the tracker."""
    file, table = sound
    second = table.replace(measured=table.measured + np.array([aside_mm, 0.0, 0.0]), source="second.csv")
    found = check_setup(file, concat_tables([table, second]))
    assert [item.mistake for item in found.sure] == ["wrong-reflector"] * accused
    assert all("second.csv" in item.words and "fitted-per-run" in item.fix for item in found.sure)
    assert found.file.tracker.frame == ("fitted-per-run" if accused else "fitted")
    assert not check_setup(found.file, concat_tables([table, second])).findings


def test_a_mistake_in_one_of_two_set_ups_is_found_and_undone(sound: tuple[MachineFile, Table]) -> None:
    file, table = set_up_anew(*sound)
    block = np.arange(table.rows)[table.run == 1][40:60]
    measured = table.measured.copy()
    measured[block] += [30.0, 0.0, 40.0]
    found = check_setup(file, table.replace(measured=measured))
    assert [item.mistake for item in found.sure] == ["wrong-reflector"] and found.table is not None
    np.testing.assert_allclose(found.table.measured, table.measured, atol=0.5)
    np.testing.assert_array_equal(found.table.line, table.line)


def test_a_block_on_another_reflector_is_found_as_well_one_start_at_a_time(
    sound: tuple[MachineFile, Table], monkeypatch: pytest.MonkeyPatch
) -> None:
    file, table = sound
    measured = table.measured.copy()
    measured[60:140] += [30.0, -12.0, 25.0]
    run = table.replace(measured=measured)
    together = check_setup(file, run)
    assert [item.mistake for item in together.sure] == ["wrong-reflector"]
    monkeypatch.setattr(rows, "AT_ONCE", 1)
    assert check_setup(file, run).findings == together.findings


def test_files_of_two_stations_are_named_where_the_machine_file_says_nothing_of_a_tracker(
    sound: tuple[MachineFile, Table], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = "\n".join(line for line in (DATA / "machine.toml").read_text().partition("[tracker]")[0].splitlines())
    (tmp_path / "m.toml").write_text(f"{bare}\n")
    for name, shift in (("a.csv", 0.0), ("b.csv", 500.0)):
        write_table(sound[1].replace(measured=sound[1].measured + np.array([shift, 0.0, 0.0])), tmp_path / name)
    arguments = [tmp_path / "a.csv", "--also", tmp_path / "b.csv", "--model", tmp_path / "m.toml", "--json"]
    assert run_verb("check", *arguments) == 0
    (found,) = json.loads(capsys.readouterr().out)["findings"]
    assert found["sure"] and "the tracker stood elsewhere in" in found["words"]
