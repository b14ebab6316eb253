"""What a machine file alone says of itself, and the drawing of it."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import run_verb

from ptt.machine import MachineFile, parse_machine
from ptt.run.table import Table
from ptt.setup.machine import describe_machine

DATA = Path(__file__).parent.parent / "data" / "sealed_one"


def test_a_machine_file_alone_is_described_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_verb("check", DATA / "machine.toml", "--drawing", tmp_path / "bench.png") == 0
    assert run_verb("check", DATA / "machine.toml", "--drawing", tmp_path / "bench.csv") == 2
    assert not (tmp_path / "bench.csv").exists()
    assert "b1 = 282.843" in capsys.readouterr().out  # sqrt(300^2 - 100^2)
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_written_fails_no_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "machine.toml"
    path.write_bytes((DATA / "machine.toml").read_bytes())
    (tmp_path / "machine_drawing.png").mkdir()
    assert run_verb("check", path, "--json") == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["drawing"] is None and "not drawn: " in told.err
    assert run_verb("check", path, "--drawing", tmp_path / "machine_drawing.png") == 2


def test_reach_of_a_machine_stays_within_the_travel(sound: tuple[MachineFile, Table]) -> None:
    """On the axis every slider stands at z + sqrt(L^2 - (R - r)^2), so travel ends are the reach but for a step."""
    said = describe_machine(sound[0])
    drop = np.sqrt(300.0**2 - 100.0**2)
    assert said.reach_mm[1] == pytest.approx(150.0 - drop, abs=3.0)
    assert said.reach_mm[2] == pytest.approx(420.0 - drop, abs=3.0)


@pytest.mark.parametrize(
    ("azimuths", "said"),
    [
        ("[0.0, 120.0, 240.0]", None),
        ("[0.0, 90.0, 180.0]", None),  # uneven, and still held
        ("[10.0, 20.0, 30.0]", "azimuths 10, 20, 30 deg) that the tool is hardly held: a slider's error may grow"),
        ("[0.1745, 2.1817, 4.3633]", "perhaps they are in rad, and would be 9.998, 125, 250 deg"),
        ("[1.0, 2.0, 3.0]", "perhaps they are in rad, and would be 57.3, 114.6, 171.9 deg"),
    ],
)
def test_towers_that_hardly_hold_the_tool_are_remarked_on(azimuths: str, said: str | None) -> None:
    text = (DATA / "machine.toml").read_text()
    start = text.index("slider_azimuth_deg")
    line = text[start : text.index("\n", start)]
    remarks = describe_machine(parse_machine(text.replace(line, f"slider_azimuth_deg = {azimuths}"))).remarks
    assert len(remarks) == (said is not None) and (said or "") in " ".join(remarks)
    assert ("rad" in " ".join(remarks)) == (said is not None and "rad" in said)


def test_radii_that_hardly_hold_the_tool_are_not_put_down_to_the_towers() -> None:
    text = (DATA / "machine.toml").read_text().replace("platform_radius_mm = 100.0", "platform_radius_mm = 190.0")
    assert "platform_radius_mm = 190.0" in text
    (remark,) = describe_machine(parse_machine(text.replace("150.0, 420.0", "100.0, 600.0"))).remarks
    assert remark.startswith("the links hardly hold the tool at home") and "towers" not in remark
