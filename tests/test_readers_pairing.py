"""Readings of one file beside the targets of another: by name, by order, and what was missed."""

from pathlib import Path

import numpy as np
import pytest
from asking import FIXTURES, never, say
from numpy.testing import assert_allclose, assert_array_equal

from ptt.errors import TableError
from ptt.run.readers import Mapping
from ptt.run.readers.mapping import Ask
from ptt.run.reading import read_table


def test_names_with_a_group_match_bare_targets(tmp_path: Path) -> None:
    text = "// SpatialAnalyzer\n" + "".join(f"g{i}, P{i}, 0, {i}, {i * i}, 300\n" for i in (1, 2, 4))
    path = tmp_path / "sa.txt"
    path.write_text(text, encoding="utf-8")
    table = read_table(path, targets=FIXTURES / "targets.csv")
    assert table.observed.tolist() == [True, True, False, True, False]


def test_ids_with_gaps_are_row_numbers_of_the_targets() -> None:
    table = read_table(FIXTURES / "spaces_with_gaps.txt", targets=FIXTURES / "targets_unnamed.csv", ask=never)
    assert table.observed.tolist() == [True, True, False, True, False, False, True]
    assert_array_equal(table.measured[6], [2356.48, -2416.21, -442.50])
    assert "space between columns" in str(table.understood)
    assert "3 targets without reading: row 4, row 6, row 7" in str(table.understood)


def pair(tmp_path: Path, readings: str, targets: str, ask: Ask | None = None) -> tuple[list[float], list[float], str]:
    run, wanted = tmp_path / "export.csv", tmp_path / "targets.csv"
    run.write_text(readings, encoding="utf-8")
    wanted.write_text(targets, encoding="utf-8")
    table = read_table(run, targets=wanted, ask=ask)
    return table.target[:, 0].tolist(), table.measured[:, 0].tolist(), str(table.understood)


def test_pairing_by_repeated_names(tmp_path: Path) -> None:
    targets = "name,x_cmd,y_cmd,z_cmd\nA,1,0,0\nB,2,0,0\nA,1,0,0\nB,2,0,0\n"
    x, measured, _ = pair(tmp_path, "name,x,y,z\nA,1.1,0,0\nA,1.2,0,0\nB,2.1,0,0\n", targets)
    assert x == [1, 2, 1, 2]
    assert_array_equal(measured, [1.1, np.nan, 1.2, 2.1])  # in order: the first B was missed
    single = "name,x_cmd,y_cmd,z_cmd\nA,1,0,0\nB,2,0,0\nC,3,0,0\n"
    x, measured, text = pair(tmp_path, "name,x,y,z\nB,2.1,0,0\nA,1.1,0,0\nB,2.2,0,0\nX,9,9,9\n", single)
    assert x == [2, 1, 2]
    assert measured == [2.1, 1.1, 2.2]
    assert "in the order of the readings" in text
    assert "1 target without reading: row 4 C" in text
    assert "1 reading without target, left out: row 5 X" in text


def test_what_the_targets_tell_of_one_without_reading_stays(tmp_path: Path) -> None:
    run, wanted = tmp_path / "export.csv", tmp_path / "targets.csv"
    run.write_text("name,x,y,z,payload_kg\nA,1.1,0,0,2\nC,3.1,0,0,2\n", encoding="utf-8")
    wanted.write_text("name,x_cmd,y_cmd,z_cmd,payload_kg\nA,1,0,0,0\nB,2,0,0,5\nC,3,0,0,0\n", encoding="utf-8")
    table = read_table(run, targets=wanted)
    assert table.payload_kg is not None and table.payload_kg.tolist() == [2.0, 5.0, 2.0]


THERE_AND_BACK = ["A", "B", "C", "B", "A", "B", "D", "B", "A"]


@pytest.mark.parametrize("row", range(9))
@pytest.mark.parametrize("change", ["missed", "twice"])
def test_one_reading_missed_or_taken_twice_shifts_no_other(tmp_path: Path, row: int, change: str) -> None:
    targets = "name,x_cmd,y_cmd,z_cmd\n" + "".join(f"{name},{10 * i},0,0\n" for i, name in enumerate(THERE_AND_BACK))
    read = [f"{name},{10 * i + 0.1},0,0\n" for i, name in enumerate(THERE_AND_BACK)]
    read[row : row + 1] = [] if change == "missed" else 2 * read[row : row + 1]
    x, measured, text = pair(tmp_path, "name,x,y,z\n" + "".join(read), targets)
    assert len(x) == (9 if change == "missed" else 10)
    assert np.isnan(measured).sum() == (change == "missed")
    assert_allclose(np.array(measured)[np.isfinite(measured)], np.array(x)[np.isfinite(measured)] + 0.1)
    assert "in the order of the targets" in text


@pytest.mark.parametrize("rows", range(5, 20))
def test_a_run_that_was_broken_off_has_its_readings_beside_the_first_targets(tmp_path: Path, rows: int) -> None:
    listed = 2 * THERE_AND_BACK
    targets = "name,x_cmd,y_cmd,z_cmd\n" + "".join(f"{name},{i},0,0\n" for i, name in enumerate(listed))
    read = [f"{name},{i},0,0\n" for i, name in enumerate(listed)][:rows]
    x, measured, _ = pair(tmp_path, "name,x,y,z\n" + "".join(read), targets)
    assert x == list(range(18)) and measured[: len(read)] == x[: len(read)] and np.isnan(measured[len(read) :]).all()


def test_a_list_run_twice_and_readings_of_names_that_tell_nothing(tmp_path: Path) -> None:
    targets = "name,x_cmd,y_cmd,z_cmd\n" + "".join(f"{name},{i},0,0\n" for i, name in enumerate(THERE_AND_BACK))
    twice = "name,x,y,z\n" + "".join(f"{name},{i},0,0\n" for i, name in enumerate(2 * THERE_AND_BACK))
    assert pair(tmp_path, twice, targets)[0] == 2 * list(range(9))
    broken = "name,x,y,z\n" + "".join(f"{name},{i},0,0\n" for i, name in enumerate((2 * THERE_AND_BACK)[:13]))
    assert pair(tmp_path, broken, targets)[0] == [*range(9), *range(4)]
    alike = "name,x_cmd,y_cmd,z_cmd\n" + "".join(f"pose,{i},0,0\n" for i in range(9))
    with pytest.raises(TableError, match=r"row 3: 'pose' was read 10 times and is listed 9 times"):
        pair(tmp_path, "name,x,y,z\n" + "".join(f"pose,{i},0,0\n" for i in range(10)), alike)


def test_readings_out_of_order_of_places_that_are_visited_again(tmp_path: Path) -> None:
    """Which visit a reading belongs to says from which side the machine came: no guess may say it."""
    there = [*range(8), *range(7, -1, -1)]
    targets = "name,x_cmd,y_cmd,z_cmd\n" + "".join(f"p{i},{i},0,0\n" for i in there)
    read = [(f"p{i}", i + 0.01 * k, k) for k, i in enumerate(there)]
    mixed = [read[k] for k in np.random.default_rng(1).permutation(len(read))]
    plain = "name,x,y,z\n" + "".join(f"{name},{x},0,0\n" for name, x, _ in mixed)
    with pytest.raises(
        TableError, match=r"row 2: 'p\d' is listed more than once, and the readings are in another order"
    ):
        pair(tmp_path, plain, targets)
    timed = "name,x,y,z,time_s\n" + "".join(f"{name},{x},0,0,{5.0 * k}\n" for name, x, k in mixed)
    assert_allclose(pair(tmp_path, timed, targets)[1], [x for _, x, _ in read])
    midnight = "name,x,y,z,time_s\n" + "".join(f"{name},{x},0,0,{(86390 + k) % 86400}\n" for name, x, k in read)
    assert_allclose(pair(tmp_path, midnight, targets)[1], [x for _, x, _ in read])
    restarted = "name,x,y,z,time_s\n" + "".join(f"{name},{x},0,0,{(5000 + k) % 5010}\n" for name, x, k in read)
    with pytest.raises(TableError, match="time goes back"):  # in order as listed: the clock does not count
        pair(tmp_path, restarted, targets)
    short = "name,x_cmd,y_cmd,z_cmd\nA,1,0,0\nB,2,0,0\nA,1,0,0\n"
    often = "name,x,y,z\n" + 20 * "A,1,0,0\nB,2,0,0\nA,1,0,0\n"
    assert pair(tmp_path, often, short)[1] == 20 * [1.0, 2.0, 1.0]
    once = "name,x_cmd,y_cmd,z_cmd\n" + "".join(f"p{i},{i},0,0\n" for i in range(8))
    back = "name,x,y,z\n" + "".join(f"p{i},{i},0,0\n" for i in range(7, -1, -1))
    assert pair(tmp_path, back, once)[1] == list(range(8))
    thrice = "name,x_cmd,y_cmd,z_cmd\n" + "".join(3 * f"p{i},{i},0,0\n" for i in range(8))
    back = "name,x,y,z\n" + "".join(3 * f"p{i},{i},0,0\n" for i in range(7, -1, -1))
    assert pair(tmp_path, back, thrice)[1] == np.repeat(range(8), 3).tolist()


def test_visits_of_one_place_with_other_loads_are_visits_of_their_own(tmp_path: Path) -> None:
    """One place under one load is one pose, however often it is read; under three loads it is three."""
    wanted = [(i, load) for i in range(8) for load in (0, 1, 2)]
    mixed = [wanted[k] for k in np.random.default_rng(1).permutation(len(wanted))]
    readings = "name,x,y,z\n" + "".join(f"p{i},{i + 0.01 * load},0,0\n" for i, load in mixed)
    light = "name,x_cmd,y_cmd,z_cmd,payload_kg\n" + "".join(f"p{i},{i},0,0,0\n" for i, _ in wanted)
    assert len(pair(tmp_path, readings, light)[0]) == len(wanted)
    loaded = "name,x_cmd,y_cmd,z_cmd,payload_kg\n" + "".join(f"p{i},{i},0,0,{load}\n" for i, load in wanted)
    with pytest.raises(TableError, match="listed more than once, and the readings are in another order"):
        pair(tmp_path, readings, loaded)


def test_pairing_in_order(tmp_path: Path) -> None:
    targets = "x_cmd,y_cmd,z_cmd\n1,0,0\n2,0,0\n3,0,0\n"
    x, measured, text = pair(tmp_path, "x,y,z\n1.1,0,0\n2.1,0,0\n3.1,0,0\n", targets)
    assert (x, measured) == ([1, 2, 3], [1.1, 2.1, 3.1])
    assert "paired in order" in text
    with pytest.raises(TableError, match="2 readings for 3 targets and no names in common"):
        pair(tmp_path, "x,y,z\n1.1,0,0\n2.1,0,0\n", targets)
    _, measured, text = pair(tmp_path, "x,y,z\n1.1,0,0\n2.1,0,0\n", targets, ask=say("order"))
    assert_array_equal(measured, [1.1, 2.1, np.nan])
    assert "1 target without reading: row 4" in text
    with pytest.raises(TableError, match="name the points alike in both files"):
        pair(tmp_path, "x,y,z\n1,0,0\n2,0,0\n3,0,0\n4,0,0\n", targets)


def test_names_of_which_none_is_a_targets_are_warned_of(tmp_path: Path) -> None:
    targets = "name,x_cmd,y_cmd,z_cmd\n" + "".join(f"P{i},{i},0,0\n" for i in range(3))
    said = "warning: no reading has the name of a target (they begin with 'Q0' and 'P0'): paired by their order alone"
    x, measured, text = pair(tmp_path, "name,x,y,z\n" + "".join(f"Q{i},{i},0,0\n" for i in range(3)), targets)
    assert (x, measured) == ([0, 1, 2], [0, 1, 2]) and said in text.splitlines()
    for names in ("name,x,y,z\nP0,0,0,0\nP1,1,0,0\nQ,2,0,0\n", "x,y,z\n0,0,0\n1,0,0\n2,0,0\n"):
        assert "warning" not in pair(tmp_path, names, targets)[2]
    for group in ("Job::Run1::", "Job/"):
        swapped = "name,x,y,z\n" + "".join(f"{group}P{i},{i},0,0\n" for i in (1, 0, 2))
        x, measured, text = pair(tmp_path, swapped, targets)
        assert x == measured == [0, 1, 2] and "paired by name" in text


def test_pairing_keeps_the_readings_own_columns(tmp_path: Path) -> None:
    targets = "name,x_cmd,y_cmd,z_cmd,temp_c,note\nA,1,0,0,20,a\nB,2,0,0,20,b\n"
    run, wanted = tmp_path / "export.csv", tmp_path / "targets.csv"
    run.write_text("name,x,y,z,temp_c\nA,1,0,0,25\nB,2,0,0,26\n", encoding="utf-8")
    wanted.write_text(targets, encoding="utf-8")
    table = read_table(run, targets=wanted)
    assert_array_equal(table.temp_c, [25, 26])
    assert table.extra["note"].tolist() == ["a", "b"]


@pytest.mark.parametrize(
    "pairing, message", [("name", "both files need a column name"), ("number", "rising row numbers")]
)
def test_pairing_answer_that_does_not_suit(tmp_path: Path, pairing: str, message: str) -> None:
    path = tmp_path / "export.csv"
    path.write_text("x,y,z\n1,2,3\n2,2,3\n", encoding="utf-8")
    with pytest.raises(TableError, match=message):
        read_table(path, targets=FIXTURES / "targets_unnamed.csv", mapping=Mapping(pairing=pairing))


def test_errors_in_the_targets_name_that_file(tmp_path: Path) -> None:
    targets = tmp_path / "targets.csv"
    targets.write_text("name,x_cmd,y_cmd,z_cmd\nP1,0,0,300\nP2,,0,300\n", encoding="utf-8")
    with pytest.raises(TableError, match=r"targets\.csv row 3, column x_cmd: empty target"):
        read_table(FIXTURES / "spatial_analyzer.txt", targets=targets)


@pytest.mark.parametrize(
    "more",
    ["", "x_cmd,y_cmd,z_cmd,", "X [mm],Y,Z,", "b1_cmd,b2_cmd,b3_cmd,", "x_cmd,y_cmd,z_cmd,b1_cmd,b2_cmd,b3_cmd,"],
)
@pytest.mark.parametrize("bare", ["b1,b2,b3", "b1 [mm],b2 [mm],b3 [mm]"])
def test_bare_sliders_beside_readings_are_what_was_sent(tmp_path: Path, more: str, bare: str) -> None:
    readings, targets = tmp_path / "readings.csv", tmp_path / "targets.csv"
    readings.write_text("x,y,z\n1,2,3\n1,2,4\n", encoding="utf-8")
    rows = "\n".join("1,2,3," * (more.count(",") // 3) + f"301,302,{last}" for last in (303, 304))
    targets.write_text(f"{more}{bare}\n{rows}\n", encoding="utf-8")
    assert_array_equal(read_table(readings, targets=targets).command, [[301, 302, 303], [301, 302, 304]])


@pytest.mark.parametrize(
    ("more", "radians"), [("x_cmd", False), ("q1_cmd_rad,q2_cmd_rad", True), ("reversal1", True), ("shift_um", True)]
)
def test_bare_angles_beside_readings_are_what_was_sent(tmp_path: Path, more: str, radians: bool) -> None:
    readings, targets = tmp_path / "readings.csv", tmp_path / "targets.csv"
    readings.write_text("x,y,z\n1,2,3\n1,2,4\n", encoding="utf-8")
    more = "x_cmd,y_cmd,z_cmd" if more == "x_cmd" else more
    rows = "\n".join(f"{','.join('9' * len(more.split(',')))},0.5,{last}" for last in (1.5, 2.5))
    targets.write_text(f"{more},q1,q2\n{rows}\n", encoding="utf-8")
    read = {"joints": 2, "joint_prefix": "q", "targets": targets}
    if not radians:
        with pytest.raises(TableError, match="which unit is q1_cmd in"):
            read_table(readings, **read)
    assert_array_equal(read_table(readings, **read, ask=say("rad")).command, [[0.5, 1.5], [0.5, 2.5]])
    targets.write_text(targets.read_text().replace("q1,q2", "q1 [deg],q2 [deg]"), encoding="utf-8")
    assert_allclose(read_table(readings, **read).command[0], np.radians([0.5, 1.5]), rtol=1e-15)
    targets.write_text("q1 [deg],q2 [deg]\n0.5,1.5\n0.5,2.5\n", encoding="utf-8")
    assert_allclose(read_table(targets, 2, joint_prefix="q", purpose="sliders").command[0], np.radians([0.5, 1.5]))


def _two_files(tmp_path: Path) -> tuple[Path, Path]:
    readings, targets = tmp_path / "readings.csv", tmp_path / "targets.csv"
    readings.write_text("X [mm],Y [mm],Z [mm]\n1,2,3\n1,2,4\n", encoding="utf-8")
    targets.write_text(
        "X [mm],Y [mm],Z [mm],U1 [mm],U2 [mm],U3 [mm],Druck\n4,5,6,301,302,303,7\n4,5,7,301,302,304,7\n",
        encoding="utf-8",
    )
    return readings, targets


def test_a_map_holds_for_titles_of_the_targets_as_well(tmp_path: Path) -> None:
    readings, targets = _two_files(tmp_path)
    sliders = {f"U{number} [mm]": f"b{number}_cmd" for number in (1, 2, 3)}
    for mapping in (Mapping(columns=sliders), Mapping(targets=Mapping(columns=sliders))):
        table = read_table(readings, targets=targets, mapping=mapping, ask=never)
        assert_array_equal(table.command, [[301, 302, 303], [301, 302, 304]])
        assert_array_equal(table.target[0], [4, 5, 6])
        assert "in the mapping but not in the file" not in str(table.understood)
    both = Mapping(
        columns=sliders | {f"{axis.upper()} [mm]": f"{axis}_meas" for axis in "xyz"} | {"nowhere": "temp"},
        units={"X [mm]": "m"},
    )
    table = read_table(readings, targets=targets, mapping=both, ask=never, judge_scale=False)
    assert_array_equal([table.target[0, 0], table.measured[0, 0]], [4, 1000])  # X [mm] is of the readings alone
    assert str(table.understood).count("in the mapping but not in the file: nowhere") == 1
    own = Mapping(columns=sliders, targets=Mapping(columns={"U1 [mm]": "ignore"} | {"elsewhere": "temp"}))
    with pytest.raises(TableError, match="b1_cmd"):  # what stands below [targets] goes first
        read_table(readings, targets=targets, mapping=own, ask=never)


def test_a_question_on_the_targets_names_their_part_of_the_map(tmp_path: Path) -> None:
    readings, targets = _two_files(tmp_path)
    targets.write_text(targets.read_text().replace("Druck", "payload_st"), encoding="utf-8")
    with pytest.raises(TableError, match=r"--map FILE.toml, \[targets.units\] \"payload_st\" = one of"):
        read_table(readings, targets=targets)
    targets.write_text("x,y,z,time\n1,2,3,01/02/25 10:00\n1,2,4,02/02/25 10:00\n", encoding="utf-8")
    with pytest.raises(TableError, match=r"--map FILE.toml, \[targets\] dates = one of"):
        read_table(readings, targets=targets)
    said = Mapping(targets=Mapping(dates="day-first"))
    assert read_table(readings, targets=targets, mapping=said).rows == 2


@pytest.mark.parametrize("name", ["99999999999999999999", "\u00b2"])
def test_a_name_that_is_no_number_of_a_row_pairs_by_order(tmp_path: Path, name: str) -> None:
    """Both ended in a traceback."""
    export, targets = tmp_path / "run.csv", tmp_path / "targets.csv"
    export.write_text(f"name,x,y,z\n1,0,0,1\n{name},9,0,1\n", encoding="utf-8")
    targets.write_text("x_cmd,y_cmd,z_cmd\n0,0,0\n9,0,0\n")
    assert_array_equal(read_table(export, targets=targets).measured[:, 0], [0.0, 9.0])


def test_a_target_without_reading_has_the_run_role_and_command_that_are_known_of_it(tmp_path: Path) -> None:
    """Its run was empty, which was refused at a row that the file of the readings does not have."""
    export, targets = tmp_path / "run.csv", tmp_path / "targets.csv"
    export.write_text(
        "name,x,y,z,run,role,b1,b2,b3\nP1,0,0,1,a,pose,1,1,1\nP2,8,0,1,a,pose,2,2,2\nP4,9,0,1,b,pose,4,4,4\n"
    )
    targets.write_text(
        "name,x_cmd,y_cmd,z_cmd,role,b1,b2,b3\nP1,0,0,0,,0,0,0\nP2,8,0,0,,0,0,0\nB,,,,base,,,\nP3,7,0,0,,3,3,3\nP4,9,0,0,,0,0,0\n"
    )
    table = read_table(export, targets=targets)
    assert [table.run_label[code] for code in table.run] == ["a", "a", "a", "a", "b"]
    assert table.role.tolist() == ["pose", "pose", "base", "pose", "pose"]
    assert table.command is not None
    assert_array_equal(table.command[:, 0], [1, 2, np.nan, 3, 4])
