"""Cells that are no numbers: a row of units below the titles, empty targets, and what to do about the rest."""

from pathlib import Path

import pytest
from numpy.testing import assert_array_equal

from ptt.errors import TableError
from ptt.run.readers import read_any
from ptt.run.reading import read_table

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
    path.write_text(f"{OWN_TITLES}\n-,s,kg,C,mm/s,-,-,-,-,-,-\n{rows}", encoding="utf-8")
    assert_array_equal(read_table(path).measured[0], [1.0, 2.0, 3.0])
    path.write_text(f"{OWN_TITLES}\n,min,kg,C,mm/s,,,,,,\n{rows}", encoding="utf-8")
    with pytest.raises(TableError, match=r"row 2, column time_s: the row of units says 'min'"):
        read_table(path)


def test_a_row_of_units_says_what_the_titles_say(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    titles, rows = (
        "Soll X,Soll Y,Soll Z,X,Y (mm),Z/mm,Nutzlast [kg],Temp,Foo [x]",
        "1,2,3,1,2,3,2,20,7\n4,5,6,4,5,6,0,21,7\n",
    )
    path.write_text(f"{titles}\nmm,mm,mm,mm,mm,mm,kg,°C,mm\n{rows}", encoding="utf-8")
    table = read_table(path)
    assert_array_equal(table.measured, table.target)
    assert_array_equal(table.payload_kg, [2.0, 0.0])
    assert "'Nutzlast [kg]' is payload [kg]" in table.understood.lines
    assert "'Y (mm)' is y_meas [mm]" in table.understood.lines
    path.write_text(f"{titles}\nmm,mm,mm,mm,mm,mm,lb,°C,mm\n{rows}", encoding="utf-8")
    with pytest.raises(
        TableError, match=r"row 2, column Nutzlast \[kg\]: the row of units says 'lb'; correct the title"
    ):
        read_table(path)


def test_a_row_of_units_may_hold_words(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    titles, rows = "Name;X;Y;Z;Zeit;Nr", "A;1;2;3;27.11.2026 11:40:03;1\nB;1;2;4;27.11.2026 11:40:05;2\n"
    path.write_text(f"{titles}\nText;mm;mm;m;dd.mm.yyyy hh:mm:ss;\n{rows}", encoding="utf-8")
    read = read_any(path)
    assert_array_equal(read.columns["z_meas"], [3000, 4000])
    assert_array_equal(read.columns["time"], [0, 2])
    path.write_text(f"{titles}\nText;mm;mm;furlong;;\n{rows}", encoding="utf-8")
    with pytest.raises(TableError, match=r"row 2, column X: not a number \('mm'\)"):  # as many words as units
        read_any(path)
    path.write_text(f"{titles}\n;mm;mm;furlong;;\n{rows}", encoding="utf-8")
    with pytest.raises(TableError, match="unit 'furlong' does not fit z_meas"):
        read_any(path)
    path.write_text("name,x,y,z\nstart,-,-,-\nA,1,2,3\nB,1,2,4\n", encoding="utf-8")
    with pytest.raises(TableError, match=r"row 2, column x: not a number \('-'\)"):
        read_any(path)


@pytest.mark.parametrize(
    ("cell", "title", "fix"),
    [
        ("1,5 mm", "X", r"write the number alone, and the unit in the title: 'X \[mm\]'"),
        ("1,5mm", "X [mm]", r"write the number alone$"),
        ("X [mm]", "X [mm]", "the row of titles once more: remove it"),
        ("1,5 ?", "X", "leave the cell empty"),
        ("inf", "Soll X", "write the target"),
        ("inf", "Schlitten 1", "write what was sent"),
    ],
)
def test_what_to_do_about_a_cell_that_is_no_number(tmp_path: Path, cell: str, title: str, fix: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"{title};Y;Z\n1,5;2,5;3,5\n{cell};2,5;3,5\n", encoding="utf-8")
    with pytest.raises(TableError, match=fix):
        read_any(path)


def test_an_empty_target_is_named_as_the_file_names_it(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("Soll X;Soll Y;Soll Z;X;Y;Z\n1;2;3;1;2;3\n4;;6;4;5;6\n", encoding="utf-8")
    with pytest.raises(TableError, match=r"row 3, column Soll Y: empty target; fill in where the tool should be"):
        read_table(path)
    path.write_text("Schlitten 1;Schlitten 2;Schlitten 3;X;Y;Z\n1;2;3;1;2;3\n4;;6;4;5;6\n", encoding="utf-8")
    with pytest.raises(TableError, match=r"row 3, column Schlitten 2: empty command; fill in what was sent"):
        read_table(path)


def test_a_first_row_of_dashes_or_ones_is_no_row_of_units(tmp_path: Path) -> None:
    """A target that was not read was dropped with its row, and that at 1, 1, 1 was refused for the unit `1`."""
    path = tmp_path / "run.csv"
    path.write_text("x_meas;y_meas;z_meas\n-;-;-\n1;2;3\n4;5;6\n")
    with pytest.raises(TableError, match=r"row 2, column x_meas: not a number \('-'\); leave the cell empty"):
        read_any(path)
    path.write_text("x_cmd;y_cmd;z_cmd\n1;1;1\n4;5;6\n")
    assert_array_equal(read_table(path, purpose="targets").target, [[1, 1, 1], [4, 5, 6]])


def test_columns_of_one_title_are_all_kept(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("x_meas;y_meas;z_meas;note;note;note (2);note\n1;2;3;a;b;c;d\n4;5;6;e;f;g;h\n")
    kept = {"note": ["a", "e"], "note (3)": ["b", "f"], "note (2)": ["c", "g"], "note (4)": ["d", "h"]}
    assert {title: values.tolist() for title, values in read_any(path).extra.items()} == kept
