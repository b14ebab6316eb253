"""Titles that count the joints: what drives them, LinuxCNC's pins, KUKA's axes; they give way to any other command."""

from pathlib import Path

import pytest
from asking import never, say
from numpy.testing import assert_allclose, assert_array_equal

from ptt.errors import TableError
from ptt.run.readers import Request, read_any
from ptt.run.reading import read_table
from ptt.run.table import Table

GOALS = "x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas"


def written(path: Path, titles: str, first: str, second: str, goals: str = GOALS) -> Path:
    path.write_text(f"{titles},{goals}\n{first},1,2,3,4,5,6\n{second},1,2,4,4,5,7\n", encoding="utf-8")
    return path


def of(path: Path, titles: str, joints: int | None = 3, letter: str = "b", **more: object) -> Table:
    count = titles.count(",") + 1
    first, second = (",".join(str(300 + number + row) for number in range(1, count + 1)) for row in (0, 10))
    return read_table(written(path, titles, first, second), joints, joint_prefix=letter, **more)


@pytest.mark.parametrize("joints", [3, None])
@pytest.mark.parametrize("title", ["Motor {}", "Antrieb {} Soll", "Actuator {}", "Säule {}", "{} 号滑块"])
def test_what_drives_a_slider_is_its_command(tmp_path: Path, title: str, joints: int | None) -> None:
    table = of(tmp_path / "run.csv", ",".join(f"{title.format(number)} [mm]" for number in (1, 2, 3)), joints)
    assert_array_equal(table.command, [[301, 302, 303], [311, 312, 313]])


@pytest.mark.parametrize("title", ["A{} [°]", "Theta{} [deg]", "AXIS_ACT.A{} [deg]", "Motor {} [deg]"])
def test_angles_of_what_turns_are_joints(tmp_path: Path, title: str) -> None:
    titles = ",".join(title.format(number) for number in range(1, 8))
    for joints in (7, None):
        table = of(tmp_path / "run.csv", titles, joints, "q")
        assert_allclose(
            table.command[0, :2], [301 * 3.141592653589793 / 180, 302 * 3.141592653589793 / 180], rtol=1e-15
        )
    assert of(tmp_path / "run.csv", titles, 6, "q").command.shape == (2, 6)  # the last one is no joint of the machine
    assert of(tmp_path / "run.csv", titles).command is None  # nor is any one of a tripod


def test_axes_without_a_unit_are_asked_about(tmp_path: Path) -> None:
    titles = ",".join(f"AXIS_ACT.A{number}" for number in (1, 2, 3))
    with pytest.raises(TableError, match="which unit is q1_cmd in"):
        of(tmp_path / "run.csv", titles, 3, "q")
    assert_array_equal(of(tmp_path / "run.csv", titles, 3, "q", ask=say("rad")).command[0], [301, 302, 303])


@pytest.mark.parametrize(
    "titles",
    [
        "b1_cmd,b2_cmd,b3_cmd,Motor 1 [mm],Motor 2 [mm],Motor 3 [mm]",
        "Slider 1 [mm],Slider 2 [mm],Slider 3 [mm],Motor 1 [mm],Motor 2 [mm],Motor 3 [mm]",
        "b1,b2,b3,Motor 1 [mm]",
    ],
)
def test_a_motor_gives_way_to_any_other_command(tmp_path: Path, titles: str) -> None:
    table = of(tmp_path / "run.csv", titles, ask=never)
    assert_array_equal(table.command[0], [301, 302, 303])
    assert "Motor 1 [mm]" in table.understood.ignored


@pytest.mark.parametrize(
    "titles", ["Motor 1 [mm]", "Motor 1 [A],Motor 2 [A],Motor 3 [A]", "Motor 1 [Nm],Motor 2 [Nm],Motor 3 [Nm]"]
)
def test_what_is_no_command_of_each_joint_stays_unread(tmp_path: Path, titles: str) -> None:
    table = of(tmp_path / "run.csv", titles, ask=never)
    assert table.command is None and table.understood.ignored == tuple(titles.split(","))


@pytest.mark.parametrize("pin", ["joint.{}.pos-cmd", "joint.{}.motor-pos-cmd"])
def test_joints_of_linuxcnc_count_from_zero(tmp_path: Path, pin: str) -> None:
    for first in (0, 1):
        titles = ",".join(f"{pin.format(number)} [mm]" for number in range(first, first + 3))
        assert_array_equal(of(tmp_path / "run.csv", titles).command[0], [301, 302, 303])
    titles = ",".join(pin.format(number) for number in range(3))
    with pytest.raises(TableError, match=rf"column {pin.format(0)}: which unit is q1_cmd in"):
        of(tmp_path / "run.csv", titles)
    assert_array_equal(of(tmp_path / "run.csv", titles, ask=say("mm")).command[0], [301, 302, 303])


def test_leicas_temperature_and_scatter(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "sX [µm],sY [µm],sZ [µm],T [°C]", "5,6,7,21.5", "5,6,7,21.5")
    read = read_any(path)
    assert_allclose([read.columns[f"{axis}_std"][0] for axis in "xyz"], [0.005, 0.006, 0.007], rtol=1e-15)
    assert read.columns["temp"][0] == 21.5
    path = written(tmp_path / "run.csv", "x_std,temp_c,sX [µm],T [°C]", "1,20,5,21.5", "1,20,5,21.5")
    read = read_any(path, Request(ask=never))
    assert read.columns["x_std"][0] == 1.0 and read.columns["temp"][0] == 20.0
    assert read.understood.ignored == ("sX [µm]", "T [°C]")
