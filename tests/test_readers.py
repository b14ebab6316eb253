"""Exports of tracker and robot software: each format read, ambiguity asked, answers saved and reused."""

from pathlib import Path

import numpy as np
import pytest
from asking import FIXTURES, never, say
from numpy.testing import assert_allclose, assert_array_equal

from ptt.errors import TableError
from ptt.run.readers import Request, read_any
from ptt.run.readers.mapping import Ask
from ptt.run.reading import read_table

UR10 = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "ur10_ipa"
SERIES = {
    "A": ("Series_A/measurements_grid.csv", 11911),
    "B": ("Series_B/measurements_joint_configurations.csv", 1495),
    "C": ("Series_C/measurements_random_poses.csv", 2773),
    "D": ("Series_D/measurements_iso_cubes.csv", 632),
}


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


def test_bytes_that_no_text_has_are_no_question_of_encoding(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_bytes(bytes(range(1, 256)) * 3)
    with pytest.raises(TableError, match="not a text file"):
        read_table(tmp_path / "run.csv")


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
    assert times("01/02/25 23:50", "02/02/25 00:10", ask=never) == [0, 1200]
    assert times("01/02/25 10:00", "02/02/25 10:00", ask=say("month-first")) == [0, 31 * 86400]
    assert times("0.5", "1e1") == [0.5, 10]
    assert times("30-Nov-2026 23:59:50", "01-Dec-2026 00:00:20.5") == [0, 30.5]
    assert times("3 September 2026 11:40:03 PM", "3 Sep 2026 11:40:05 PM", "4 Sept 26 00:00") == [0, 2, 1197]
    assert times("28. März 2026 23:59:50", "29. MRZ 2026 00:00:00") == [0, 10]
    assert times("31 juil. 2026 10:00", "1 août 2026 10:00", "1/déc/26 10:00") == [0, 86400, 123 * 86400]
    assert times('"Nov 30, 2026 11:59:50 PM"', '"December 1, 2026 12:00:20 AM"') == [0, 30]
    assert times("12h50m03s", "12h50m05.5s", "12h51") == [0, 2.5, 57]
    assert times("23h59", "00h01") == [0, 120]
    with pytest.raises(TableError, match=r"not a time \('27-Foo-2026 11:40:03'\)"):
        times("27-Nov-2026 11:40:03", "27-Foo-2026 11:40:03")
    with pytest.raises(
        TableError,
        match=r"t\.csv row 3, column time: not a time \('noon'\); .* seconds or a time such as 2026-11-27 11",
    ):
        times("10:00:00", "noon")
    with pytest.raises(TableError, match=r"t\.csv row 2, column time: not a date"):
        times("2025-02-30 10:00", "2025-02-28 10:00")


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


@pytest.mark.parametrize(
    ("titles", "end", "not_used"),
    [("# ,{}", "", "column 1"), ("{},", ",", ""), ("{},,", ",3,", "column 7")],
    ids=["a hash as the first title", "a delimiter at the end", "a column without a title"],
)
def test_columns_without_a_title_are_named_by_their_place(tmp_path: Path, titles: str, end: str, not_used: str) -> None:
    begin = "7," if titles.startswith("#") else ""
    rows = [f"{begin}{row},2,3,{row},2,{row}{end}" for row in range(1, 5)]
    (tmp_path / "run.csv").write_text(
        "\n".join([titles.format("x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas"), *rows]) + "\n"
    )
    understood = read_table(tmp_path / "run.csv").understood
    assert [line for line in understood.lines if line.startswith("not used")] == [f"not used: {not_used}"] * bool(
        not_used
    )
    assert not any("comment" in line for line in understood.lines) and "" not in understood.ignored
