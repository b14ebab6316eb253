"""Real exports: preambles above the titles, grouped thousands, German and French titles."""

from pathlib import Path

import numpy as np
import pytest

from ptt.errors import TableError
from ptt.run.readers import Mapping
from ptt.run.reading import read_table

ROWS = ((1.5, 2.25, -3.125, 1283.842, 999.5, 1001.25), (10.0, 20.5, -30.25, 1300.5, 2001.125, 998.0))
HEAD = "x_cmd{0}y_cmd{0}z_cmd{0}x_meas{0}y_meas{0}z_meas\n"


def grouped(value: float, thousands: str, decimal: str) -> str:
    return f"{value:,.3f}".replace(",", "T").replace(".", "D").replace("T", thousands).replace("D", decimal)


@pytest.mark.parametrize(
    ("thousands", "decimal", "delimiter"),
    [(",", ".", ";"), (",", ".", "\t"), (".", ",", ";"), ("'", ".", ";"), ("\u00a0", ",", ";"), ("\u202f", ",", "\t")],
)
def test_grouped_thousands(tmp_path: Path, thousands: str, decimal: str, delimiter: str) -> None:
    lines = [delimiter.join(grouped(value, thousands, decimal) for value in row) for row in ROWS]
    path = tmp_path / "run.csv"
    path.write_text(HEAD.format(delimiter) + "\n".join(lines) + "\n", encoding="utf-8")
    table = read_table(path)
    np.testing.assert_array_equal(np.hstack([table.target, table.measured]), np.array(ROWS))


def test_grouped_thousands_in_quotes_between_commas(tmp_path: Path) -> None:
    lines = [",".join(f'"{value:,.3f}"' for value in row) for row in ROWS]
    path = tmp_path / "run.csv"
    path.write_text(HEAD.format(",") + "\n".join(lines) + "\n")
    table = read_table(path)
    np.testing.assert_array_equal(np.hstack([table.target, table.measured]), np.array(ROWS))


@pytest.mark.parametrize("above", ["Project: press 4\nDate: 2026-03-01\n", "Leica AT960;;;;;\nOperator;M. Weber;;;;\n"])
def test_lines_above_the_titles(tmp_path: Path, above: str) -> None:
    lines = [";".join(f"{value}" for value in row) for row in ROWS]
    path = tmp_path / "run.csv"
    path.write_text(above + HEAD.format(";") + "\n".join(lines) + "\n")
    table = read_table(path)
    np.testing.assert_array_equal(table.measured, np.array(ROWS)[:, 3:])
    assert table.line.tolist() == [4, 5]


@pytest.mark.parametrize(
    "titles",
    [
        "Schlitten 1 [mm];Schlitten 2 [mm];Schlitten 3 [mm];X Ist [mm];Y Ist [mm];Z Ist [mm]",
        "Schlitten 1 Sollwert;Schlitten 2 Sollwert;Schlitten 3 Sollwert;X gemessen;Y gemessen;Z gemessen",
        "Chariot 1 (mm);Chariot 2 (mm);Chariot 3 (mm);X mesuré (mm);Y mesuré (mm);Z mesuré (mm)",
        "Hauteur chariot 1;Hauteur chariot 2;Hauteur chariot 3;X réel;Y réel;Z réel",
    ],
)
def test_german_and_french_titles(tmp_path: Path, titles: str) -> None:
    lines = [";".join(f"{value}" for value in row) for row in ROWS]
    path = tmp_path / "run.csv"
    path.write_text(titles + "\n" + "\n".join(lines) + "\n", encoding="utf-8")
    table = read_table(path)
    np.testing.assert_array_equal(table.command, np.array(ROWS)[:, :3])
    np.testing.assert_array_equal(table.measured, np.array(ROWS)[:, 3:])


BELOW = "Name;Soll X;Soll Y;Soll Z;X;Y;Z\nA;1;2;3;1,1;2;3\nMax;4;5;6;4,1;5;6\nB;4;5;6;4,1;5;6\n"


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (
            "\nMittelwert;;;;1;2;3\nStd.-Abw.;;;;1;2;3\nAnzahl Punkte: 204;;;;;;\n",
            r"rows 6 to 8: .*\('Mittelwert'\); remove these",
        ),
        (
            "Max;4;5;6;4;5;6\nMin;1;2;3;1;2;3\nMean [mm];2;3;4;2;3;4\n",
            r"rows 5 to 7: .*\('Max'\); remove these rows; a point",
        ),
        ("RMS;;;;1;2\n", r"row 5: .*\('RMS'\); remove the row; a point that is called so"),
        ("-----\nEnde der Messung\n", r"rows 5 to 6: .*\('-----'\); remove these rows$"),
        ("平均值;;;;1;2;3\n", r"row 5: not readings but a footer"),
    ],
)
def test_statistics_below_the_readings_are_refused_at_once(tmp_path: Path, rows: str, said: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(BELOW + rows, encoding="utf-8")
    with pytest.raises(TableError, match=said):
        read_table(path)


@pytest.mark.parametrize(
    "rows", ["Min;1;2;3;1;2;3\nMax;4;5;6;4;5;6\n", "Mittelwert;1;2;3;1;2;3\nC;4;5;6;4;5;6\n", "# RMS;1\n"]
)
def test_a_point_may_have_any_name(tmp_path: Path, rows: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(BELOW + rows, encoding="utf-8")
    assert read_table(path).rows == 3 + sum(";" in line and line[0] != "#" for line in rows.splitlines())


def test_context_in_german_and_french(tmp_path: Path) -> None:
    for titles in (
        "Temperatur [°C];Nutzlast [kg];Vorschub [mm/s];Zeit [s]",
        "Température [°C];Charge [kg];Vitesse [mm/s];Temps [s]",
    ):
        path = tmp_path / "run.csv"
        rows = ["1;2;3;1.01;2.02;3.03;21.5;2.5;50;0", "4;5;6;4.01;5.02;6.03;22.5;5;50;10"]
        path.write_text(HEAD.format(";").strip() + ";" + titles + "\n" + "\n".join(rows) + "\n", encoding="utf-8")
        table = read_table(path)
        assert table.temp_c is not None and table.payload_kg is not None
        assert table.feed_mm_s is not None and table.time_s is not None
        assert [table.temp_c[1], table.payload_kg[1], table.feed_mm_s[1], table.time_s[1]] == [22.5, 5.0, 50.0, 10.0]


@pytest.mark.parametrize(("thousands", "decimal"), [(".", ","), (",", ".")])
@pytest.mark.parametrize("cell", ["12T5", "1T2T3", "0T125", "1234T567", "1D5T125", "T500"])
def test_a_sign_that_groups_thousands_does_nothing_else(
    tmp_path: Path, thousands: str, decimal: str, cell: str
) -> None:
    """The whole sign was dropped wherever it stood: 12.5 was read as 125."""
    cell = cell.replace("T", thousands).replace("D", decimal)
    path = tmp_path / "run.csv"
    row = ";".join(grouped(value, thousands, decimal) for value in ROWS[1])
    path.write_text(f"{HEAD.format(';')}{row}\n1;2;3;{cell};2;3\n")
    with pytest.raises(TableError, match=rf"row 3, column x_meas: not a number \('{cell}'\); '\{thousands}' groups"):
        read_table(path)


def test_a_decimal_sign_that_is_stated_groups_nothing(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"{HEAD.format(';')}1;2;3;1.234,56;2;3\n1;2;3;4;5;1.234\n")
    with pytest.raises(TableError, match=r"row 2, column x_meas: not a number \('1.234,56'\)"):
        read_table(path, mapping=Mapping(decimal="."))


def test_a_point_beside_decimal_commas_is_not_guessed(tmp_path: Path) -> None:
    """1.234 was read as 1.234 where a person had said that the comma is the decimal sign; 1.25 groups nothing."""
    path = tmp_path / "run.csv"
    path.write_text(f"{HEAD.format(';')}1;2;3;1,5;2;3\n1;2;3;1.25;2;1.234\n")
    with pytest.raises(TableError, match="which is the decimal sign"):
        read_table(path)
    with pytest.raises(
        TableError, match=r"row 3, column z_meas: not a number \('1.234'\); the decimal sign is a comma"
    ):
        read_table(path, mapping=Mapping(decimal=","))
    path.write_text(path.read_text().replace("1.234", "1.2345"))
    np.testing.assert_array_equal(read_table(path, mapping=Mapping(decimal=",")).measured[1], [1.25, 2.0, 1.2345])
