"""Exports of tracker and robot software: each format read, ambiguity asked, answers saved and reused."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from ptt.errors import TableError
from ptt.run.readers import Mapping, Request, load_mapping, read_any, save_mapping
from ptt.run.readers.columns import UNITS, Meaning, canonical, dimension_of, file_title, to_standard
from ptt.run.readers.mapping import Ask
from ptt.run.readers.separators import find_decimal, find_delimiter
from ptt.run.readers.titles import meaning_of, split_unit
from ptt.run.reading import read_table

FIXTURES = Path(__file__).parent / "fixtures"
UR10 = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "ur10_ipa"
SERIES = {
    "A": ("Series_A/measurements_grid.csv", 11911),
    "B": ("Series_B/measurements_joint_configurations.csv", 1495),
    "C": ("Series_C/measurements_random_poses.csv", 2773),
    "D": ("Series_D/measurements_iso_cubes.csv", 632),
}


def say(answer: str) -> Callable[[str, Sequence[str]], str]:
    return lambda question, choices: answer


def never(question: str, choices: Sequence[str]) -> str:
    raise AssertionError(f"asked: {question}")


@pytest.mark.parametrize(
    "title, quantity, unit",
    [
        ("x_meas", "x_meas", "mm"),
        ("x_meas_um", "x_meas", "um"),
        ("q12_cmd_deg", "q12_cmd", "deg"),
        ("time_s", "time", "s"),
        ("temp_c", "temp", "c"),
        ("X", "x", None),
        ("X [mm]", "x", "mm"),
        ("Y(m)", "y", "m"),
        ("Z/µm", "z", "um"),
        ("z, mm", "z", "mm"),
        ("Measured X [in]", "x_meas", "in"),
        ("Actual.Y", "y_meas", None),
        ("Nominal Z", "z_cmd", None),
        ("Goal x", "x_cmd", None),
        ("Soll X [mm]", "x_cmd", "mm"),
        ("measurement_std_x", "x_std", None),
        ("Std Dev Y (um)", "y_std", "um"),
        ("目标x", "x_cmd", None),
        ("实测Ｙ［毫米］", "y_meas", "mm"),
        ("X坐标实测值（mm）", "x_meas", "mm"),
        ("理论Z", "z_cmd", None),
        ("温度", "temp", None),
        ("环境温度(℃)", "temp", "c"),
        ("负载（千克）", "payload", "kg"),
        ("Last [kg]", "payload", "kg"),
        ("Load (kg)", "payload", "kg"),
        ("Masse [g]", "payload", "g"),
        ("时间/秒", "time", "s"),
        ("点号", "name", None),
        ("滑块2指令[mm]", "b2_cmd", "mm"),
        ("关节3角度（度）", "q3_cmd", "deg"),
        ("Joint 4 [rad]", "q4_cmd", "rad"),
        ("b2", "b2_bare", None),
        ("shoulder_lift_joint", "q2_cmd", "rad"),
        ("wrist_3_joint", "q6_cmd", "rad"),
        ("速度[mm/min]", "feed", "mm_min"),
        ("Feed rate (mm/s)", "feed", "mm_s"),
        ("Torque 2 [N m]", "tau2", ""),
        ("Point ID", "name", None),
        ("X轴坐标/mm", "x", "mm"),
        ("Joint 2 torque (Nm)", "tau2", ""),
        ("关节1方向", "dir1", None),
        ("J6 [deg]", "q6_cmd", "deg"),
    ],
)
def test_titles(title: str, quantity: str, unit: str | None) -> None:
    meaning = meaning_of(title)
    assert meaning is not None
    assert (meaning.quantity, meaning.unit) == (quantity, unit)


@pytest.mark.parametrize(
    "title",
    [
        "",
        "rms",
        "Goal roll",
        "measurement_rx",
        "dx",
        "x_error",
        "偏差x",
        "备注",
        "Load [%]",
        "last x",
        "xy",
        "joint",
        "b0_cmd",
        "deviation Z",
        "3",
    ],
)
def test_titles_with_unknown_words_mean_nothing(title: str) -> None:
    assert meaning_of(title) is None


def test_unknown_unit_is_reported_not_dropped() -> None:
    assert split_unit("X [furlong]") == ("x", "(furlong)")


@given(st.sampled_from(["x_meas", "q3_cmd", "time", "payload", "temp", "feed", "dir2", "name", "qw_cmd", "b7_cmd"]))
def test_canonical_names_round_trip(quantity: str) -> None:
    meaning = canonical(file_title(quantity))
    assert meaning is not None
    assert meaning.quantity == quantity
    values = np.array([1.25, -3.0])
    if meaning.unit:
        assert_array_equal(to_standard(values, quantity, meaning.unit), values)


@given(st.floats(-1e6, 1e6), st.sampled_from(["mm", "um", "cm", "m", "in"]))
def test_units_scale(value: float, unit: str) -> None:
    factor = UNITS[dimension_of("x_meas")][unit][0]
    assert_allclose(to_standard(np.array([value]), "x_meas", unit), [value * factor], rtol=1e-15)


@given(
    rows=st.lists(
        st.lists(st.floats(-5e3, 5e3).map(lambda v: f"{v:.4f}"), min_size=4, max_size=4), min_size=2, max_size=9
    ),
    delimiter=st.sampled_from(["\t", ";", ",", "|", " "]),
    comma=st.booleans(),
)
def test_delimiter_and_decimal_are_found(rows: list[list[str]], delimiter: str, comma: bool) -> None:
    decimal = "," if comma and delimiter != "," else "."
    lines = [delimiter.join(cell.replace(".", decimal) for cell in row) for row in rows]
    assert find_delimiter(lines) == delimiter
    assert find_decimal(lines, delimiter, "file", never) == decimal


def test_spatial_analyzer_with_targets() -> None:
    table = read_table(FIXTURES / "spatial_analyzer.txt", targets=FIXTURES / "targets.csv", ask=never)
    assert table.name.tolist() == ["P1", "P2", "P3", "P4", "P5"]
    assert table.observed.tolist() == [True, True, True, False, True]
    assert_array_equal(table.measured[2], [2275.518871, -2602.969984, -275.078440])
    assert_array_equal(table.target[:, 0], [0, 10, 20, 30, 40])
    assert_array_equal(table.payload_kg, [2] * 5)
    assert table.time_s is not None
    assert_array_equal(table.time_s, [0, 0, 0, np.nan, 25])
    assert_array_equal(table.line, [4, 5, 6, 5, 7])
    text = str(table.understood)
    for finding in (
        "SpatialAnalyzer",
        "1 ended on '*'",
        "group 'run1'",
        "paired by name",
        "1 target without reading: row 5 P4",
    ):
        assert finding in text


def test_spatial_analyzer_names_of_any_length() -> None:
    export = read_any(FIXTURES / "spatial_analyzer_names.txt")
    assert export.columns["name"].tolist() == ["", "P1", "group/P2", "coll/group/P3"]
    assert_allclose(export.columns["x_meas"], np.array([10, 11, 12, 13]) * 25.4, rtol=1e-15)
    assert_array_equal(export.columns["time"], [0, 0, 1, 2])


def test_names_with_a_group_match_bare_targets(tmp_path: Path) -> None:
    text = "// SpatialAnalyzer\n" + "".join(f"g{i}, P{i}, 0, {i}, {i * i}, 300\n" for i in (1, 2, 4))
    path = tmp_path / "sa.txt"
    path.write_text(text, encoding="utf-8")
    table = read_table(path, targets=FIXTURES / "targets.csv")
    assert table.observed.tolist() == [True, True, False, True, False]


@pytest.mark.parametrize(
    "text",
    [
        "// AXES = CYLINDRICAL: R, Theta, Z (mm)\ng, P1, 0, 1, 2, 3\ng, P2, 0, 1, 2, 4\n",
        "name,R,Theta,Phi\na,1,2,3\nb,2,3,4\n",
        "点号,水平角,垂直角,斜距\na,1,2,3\nb,2,3,4\n",
        "R [mm],Theta [deg],Z [mm]\n1,2,3\n2,3,4\n",
    ],
)
def test_polar_coordinates_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "polar.txt"
    path.write_text(text, encoding="utf-8")
    for each in (path, FIXTURES / "polar.txt"):
        with pytest.raises(TableError, match=r"polar or cylindrical .*export Cartesian x, y, z in mm"):
            read_table(each)


def test_plain_ids_and_coordinates() -> None:
    export = read_any(FIXTURES / "plain.txt")
    assert export.columns["name"].tolist() == ["1", "2", "3"]
    assert_array_equal(export.columns["z_meas"], [-442.56, -442.55, -442.53])
    assert "'column 2' is x_meas [mm] (no unit in the file)" in str(export.understood)


def test_ids_with_gaps_are_row_numbers_of_the_targets() -> None:
    table = read_table(FIXTURES / "spaces_with_gaps.txt", targets=FIXTURES / "targets_unnamed.csv", ask=never)
    assert table.observed.tolist() == [True, True, False, True, False, False, True]
    assert_array_equal(table.measured[6], [2356.48, -2416.21, -442.50])
    assert "space between columns" in str(table.understood)
    assert "3 targets without reading: row 4, row 6, row 7" in str(table.understood)


def test_semicolons_decimal_commas_quotes_and_german() -> None:
    table = read_table(FIXTURES / "semicolon.csv", ask=never)
    assert table.name.tolist() == ["A;1", "A2", "A3"]
    assert_array_equal(table.target[2], [10.5, 20.25, 300])
    assert_array_equal(table.measured[1], [10.517, -0.031, 300.101])
    assert table.observed.tolist() == [True, True, False]
    assert_array_equal(table.temp_c, [20.5, 20.5, 20.75])
    assert table.understood.ignored == ("Bemerkung",)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "gbk"])
def test_chinese_titles_in_every_encoding(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes((FIXTURES / "chinese.csv").read_text(encoding="utf-8").encode(encoding))
    table = read_table(path, ask=never)
    assert_array_equal(table.target[2], [10.5, 20.25, 300])
    assert_array_equal(table.command[0], [582.84, 582.84, 582.84])
    assert_array_equal(table.measured[0], [0.012, -0.034, 300.105])
    assert_array_equal(table.temp_c, [20.5, 20.5, 20.75])
    assert_array_equal(table.payload_kg, [2, 2, 2])
    assert table.extra["备注"].tolist() == ["", "重测", ""]


def test_western_text_is_not_taken_for_chinese(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    text = "Prüfer,X [mm],Y [mm],Z [mm],Temp [°C]\na,1,2,3,20\nb,2,3,4,21\n"
    path.write_bytes(text.encode("cp1252"))
    export = read_any(path)
    assert export.understood.ignored == ("Prüfer",)
    assert_array_equal(export.columns["temp"], [20, 21])


def test_units_in_a_second_row_and_titles_in_a_comment(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text("X\tY\tZ\n[m]\t[m]\t[m]\n0.1\t0.2\t0.3\n0.2\t0.2\t0.3\n", encoding="utf-8")
    assert_allclose(read_any(path).columns["x_meas"], [100, 200], rtol=1e-15)
    path.write_text("# id x[m] y[m] z[m]\n1 0.1 0.2 0.3\n2 0.2 0.2 0.3\n", encoding="utf-8")
    assert_allclose(read_any(path).columns["x_meas"], [100, 200], rtol=1e-15)
    path.write_text("# units: m\n1 0.1 0.2 0.3\n2 0.2 0.2 0.3\n", encoding="utf-8")
    assert_allclose(read_any(path).columns["x_meas"], [100, 200], rtol=1e-15)


AMBIGUOUS = {
    "thousands": (
        "x\ty\tz\n1,234\t2,345\t3,456\n1,235\t2,345\t3,456\n",
        "is the comma in 1,234 a decimal sign",
        "decimal",
    ),
    "two signs": ("x;y;z\n1,25;2.5;3\n1,5;2.5;3\n", "which is the decimal sign", "decimal"),
    "two columns": ("Measured X;实测X;y;z\n1;2;3;4\n2;3;4;5\n", "which column is x_meas", "[columns]"),
    "dates": ("x,y,z,time\n1,2,3,01/02/25 10:00\n1,2,4,02/02/25 10:00\n", "written day first or month first", "dates"),
    "payload in newtons": ("x,y,z,payload [N]\n1,2,3,4\n1,2,4,5\n", "which unit is it in", '[units] "payload [N]"'),
    "unknown unit": ("x [furlong],y,z\n1,2,3\n1,2,4\n", "unit '(furlong)' does not fit x_meas", "[units]"),
    "feed": ("x,y,z,feed\n1,2,3,4\n1,2,4,5\n", "which unit is feed in", "[units]"),
    "epoch": (
        "x,y,z,time\n1,2,3,1600000000000\n1,2,4,1600000000100\n",
        "which unit is a time of 1600000000100",
        "[units]",
    ),
}


@pytest.mark.parametrize("text, question, key", AMBIGUOUS.values(), ids=AMBIGUOUS.keys())
def test_ambiguity_is_asked(tmp_path: Path, text: str, question: str, key: str) -> None:
    path = tmp_path / "export.txt"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TableError) as caught:
        read_any(path)
    assert question in str(caught.value)
    assert f"answer with --map FILE.toml, {key}" in str(caught.value)
    asked: list[str] = []

    def ask(what: str, choices: Sequence[str]) -> str:
        asked.append(what)
        return choices[0]

    first = read_any(path, Request(ask=ask))
    assert len(asked) == 1
    if key != "[units]" or "time" not in text:
        again = read_any(path, Request(mapping=first.understood.mapping, ask=never))
        for quantity, values in first.columns.items():
            assert_array_equal(again.columns[quantity], values)


def test_an_answer_that_is_no_choice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "export.txt"
    path.write_text(AMBIGUOUS["feed"][0], encoding="utf-8")
    with pytest.raises(TableError, match="'knots' does not answer"):
        read_any(path, Request(ask=say("knots")))


def test_stamps(tmp_path: Path) -> None:
    def times(*cells: str, ask: Ask | None = None) -> list[float]:
        path = tmp_path / "t.csv"
        path.write_text("x,y,z,time\n" + "".join(f"1,2,{i},{c}\n" for i, c in enumerate(cells)), encoding="utf-8")
        return read_any(path, Request(ask=ask)).columns["time"].tolist()

    assert times("2025-12-02 16:52:45", "2025-12-02T16:52:46.5") == [0, 1.5]
    assert times("2025-12-31 23:59:59", "2026-01-01 00:00:01") == [0, 2]
    assert times("20200714163904", "20200714164004") == [0, 60]
    assert times("16:52:45", "16:53:00") == [0, 15]
    assert times("02/12/25 04:00:00 PM", "02/12/25 04:00:05 PM") == [0, 5]
    assert times("31/01/25 10:00", "01/02/25 10:00") == [0, 86400]
    assert times("01/31/25 10:00", "02/01/25 10:00") == [0, 86400]
    assert times("01/02/25 10:00", "02/02/25 10:00", ask=say("day-first")) == [0, 86400]
    assert times("01/02/25 10:00", "02/02/25 10:00", ask=say("month-first")) == [0, 31 * 86400]
    assert times("0.5", "1e1") == [0.5, 10]
    with pytest.raises(TableError, match=r"t\.csv row 3: not a time \('noon'\)"):
        times("10:00:00", "noon")
    with pytest.raises(TableError, match="not a date"):
        times("2025-02-30 10:00", "2025-02-28 10:00")


def test_mapping_is_saved_and_reused(tmp_path: Path) -> None:
    path, saved = tmp_path / "run.csv", tmp_path / "answers.toml"
    path.write_text("Ort A;Ort B;Ort C;joint1;joint2\n0,1;0,2;0,3;90;45\n0,2;0,2;0,3;80;40\n", encoding="utf-8")
    with pytest.raises(TableError, match="which unit is q1_cmd in"):
        read_table(path, joints=2, joint_prefix="q")
    columns = {"Ort A": "x_meas", "Ort B": "y_meas", "Ort C": "z_meas"}
    units = {"Ort A": "m", "Ort B": "m", "Ort C": "m", "joint1": "deg", "joint2": "deg"}
    first = read_table(path, joints=2, joint_prefix="q", mapping=Mapping(columns=columns, units=units))
    assert_allclose(first.measured[0], [100, 200, 300], rtol=1e-15)
    assert_allclose(first.command[0], np.radians([90, 45]), rtol=1e-15)
    save_mapping(first.understood.mapping, saved)
    assert load_mapping(saved) == first.understood.mapping
    again = read_table(path, joints=2, joint_prefix="q", mapping=saved, ask=never)
    assert_array_equal(again.measured, first.measured)


def test_a_mapping_path_that_does_not_exist_is_written(tmp_path: Path) -> None:
    saved = tmp_path / "answers.toml"
    first = read_table(FIXTURES / "spatial_analyzer.txt", targets=FIXTURES / "targets.csv", mapping=saved)
    answers = load_mapping(saved)
    assert answers.pairing == "name"
    assert answers.targets is not None
    assert answers.targets.columns["payload_kg"] == "payload"
    again = read_table(FIXTURES / "spatial_analyzer.txt", targets=FIXTURES / "targets.csv", mapping=saved, ask=never)
    assert_array_equal(again.measured, first.measured)
    assert_array_equal(again.time_s, first.time_s)
    said = f"{saved}: was not there; written with what was understood of columns and units"
    assert said in first.understood.lines and said not in again.understood.lines


def test_mapping_can_ignore_and_names_what_is_absent(tmp_path: Path) -> None:
    columns = {"温度（℃）": "ignore", "nowhere": "x_meas"}
    table = read_table(FIXTURES / "chinese.csv", mapping=Mapping(columns=columns))
    assert table.temp_c is None
    assert "in the mapping but not in the file: nowhere" in str(table.understood)


@pytest.mark.parametrize(
    "text, message",
    [
        ("colour = 'red'", "unknown key 'colour'"),
        ("decimal = ':'", "decimal = ':' is not known"),
        ("columns = 'x'", "key 'columns' is not a table of texts"),
        ("[units]\nx = 3", "key 'units' is not a table of texts"),
        ("encoding = 8", "key 'encoding' is not a text"),
        ("= =", "not valid TOML"),
        ("[targets]\ncolour = 'red'", "unknown key 'colour'"),
    ],
)
def test_bad_mapping_files(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "map.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TableError) as caught:
        read_table(FIXTURES / "chinese.csv", mapping=path)
    assert message in str(caught.value)


def test_bad_meaning_in_a_mapping() -> None:
    with pytest.raises(TableError, match="unknown meaning 'colour'"):
        read_any(FIXTURES / "chinese.csv", Request(mapping=Mapping(columns={"备注": "colour"})))


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


OWN_TITLES = "name,time_s,payload_kg,temp_c,feed_mm_s,x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas"


def test_a_row_of_units_below_the_programs_own_titles(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = "A,60,2,20,50,1,2,3,1,2,3\nB,120,0,21,50,4,5,6,4,5,6\n"
    for units in (",s,kg,C,mm/s,mm,mm,mm,mm,mm,mm", "-,[s],(kg),[°C],mm/s,,,,mm,mm,mm"):
        path.write_text(f"{OWN_TITLES}\n{units}\n{rows}", encoding="utf-8")
        table = read_table(path)
        assert table.time_s is not None and table.payload_kg is not None and table.temp_c is not None
        assert (table.time_s[0], table.payload_kg[0], table.temp_c[0]) == (60.0, 2.0, 20.0)
        assert f"columns as named: {OWN_TITLES.replace(',', ', ')}" in str(table.understood)
    path.write_text(f"{OWN_TITLES}\n,s,kg,C,mm/s,m,m,m,m,m,m\n{rows}", encoding="utf-8")
    assert_array_equal(read_table(path).measured[0], [1000.0, 2000.0, 3000.0])
    path.write_text(f"{OWN_TITLES}\n,min,kg,C,mm/s,,,,,,\n{rows}", encoding="utf-8")
    with pytest.raises(TableError, match=r"row 2, column time_s: the row of units says 'min'"):
        read_table(path)


def test_a_unit_that_a_title_says_twice() -> None:
    assert meaning_of("time_s [s]") == Meaning("time", "s") and meaning_of("temp_c (°C)") == Meaning("temp", "c")
    assert meaning_of("time_s [min]") is None


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
    with pytest.raises(TableError, match="time goes back"):  # in order as listed: the clock does not count
        pair(tmp_path, midnight, targets)
    short = "name,x_cmd,y_cmd,z_cmd\nA,1,0,0\nB,2,0,0\nA,1,0,0\n"
    often = "name,x,y,z\n" + 20 * "A,1,0,0\nB,2,0,0\nA,1,0,0\n"
    assert pair(tmp_path, often, short)[1] == 20 * [1.0, 2.0, 1.0]
    once = "name,x_cmd,y_cmd,z_cmd\n" + "".join(f"p{i},{i},0,0\n" for i in range(8))
    back = "name,x,y,z\n" + "".join(f"p{i},{i},0,0\n" for i in range(7, -1, -1))
    assert pair(tmp_path, back, once)[1] == list(range(8))
    thrice = "name,x_cmd,y_cmd,z_cmd\n" + "".join(3 * f"p{i},{i},0,0\n" for i in range(8))
    back = "name,x,y,z\n" + "".join(3 * f"p{i},{i},0,0\n" for i in range(7, -1, -1))
    assert pair(tmp_path, back, thrice)[1] == np.repeat(range(8), 3).tolist()


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


def test_pairing_keeps_the_readings_own_columns(tmp_path: Path) -> None:
    targets = "name,x_cmd,y_cmd,z_cmd,temp_c,note\nA,1,0,0,20,a\nB,2,0,0,20,b\n"
    run, wanted = tmp_path / "export.csv", tmp_path / "targets.csv"
    run.write_text("name,x,y,z,temp_c\nA,1,0,0,25\nB,2,0,0,26\n", encoding="utf-8")
    wanted.write_text(targets, encoding="utf-8")
    table = read_table(run, targets=wanted)
    assert_array_equal(table.temp_c, [25, 26])
    assert table.extra["note"].tolist() == ["a", "b"]


def test_driver_file_becomes_a_table() -> None:
    table = read_table(FIXTURES / "ur_driver.csv", joints=6, joint_prefix="q", ask=never)
    assert_allclose(table.target[0], [400, -400, 800], rtol=1e-15)
    assert table.command is not None
    assert_array_equal(table.command[1], [-0.908775, -1.88313, 1.92746, -3.18587, -2.05921, -0.000741784])
    assert_array_equal(table.measured[0], [-0.50720828, -3343.1516, -426.95048])
    assert_array_equal(table.std[0], [0.011904, 0.0080769, 0.0088318])
    assert table.time_s is None
    assert "stamps lost their digits" in str(table.understood)
    assert table.understood.ignored == ("Timestamp", "Goal roll", "measurement_rx")


@pytest.mark.skipif(not UR10.is_dir(), reason="the UR10 measurements are not beside this checkout")
@pytest.mark.parametrize("series", SERIES)
def test_ur10_measurements(series: str) -> None:
    name, rows = SERIES[series]
    # series A ends with poses measured again: they belong where their time stamps say
    order = {"order": "time"} if series == "A" else None
    table = read_table(UR10 / name, joints=6, joint_prefix="q", ask=never, set_values=order)
    assert table.rows == rows
    assert table.joints == 6
    assert table.observed.all()
    assert (table.std is None) == (series == "A")
    assert (table.time_s is not None) == (series == "A")
    assert np.abs(table.command).max() < 2 * np.pi + 0.1
    assert 300 < np.linalg.norm(table.target, axis=1).max() < 1600
    # the width of the cloud does not depend on the tracker's frame; the reflector stands off the flange
    wanted, found = (np.sqrt(points.var(axis=0).sum()) for points in (table.target, table.measured))
    assert 0.99 < found / wanted < 1.01


def test_odd_but_common_files(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("sep=;\nx;y;z\n1,5;2;3;\n2,5;2;3;\n", encoding="utf-8")
    assert_array_equal(read_any(path).columns["x_meas"], [1.5, 2.5])
    path.write_text('name,x_meas,y_meas,z_meas,7\n#1,1,2,3,0\n"#2",2,2,3,0\n#3,1,2,4,0\n4,1,2,4,0\n', encoding="utf-8")
    export = read_any(path)
    assert export.columns["name"].tolist() == ["#2", "4"]
    assert "warning: 2 of them look like rows, first '1,1,2,3,0'" in str(export.understood)
    path.write_bytes(b"PK\x03\x04 rest of a workbook")
    with pytest.raises(TableError, match="an Excel workbook, not text; save the sheet as CSV"):
        read_any(path)


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
    with pytest.raises(TableError, match=r"targets\.csv row 3, column x_cmd: empty command"):
        read_table(FIXTURES / "spatial_analyzer.txt", targets=targets)


@pytest.mark.parametrize(
    ("lines", "delimiter"),
    [
        (["name\trun\tx\ty", "p1\trun 1\t1.5\t2.5", "p2\trun 1\t3.5\t4.5"], "\t"),
        (["point 1\tx mm\ty\tz", "no 1\t1.5\t2.5\t3.5", "no 2\t3.5\t4.5\t5.5"], "\t"),
        (["x\t\ty   z", "1.5\t\t2.5   3.5", "2.5\t\t3.5   4.5"], " "),
        (["p 1\t1.5 2.5 3.5", "p 2\t2.5 3.5 4.5"], " "),
    ],
)
def test_a_blank_in_a_cell_cuts_no_column(lines: list[str], delimiter: str) -> None:
    assert find_delimiter(lines) == delimiter


def test_the_log_of_a_linear_scale_is_told_which_command_reads_it() -> None:
    log = Path(__file__).resolve().parents[1] / "data" / "scale.csv"
    with pytest.raises(TableError, match=r"scale\.csv: a log of a linear scale.*`ptt backlash` reads it"):
        read_table(log)


def test_a_run_that_a_scale_was_read_beside_is_a_run(tmp_path: Path) -> None:
    lines = (FIXTURES.parents[1] / "data" / "volume.csv").read_text(encoding="utf-8").splitlines()
    beside = [f"{lines[0]},scale_mm,motor_mm", *(f"{line},1.0,1.0" for line in lines[1:])]
    (tmp_path / "run.csv").write_text("\n".join(beside), encoding="utf-8")
    assert read_table(tmp_path / "run.csv").rows == len(lines) - 1


def test_rows_of_base_reflectors_alone_are_refused(tmp_path: Path) -> None:
    text = "role,x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas\nbase,1,2,3,1,2,3\nbase,4,5,6,4,5,6\n"
    (tmp_path / "base.csv").write_text(text)
    with pytest.raises(TableError, match=r"base\.csv: all 2 rows are of base reflectors .*; write pose or nothing in"):
        read_table(tmp_path / "base.csv")
    (tmp_path / "run.csv").write_text(text.replace("base,4", "pose,4"))
    assert read_table(tmp_path / "run.csv", also=[tmp_path / "base.csv"]).rows == 4
