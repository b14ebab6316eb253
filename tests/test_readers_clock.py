"""Clocks: offsets from UTC, dates in a column of their own, days as a spreadsheet counts them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from asking import never
from numpy.testing import assert_allclose, assert_array_equal

from ptt.errors import TableError
from ptt.run.readers import Mapping, Request, load_mapping, read_any
from ptt.run.readers.clock import names_a_date
from ptt.run.reading import read_table, read_targets_in_parts


def write(path: Path, titles: str, *rows: str) -> Path:
    """Readings 10 mm apart with further columns, parted by semicolons."""
    places = [f"{row};{10 * place};2;3" for place, row in enumerate(rows)]
    path.write_text("\n".join([f"{titles};x;y;z", *places]) + "\n", encoding="utf-8")
    return path


def clock(path: Path, **more: object) -> np.ndarray | None:
    return read_any(path, Request(ask=never, **more)).columns.get("time")


@pytest.mark.parametrize(
    ("first", "second", "later"),
    [
        ("2026-10-03T23:40:00+02:00", "2026-10-03T23:40:12+02:00", 12.0),
        ("2026-10-03T23:40:00.500+0200", "2026-10-03T23:40:12.750+0200", 12.25),
        ("2026-10-25T02:59:58+02:00", "2026-10-25T02:00:00+01:00", 2.0),  # the end of summer time
        ("2026-03-29 01:59:58 +01", "2026-03-29 03:00:00 +02", 2.0),
        ("2026-10-03T23:40:00-09:30", "2026-10-04T09:10:01Z", 1.0),
        ("2026-10-03T23:40:00Z", "2026-10-03 23:40:05 UTC", 5.0),
        ("2026-12-31 23:59:60Z", "2027-01-01 00:00:05Z", 5.0),  # a leap second
    ],
)
def test_offsets_from_utc(tmp_path: Path, first: str, second: str, later: float) -> None:
    assert_allclose(clock(write(tmp_path / "run.csv", "timestamp", first, second)), [0.0, later], atol=1e-6)


def test_an_offset_in_some_rows_only(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "time", "2026-10-03T23:40:00+02:00", "2026-10-03T23:40:12")
    with pytest.raises(TableError, match=r"run.csv row 3, column time: a time without an offset from UTC"):
        read_any(path)
    write(path, "time", "2026-10-03T23:40:00Z", "2026-10-03T23:40:12")
    assert_array_equal(clock(path), [0, 12])


@pytest.mark.parametrize("title", ["Datum", "Date", "Datum/Uhrzeit", "Date et heure", "日期"])
@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("03-Okt-2026 23:40:00", "04-Okt-2026 00:10:00"),
        ("03. Oktober 2026 23:40:00", "4. Oktober 2026 00:10:00"),
        ("31-Mrz-2026 23:40:00", "01-Apr-2026 00:10:00"),
        ("28. Februar 2026 23:40", "1. März 2026 00:10"),
        ("31-déc.-2026 23:40:00", "01-janv.-2027 00:10:00"),
        ("31 juil. 2026 23:40:00", "1 août 2026 00:10:00"),
        ("03.10.2026 23:40:00", "04.10.2026 00:10:00"),
        ("2026-10-03 23:40:00", "2026-10-04 00:10:00"),
    ],
)
def test_a_date_with_a_time_of_day_is_the_only_clock(tmp_path: Path, title: str, first: str, second: str) -> None:
    path = write(tmp_path / "run.csv", title, first, second)
    saved = read_any(path).understood
    assert_array_equal(clock(path), [0, 1800])
    assert not saved.ignored
    assert_array_equal(clock(path, mapping=saved.mapping), [0, 1800])


@pytest.mark.parametrize("first, second", [("03.10.2026", "04.10.2026"), ("46298", "46299"), ("", ""), ("noon", "3")])
def test_a_date_without_a_time_of_day_is_no_clock(tmp_path: Path, first: str, second: str) -> None:
    path = write(tmp_path / "run.csv", "Datum", first, second)
    assert clock(path) is None and read_any(path).understood.ignored == ("Datum",)


def test_a_date_beside_a_clock_gives_way(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "time_s;Datum", "1;03.10.2026 23:40:00", "2;03.10.2026 23:50:00")
    assert_array_equal(clock(path), [1, 2])
    path = write(tmp_path / "run.csv", "Datum", "03.10.2026 23:40:00", "03.10.2026 23:50:00")
    assert clock(path, mapping=Mapping(columns={"Datum": "ignore"})) is None


@pytest.mark.parametrize(
    ("first", "second", "third"),
    [
        ("13.10.2026;23:40:00", "14.10.2026;00:10:00", "16.10.2026;00:10:00"),
        ("3. Okt 2026;11:40:00 PM", "4. Okt 2026;12:10:00 AM", "6. Okt 2026;12:10:00 AM"),
        ("2026-10-03;23h40m00s", "2026-10-04;00h10m00s", "2026-10-06;00h10m00s"),
    ],
)
def test_a_date_belongs_to_the_time_of_day_beside_it(tmp_path: Path, first: str, second: str, third: str) -> None:
    path = write(tmp_path / "run.csv", "Datum;Uhrzeit", first, second, third)
    read = read_any(path)
    assert_array_equal(read.columns["time"], [0, 1800, 1800 + 2 * 86400])
    assert "Datum: the days of Uhrzeit" in read.understood.lines and not read.understood.ignored
    assert_array_equal(clock(path, mapping=read.understood.mapping), read.columns["time"])


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ("03.10.2026;23:40:00", "03.10.2026;00:10:00", "time would go back"),  # the day on which the run began
        ("01/02/26;23:40:00", "05/06/26;00:10:00", "written day first or month first"),
        ("99.99.2026;23:40:00", "99.99.2026;00:10:00", "not a date"),
    ],
)
def test_dates_that_say_nothing_leave_the_time_of_day_alone(tmp_path: Path, first: str, second: str, said: str) -> None:
    read = read_any(write(tmp_path / "run.csv", "Datum;Uhrzeit", first, second))
    assert_array_equal(read.columns["time"], [0, 1800])
    assert any(line.startswith("dates of Datum not used: ") and said in line for line in read.understood.lines)


@pytest.mark.parametrize("title", ["Date", "time_s", "time", "Zeit"])
def test_days_of_a_spreadsheet(tmp_path: Path, title: str) -> None:
    path, saved = (
        write(tmp_path / "run.csv", title, "46298.98611111", "46298.98625000", "46298.98638889"),
        tmp_path / "m",
    )
    read = read_any(path)
    assert_allclose(np.diff(read.columns["time"]), [12.0, 12.0], atol=2e-3)
    assert f"'{title}' is time [day], converted to s (as a spreadsheet counts them)" in read.understood.lines
    assert_array_equal(clock(path, mapping=read.understood.mapping), read.columns["time"])
    read_table(path, targets=write(tmp_path / "t.csv", "name", "a", "b", "c"), mapping=saved)
    assert load_mapping(saved).units[title] == "day"
    path.write_text(path.read_text().replace(".", ","), encoding="utf-8")
    assert_array_equal(clock(path), read.columns["time"])


@pytest.mark.parametrize(
    "rows",
    [
        ("46298.0", "46299.5", "46300.5"),  # seconds of the day
        ("46298.1", "46298.2", "46298.3"),  # 100 mm/s
        ("46298", "46299", "46300"),
        ("0.00011", "0.00025", "0.00038"),
    ],
)
def test_seconds_stay_seconds(tmp_path: Path, rows: Sequence[str]) -> None:
    assert_array_equal(clock(write(tmp_path / "run.csv", "time_s", *rows)), [float(row) for row in rows])


def test_days_of_a_long_list_of_targets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ptt.run.readers.parts.LINES", 3)
    path = write(tmp_path / "t.csv", "time_s", *(f"{46298.986 + row * 1e-4:.6f}" for row in range(5)))
    time = np.concatenate([table.time_s for table in read_targets_in_parts(path)])
    assert_allclose(np.diff(time), 8.64, atol=0.1)


@pytest.mark.parametrize("title", ["Update", "Datum 1 x", "Bezugsdatum", "date_code", "Uhrzeit", "role"])
def test_other_titles_name_no_date(title: str) -> None:
    assert not names_a_date(title)


@pytest.mark.parametrize(
    "cell", ["nan", "1_0", "inf", "--", "12.5", "11:75:03", "11:40:75", "2026-11-27 31:00", "13:05:00 PM"]
)
def test_a_time_that_is_none_is_named_by_its_row(tmp_path: Path, cell: str) -> None:
    """Text that Python takes for a number was taken for a time, and a stray cell was blamed on the first row."""
    first = "11:40:03" if ":" in cell else "1.000,5"
    path = write(tmp_path / "run.csv", "time", first, cell, first)
    with pytest.raises(TableError, match=rf"run.csv row 3, column time: not a time \('{cell}'\)"):
        clock(path)


def test_seconds_with_grouped_thousands(tmp_path: Path) -> None:
    """1.000 beside 999,5 is a thousand seconds, not one."""
    path = write(tmp_path / "run.csv", "Zeit;Foo", "999,5;2.000,5", ";1", "1.000;1", "1.001,25;1")
    assert_array_equal(clock(path), [999.5, np.nan, 1000.0, 1001.25])


def test_stamps_of_digits_alone_may_have_a_fraction(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "time", "20261003235959.5", "20261004000001.75")
    assert_allclose(clock(path), [0.0, 2.25], atol=1e-6)
