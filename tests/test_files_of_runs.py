"""Which file each run was read from is kept beside the table: names that begin alike or hold ' + ' mislead nobody."""

from pathlib import Path

import numpy as np
import pytest
import torch

import ptt
from ptt.errors import TableError
from ptt.fitting.stretches import name_stretches
from ptt.judge.compare.comparison import compare_run
from ptt.judge.compare.rows import place_of
from ptt.machine import MachineFile, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import Table, concat_tables, make_table
from ptt.run.target_frame import target_frames
from ptt.run.written import table_to_frame, write_table
from ptt.setup import check_setup
from ptt.setup.moved import find_moved
from ptt.setup.setup import Setup

BENCH = """[machine]
kind = "three-ptt"
name = "bench"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_azimuth_deg = [0.0, 120.0, 240.0]
slider_travel_mm = [150.0, 420.0]
screw_lead_mm = 5.0
[tracker]
frame = "fitted"
"""
PLUS = "run + load.csv"


@pytest.fixture
def file() -> MachineFile:
    return parse_machine(BENCH, "bench.toml")


def read(seed: int, rows: int, *, z: float = 1.0, **columns: object) -> Table:
    """Targets and readings of the bench, with the z axis of the tracker as given."""
    random = np.random.default_rng(seed)
    place = random.uniform(-1.0, 1.0, (rows, 3)) * [60.0, 60.0, 50.0]
    measured = (place + random.normal(0.0, 0.003, place.shape)) * [1.0, 1.0, z]
    return make_table(place, measured=measured, **columns)


@pytest.mark.parametrize("names", [("data.csv", "data2.csv"), ("data", "data2"), (PLUS, "run")])
def test_a_mistake_in_the_second_of_two_files_is_found_in_it_whatever_their_names(
    file: MachineFile, names: tuple[str, str]
) -> None:
    found = check_setup(file, concat_tables([read(1, 60, source=names[0]), read(2, 40, z=-1.0, source=names[1])]))
    assert [(item.mistake, item.source) for item in found.sure] == [("axis-sign", names[1])]


def test_a_mistake_in_the_second_of_two_data_frames_is_found_in_it(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(BENCH)
    model = ptt.load(tmp_path / "m.toml")
    first, second = (table_to_frame(table) for table in (read(1, 60), read(2, 40, z=-1.0)))
    run = ptt.read(first, model, also=[second])
    assert run.table.files == ("data frame", "data frame 2")
    found = ptt.check(model, run)
    assert [(item.mistake, item.source) for item in found.findings] == [("axis-sign", "data frame 2")]


def test_a_plus_in_the_name_of_one_file_makes_it_no_two(tmp_path: Path) -> None:
    write_table(read(3, 60, z=-1.0), tmp_path / PLUS)
    (tmp_path / "m.toml").write_text(BENCH)
    model = ptt.load(tmp_path / "m.toml")
    run = ptt.read(tmp_path / PLUS, model)
    assert run.table.place(5) == f"{tmp_path / PLUS} row 7"
    cured = ptt.check(model, run).table
    assert cured is not None
    np.testing.assert_allclose(cured.measured, run.table.measured * [1.0, 1.0, -1.0])


def test_a_plus_in_the_name_of_one_of_two_files(file: MachineFile) -> None:
    one, two = read(1, 6, source=PLUS, run_label=("a",)), read(2, 6, source="other.csv")
    both = concat_tables([one, two])
    assert both.run_label == (f"{PLUS}:a", "other.csv")
    assert (both.files, both.run_file) == ((PLUS, "other.csv"), (0, 1))
    assert [both.place(row) for row in (0, 6)] == [f"{PLUS}:a row 2", "other.csv row 2"]
    again = concat_tables([both, two, both])
    assert again.files == (PLUS, "other.csv", "other.csv", PLUS, "other.csv") and again.run_file == (0, 1, 2, 3, 4)
    assert [again.file_of(run) for run in range(5)] == list(again.files)
    assert not one.of_several_files and one.file_of(0) == PLUS


def test_messages_name_the_one_file_that_has_a_plus_in_its_name(file: MachineFile) -> None:
    place = read(1, 30).target
    command = build_mechanism(file.machine).inverse(torch.tensor(place)).numpy()
    swapped = make_table(place[:, [1, 0, 2]] * [1.0, 1.0, 0.3], command, place, source=PLUS)
    with pytest.raises(TableError, match="disagree") as error:
        target_frames(file, swapped)
    assert error.value.where == PLUS


@pytest.mark.parametrize(("others", "said"), [((), "line"), (("other.csv",), f"{PLUS} line")])
def test_the_worst_rows_name_their_file_only_where_there_are_others(
    file: MachineFile, others: tuple[str, ...], said: str
) -> None:
    table = concat_tables([read(1, 60, source=PLUS), *(read(2, 60, source=name) for name in others)])
    table.measured[7] += 3.0
    result = compare_run(Model(file, ()), build_problem(file, table))
    assert place_of(result, result.outliers[0]) == f"{said} 9"


@pytest.mark.parametrize(("others", "said"), [((), "lines"), (("other.csv",), f"{PLUS}: lines")])
def test_a_stretch_names_its_file_only_where_there_are_others(
    file: MachineFile, others: tuple[str, ...], said: str
) -> None:
    table = concat_tables([read(1, 60, source=PLUS), *(read(2, 60, source=name) for name in others)])
    far = np.isin(np.arange(table.rows), np.arange(20, 40))
    (stretch,), _ = name_stretches(far, np.outer(far, [3.0, 0.0, 0.0]), build_problem(file, table))
    assert stretch.place == f"{said} 22 to 41"


def test_rows_that_become_a_run_of_their_own_stay_of_their_file(file: MachineFile) -> None:
    table = concat_tables([read(1, 60, source="a.csv"), read(2, 60, source="b.csv")])
    turned = table.measured[90:] @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = table.replace(measured=np.concatenate([table.measured[:90], turned + 500.0]))
    (found,), cured = find_moved(Setup(file, moved))
    assert found.mistake == "wrong-reflector" and cured.table.run_file == (0, 1, 1)
