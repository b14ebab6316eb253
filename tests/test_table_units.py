"""Units, conditions and frames of the tracker CSV: what values may be, and what they mean."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import constants
from test_table import ROWS, csv, write

from ptt.errors import TableError
from ptt.run.readers.columns import UNITS, to_standard
from ptt.run.reading import read_table
from ptt.run.table import make_table, unit_hint


def test_unit_suffixes(tmp_path: Path) -> None:
    header = "q1_cmd_deg,q2_cmd_rad,x_meas_um,y_meas_m,z_meas,x_std_um,time_ms,payload_g,temp_k,feed_mm_min"
    text = csv("180,1,1500,0.002,3,2,500,1500,293.15,600", "90,2,2500,0.003,4,3,600,1500,294.15,600", header=header)
    table = read_table(write(tmp_path, text), joints=2, joint_prefix="q")
    np.testing.assert_allclose(table.command, [[np.pi, 1], [np.pi / 2, 2]], rtol=1e-15)
    np.testing.assert_allclose(table.measured, [[1.5, 2, 3], [2.5, 3, 4]], rtol=1e-15)
    np.testing.assert_allclose(table.std[:, 0], [0.002, 0.003], rtol=1e-15)
    np.testing.assert_allclose(table.time_s, [0.5, 0.6], rtol=1e-15)
    np.testing.assert_allclose(table.payload_kg, 1.5, rtol=1e-15)
    np.testing.assert_allclose(table.temp_c, [20.0, 21.0], rtol=1e-12)
    np.testing.assert_allclose(table.feed_mm_s, 10.0, rtol=1e-15)
    assert np.isnan(table.target).all()


MM = 1e-3  # m
KNOWN_UNITS = {
    ("x_meas", "mm"): 1.0,
    ("x_meas", "um"): constants.micron / MM,
    ("x_meas", "cm"): constants.centi / MM,
    ("x_meas", "m"): 1.0 / MM,
    ("x_meas", "in"): constants.inch / MM,
    ("q1_cmd", "rad"): 1.0,
    ("q1_cmd", "deg"): constants.degree,
    ("q1_cmd", "mrad"): constants.milli,
    ("time", "s"): 1.0,
    ("time", "ms"): constants.milli,
    ("time", "min"): constants.minute,
    ("time", "h"): constants.hour,
    ("time", "day"): constants.day,
    ("payload", "kg"): 1.0,
    ("payload", "g"): constants.gram,
    ("payload", "lb"): constants.pound,
    ("feed", "mm_s"): 1.0,
    ("feed", "mm_min"): 1.0 / constants.minute,
    ("feed", "m_s"): 1.0 / MM,
    ("feed", "m_min"): 1.0 / MM / constants.minute,
    ("feed", "in_min"): constants.inch / MM / constants.minute,
    ("tau1", "n"): 1.0,
    ("tau1", "nm"): 1.0,
    ("tau1", "kn"): constants.kilo,
    ("tau1", "knm"): constants.kilo,
    ("tau1", "ncm"): constants.centi,
    ("tau1", "nmm"): constants.milli,
}


def test_every_unit_is_as_large_as_scipy_has_it() -> None:
    for (quantity, unit), size in KNOWN_UNITS.items():
        np.testing.assert_allclose(to_standard(np.array([3.0]), quantity, unit), 3.0 * size, rtol=1e-15, err_msg=unit)
    for unit, name in (("c", "Celsius"), ("k", "Kelvin"), ("f", "Fahrenheit")):
        wanted = constants.convert_temperature(300.0, name, "Celsius")
        np.testing.assert_allclose(to_standard(np.array([300.0]), "temp", unit), wanted, rtol=1e-14, err_msg=unit)
    told = {unit for _, unit in KNOWN_UNITS} | {"c", "k", "f"}
    assert {unit for units in UNITS.values() for unit in units} - {"", "stamp"} == told


def test_joint_angle_without_unit_is_asked(tmp_path: Path) -> None:
    path = write(tmp_path, csv("1,1,2,3", "2,1,2,4", header="q1_cmd,x_meas,y_meas,z_meas"))
    with pytest.raises(TableError, match=r"which unit is q1_cmd in\?; answer with --map FILE.toml"):
        read_table(path, joints=1, joint_prefix="q")
    table = read_table(path, joints=1, joint_prefix="q", ask=lambda question, choices: "deg")
    np.testing.assert_allclose(table.command[:, 0], np.radians([1, 2]), rtol=1e-15)


def test_set_values(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, csv(*ROWS)), set_values={"payload_kg": 2})
    assert_array_equal(table.payload_kg, [2, 2, 2])
    assert "payload_kg set to 2 in every row" in str(table.understood)
    with pytest.raises(TableError, match="--set: 'colour' cannot be set; settable: payload_kg"):
        read_table(tmp_path / "run.csv", set_values={"colour": 2})


def test_unit_hint_against_the_machine() -> None:
    small = make_table(np.array([[0, 0, 0.3], [0.1, 0, 0.3], [0, 0.1, 0.3]]))
    assert "this looks like metres" in str(unit_hint(small, 300.0))
    assert unit_hint(make_table(small.target * 1000), 300.0) is None
    assert unit_hint(make_table(np.zeros((3, 3))), 300.0) is None


def test_fahrenheit_is_turned_and_below_absolute_zero_is_no_temperature(tmp_path: Path) -> None:
    rows = [f"{x},0,0,{x},0,0," for x in range(3)]
    for title in ("temp_f", '"Temperature (°F)"'):
        path = tmp_path / "f.csv"
        path.write_text("\n".join([f"x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas,{title}", *(row + "68" for row in rows)]))
        np.testing.assert_allclose(read_table(path).temp_c, 20.0)
    for value, place in (("-999", "row 3, column temp_c: -999 is less than there can be"), ("-40", "")):
        path = tmp_path / "c.csv"
        cold = [rows[0] + "20", rows[1] + value, rows[2] + "20"]
        path.write_text("\n".join(["x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas,temp_c", *cold]))
        if place:
            with pytest.raises(TableError, match=place):
                read_table(path)
        else:
            assert read_table(path).temp_c[1] == -40.0
    with pytest.raises(TableError, match="less than there can be"):
        read_table(path, set_values={"temp_c": -300.0})


@pytest.mark.parametrize(("column", "wrong", "fine"), [("payload_kg", "-2", "-0.004"), ("feed_mm_s", "-50", "0")])
def test_no_load_and_no_feed_is_below_zero(tmp_path: Path, column: str, wrong: str, fine: str) -> None:
    """An empty scale may show some grams below zero, and a machine may stand."""
    path, rows = tmp_path / "t.csv", ["0,0,0,", "1,0,0,", "2,0,0,"]
    for value in (wrong, fine):
        path.write_text("\n".join([f"x_cmd,y_cmd,z_cmd,{column}", rows[0] + "3", rows[1] + value, rows[2] + "3"]))
        if value == fine:
            assert getattr(read_table(path, purpose="targets"), column)[1] == float(fine)
            continue
        with pytest.raises(TableError, match=f"row 3, column {column}: {wrong} is less than there can be"):
            read_table(path, purpose="targets")
    with pytest.raises(TableError, match=f"{column} = {wrong} is less than there can be"):
        read_table(path, set_values={column: float(wrong)}, purpose="targets")
