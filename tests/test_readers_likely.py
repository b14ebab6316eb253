"""Columns that may be the commands of a run without any: a person is asked, and harmless ones stop nobody."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from asking import never, say
from numpy.testing import assert_allclose, assert_array_equal
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.errors import TableError
from ptt.run.readers import load_mapping
from ptt.run.readers.likely import NONE
from ptt.run.reading import read_table
from ptt.run.table import Table

ENDS = ((150.0, 420.0),) * 3
GOALS = "x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas"
HEIGHTS = np.array([[250.5, 300.0, 280.0], [300.25, 260.0, 310.0], [210.0, 350.0, 220.0]])
SERIES = ["Z{} Soll [mm]", "M{} [mm]", "L{} [mm]", "A{} Soll [mm]", "Leg {} position [mm]", "Motor {}"]


def write(path: Path, title: str, values: np.ndarray, first: int = 1) -> Path:
    """A run of three rows with so many columns."""
    titles = [title.format(number) for number in range(first, first + values.shape[1])]
    rows = [f"{','.join(f'{value:.4f}' for value in row)},1,2,{place},4,5,{place}" for place, row in enumerate(values)]
    path.write_text("\n".join([f"{','.join(titles)},{GOALS}", *rows]) + "\n", encoding="utf-8")
    return path


def read(path: Path, **more: object) -> Table:
    return read_table(path, **{"ends": ENDS, "ask": never, **more})


@pytest.mark.parametrize(("title", "first"), [*((title, 1) for title in SERIES), (SERIES[0], 0), (SERIES[4], 0)])
def test_columns_that_may_be_commands_are_asked_about(tmp_path: Path, title: str, first: int) -> None:
    path, saved = write(tmp_path / "run.csv", title, HEIGHTS, first), tmp_path / "map.toml"
    titles = [title.format(number) for number in range(first, first + 3)]
    lines = ", ".join(f'"{each}" = "b{joint}_cmd"' for joint, each in enumerate(titles, 1))
    with pytest.raises(TableError) as caught:
        read(path, ask=None)
    assert f"are {', '.join(titles)} those of its sliders?" in str(caught.value)
    assert f"columns = {{ {lines} }}" in str(caught.value)
    saved.write_text(f"columns = {{ {lines} }}\n", encoding="utf-8")
    assert_array_equal(read(path, mapping=saved).command, HEIGHTS)
    saved.write_text("\n".join(["[columns]", *(f'"{each}" = "ignore"' for each in titles)]), encoding="utf-8")
    assert read(path, mapping=saved).command is None


def test_the_answer_is_kept(tmp_path: Path) -> None:
    path, asked = write(tmp_path / "run.csv", "Z{} Soll [mm]", HEIGHTS), list[str]()

    def ask(question: str, choices: Sequence[str]) -> str:
        asked.append(question)
        return choices[0]

    table = read(path, ask=ask, mapping=tmp_path / "yes.toml")
    assert_array_equal(table.command, HEIGHTS)
    assert len(asked) == 1 and "which columns hold those of its sliders 1 to 3?" in asked[0]
    assert load_mapping(tmp_path / "yes.toml").columns["Z2 Soll [mm]"] == "b2_cmd"
    assert_array_equal(read(path, mapping=tmp_path / "yes.toml").command, HEIGHTS)
    assert read(path, ask=say(NONE), mapping=tmp_path / "no.toml").command is None
    assert read(path, mapping=tmp_path / "no.toml").command is None


def test_one_of_two_sets_is_chosen(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "Z{} Soll [mm]", HEIGHTS)
    ist = write(tmp_path / "ist.csv", "Z{} Ist [mm]", HEIGHTS + 1.0).read_text().splitlines()
    rows = zip(ist, path.read_text().splitlines(), strict=True)
    path.write_text("\n".join(f"{','.join(one.split(',')[:3])},{other}" for one, other in rows) + "\n")
    with pytest.raises(TableError, match=r"are Z1 Ist .*, or of Z1 Soll"):
        read(path, ask=None)
    assert_array_equal(read(path, ask=say("Z1 Soll [mm], Z2 Soll [mm], Z3 Soll [mm]")).command, HEIGHTS)


@pytest.mark.parametrize(
    ("title", "values"),
    [
        ("Error {} [mm]", HEIGHTS - 280.0),  # not where a slider goes
        ("Z{} Soll [mm]", HEIGHTS + 5000.0),
        ("Z{} Soll [um]", HEIGHTS),
        ("Sensor {} [mm]", np.full((3, 3), 300.0)),  # nothing that moves
        ("Motor {} [A]", HEIGHTS),
        ("Motor {} temperature [°C]", HEIGHTS),
        ("Motor {} [%]", HEIGHTS),
        ("Sensor {}", HEIGHTS),
        ("Z{} Soll [mm]", HEIGHTS[:, :2]),  # not as many as sliders
        ("Z{} Soll [mm]", np.hstack([HEIGHTS, HEIGHTS[:, :1]])),
        ("A{} Soll [deg]", HEIGHTS),
    ],
)
def test_harmless_columns_stop_nobody(tmp_path: Path, title: str, values: np.ndarray) -> None:
    table = read(write(tmp_path / "run.csv", title, values))
    assert table.command is None and len(table.understood.ignored) == values.shape[1]


def test_nobody_is_asked_where_commands_were_read(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "Z{} Soll [mm]", HEIGHTS)
    lines = [
        f"{one},{two}" for one, two in zip(("b1,b2,b3", *["1,2,3"] * 3), path.read_text().splitlines(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    assert_array_equal(read(path).command[0], [1, 2, 3])
    readings = tmp_path / "readings.csv"
    readings.write_text("x,y,z\n1,2,3\n1,2,4\n1,2,5\n")
    assert_array_equal(read(readings, targets=path).command[0], [1, 2, 3])
    write(path, "Z{} Soll [mm]", HEIGHTS)
    with pytest.raises(TableError, match="are Z1 Soll"):  # of the targets' file
        read(readings, targets=path, ask=None)
    assert_array_equal(read(readings, targets=path, ask=lambda _, choices: choices[0]).command, HEIGHTS)


def test_angles_of_an_arm(tmp_path: Path) -> None:
    path, ends = write(tmp_path / "run.csv", "W{} [deg]", HEIGHTS - 280.0), ((-2.0, 2.0),) * 3
    table = read(path, joints=3, joint_prefix="q", ends=ends, ask=lambda _, choices: choices[0])
    assert_allclose(table.command, np.radians(HEIGHTS - 280.0), rtol=1e-15)
    assert read(path, joints=3, joint_prefix="q", ends=((-0.1, 0.1),) * 3).command is None
    write(path, "A{}", HEIGHTS - 280.0)
    with pytest.raises(TableError, match="are A1, A2, A3 those of its joints"):
        read(path, joints=3, joint_prefix="q", ends=ends, ask=None)


def test_a_program_is_told_the_lines_of_the_map(tmp_path: Path) -> None:
    machine, path = tmp_path / "m.toml", write(tmp_path / "run.csv", "Z{} Soll [mm]", HEIGHTS)
    machine.write_text(
        '[machine]\nkind = "three-ptt"\nbase_radius_mm = 200.0\nplatform_radius_mm = 100.0\nlink_length_mm = 300.0\n'
        "slider_travel_mm = [150.0, 420.0]\n"
    )
    result = CliRunner().invoke(app, ["check", str(path), "--model", str(machine), "--json"])
    assert result.exit_code == 2 and '"Z3 Soll [mm]" = "b3_cmd"' in " ".join(result.output.split())
    assert json.dumps("Z1 Soll [mm]") in result.output
