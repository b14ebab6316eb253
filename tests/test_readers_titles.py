"""Titles of columns: quantities, units, delimiters and decimals."""

import numpy as np
import pytest
from asking import never
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from ptt.run.readers.columns import Meaning, canonical, file_title, to_standard
from ptt.run.readers.separators import find_decimal, find_delimiter
from ptt.run.readers.titles import meaning_of, split_unit


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
        ("Torque 2 [N·mm]", "tau2", "nmm"),
        ("tau3_kn", "tau3", "kn"),
        ("关节1方向", "dir1", None),
        ("J6 [deg]", "q6_cmd", "deg"),
        ("Rolle", "role", None),
        ("Bezeichnung", "name", None),
        ("Rôle", "role", None),
        ("payload_lb", "payload", "lb"),
        ("Payload (lbs)", "payload", "lb"),
        ("weight_lb", "payload", "lb"),
        ("feed_in_min", "feed", "in_min"),
        ("Feed rate [in/min]", "feed", "in_min"),
        ("feed_rate_mm_min", "feed", "mm_min"),
        ("Belastung [kg]", "payload", "kg"),
        ("Achse 1 [mm]", "b1_cmd", "mm"),
        ("Axis 2 Position (mm)", "b2_cmd", "mm"),
        ("Axis 2 Position (deg)", "q2_cmd", "deg"),
        ("q3 [mm]", "b3_bare", "mm"),
        ("Motor 1 [mm]", "b1_cmd", "mm"),
        ("Motor 2 Soll [mm]", "b2_cmd", "mm"),
        ("Antrieb 3 (m)", "b3_cmd", "m"),
        ("Säule 1 [mm]", "b1_cmd", "mm"),
        ("Moteur 2 (mm)", "b2_cmd", "mm"),
        ("电机1(mm)", "b1_cmd", "mm"),
        ("1 号滑块 [mm]", "b1_cmd", "mm"),
        ("Actuator 4 [deg]", "q4_cmd", "deg"),
        ("A7 [°]", "q7_cmd", "deg"),
        ("Theta1 [deg]", "q1_cmd", "deg"),
        ("θ2 [rad]", "q2_cmd", "rad"),
        ("E1_A1", "q1_cmd", None),
        ("AXIS.A3", "q3_cmd", None),
        ("AXIS_ACT.A1 [deg]", "q1_cmd", "deg"),
        ("joint.1.motor-pos-cmd", "q1_cmd", None),
        ("T [°C]", "temp", "c"),
        ("sX [µm]", "x_std", "um"),
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
        "Motor 1",
        "Motor 1 [A]",
        "Motor 1 A",
        "Motor 1 [%]",
        "Motor 1 [Nm]",
        "Motor 1 temperature [°C]",
        "Motor 1 Ist [mm]",
        "Motor 1 torque [Nm]",
        "AXIS_ACT_MEAS.A1",
        "A1",
        "A1 [mm]",
        "Axis 1 A",
        "T C",
        "T [s]",
        "sX",
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


def test_a_unit_that_a_title_says_twice() -> None:
    assert meaning_of("time_s [s]") == Meaning("time", "s") and meaning_of("temp_c (°C)") == Meaning("temp", "c")
    assert meaning_of("time_s [min]") is None


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
