"""Small files of every kind that commands take: for tests of what is refused, of what is kept and of what is written.

A fixture is imported under its own name (`place as place`): no line calls it, pytest finds it in the test file.
"""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

HEAD = "x_cmd,y_cmd,z_cmd,payload_kg,x_meas,y_meas,z_meas"
RUN = f"{HEAD}\n1,2,3,0,1.1,2,3\n2,2,3,0,2.1,2,3\n"
BARE = """[machine]
kind = "three-ptt"
base_radius_mm = 200
platform_radius_mm = 100
link_length_mm = 300
slider_travel_mm = [150, 420]
"""
QUICK = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def put(place: Path, text: str, name: str = "run.csv") -> Path:
    path = place / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def place(tmp_path):
    put(tmp_path, RUN)
    put(tmp_path, "x_cmd,y_cmd,z_cmd\n40,2,3\n-40,30,9\n", "targets.csv")
    put(tmp_path, BARE, "machine.toml")
    put(tmp_path, 'machine = "machine.toml"\n[drive]\nhoming_mm = [0.1, 0, 0]\n', "rig.toml")
    put(tmp_path, "G21\nG1 X3 F600\n", "part.ngc")
    put(tmp_path, "years of work", "thesis.tex")
    (tmp_path / "way.toml").symlink_to("machine.toml")
    (tmp_path / "way.csv").symlink_to("run.csv")
    os.link(tmp_path / "machine.toml", tmp_path / "hard.toml")
    return tmp_path
