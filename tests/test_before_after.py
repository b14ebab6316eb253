"""Two runs of one machine side by side: figures, shared poses, what got worse; readings are made here."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptt.commands.main import run
from ptt.errors import TableError
from ptt.judge.before_after import compare_pair
from ptt.machine import load_machine
from ptt.run.reading import read_table

MACHINE = """[machine]
kind = "three-ptt"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_azimuth_deg = [0.0, 120.0, 240.0]
slider_travel_mm = [100.0, 480.0]
screw_lead_mm = 5.0
[tracker]
frame = "trusted"
"""


def write(folder: Path, name: str, target: np.ndarray, error: np.ndarray) -> Path:
    frame = pd.DataFrame(target, columns=["x_cmd", "y_cmd", "z_cmd"])
    frame[["x_meas", "y_meas", "z_meas"]] = target + error
    frame.to_csv(folder / name, index=False)
    return folder / name


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "machine.toml").write_text(MACHINE)
    return tmp_path


def test_figures_are_those_of_the_errors_that_were_put_in(folder: Path) -> None:
    random = np.random.default_rng(1)
    target = random.uniform(-50.0, 50.0, (60, 3))
    first, second = random.normal(0.0, 0.1, (60, 3)), random.normal(0.0, 0.01, (60, 3))
    second[7] = 10.0 * first[7]  # one pose got worse
    paths = write(folder, "a.csv", target, first), write(folder, "b.csv", target[::-1], second[::-1])
    data = compare_pair(*map(read_table, paths), load_machine(folder / "machine.toml")).to_dict()
    for axis, name in enumerate("xyz"):
        before, after = (1e3 * np.sqrt(np.mean(e[:, axis] ** 2)) for e in (first, second))
        assert data["before"]["rms_um"][name] == pytest.approx(before)
        assert data["after"]["rms_um"][name] == pytest.approx(after)
        assert data["reduction_percent"][name] == pytest.approx(100.0 * (1.0 - after / before))
    assert data["shared_poses"] == 60
    assert next(one["row"] for one in data["worse"]).endswith("row 9")  # line 9 of the file, titles are line 1
    assert len(data["where"]) == 7


def test_the_quarter_in_which_a_run_is_off_has_its_name(folder: Path) -> None:
    """Every pose is off by 10 um, and by ten times as much where x is high and y is low."""
    target = np.random.default_rng(4).uniform(-50.0, 50.0, (80, 3))
    aside = (target[:, 0] >= np.median(target[:, 0])) & (target[:, 1] < np.median(target[:, 1]))
    error = 0.01 * np.where(aside, 10.0, 1.0)[:, None] * [0.0, 0.0, 1.0]
    paths = write(folder, "a.csv", target, error), write(folder, "b.csv", target, 0.0 * error)
    data = compare_pair(*map(read_table, paths), load_machine(folder / "machine.toml")).to_dict()
    ground = {zone["where"]: zone["before_um"] for zone in data["where"] if not zone["where"].startswith("z")}
    assert ground.pop("x high, y low") == pytest.approx(100.0)
    assert set(ground) == {"x low, y low", "x low, y high", "x high, y high"}
    assert list(ground.values()) == pytest.approx([10.0] * 3)


def test_runs_on_different_poses_are_compared_as_wholes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    random = np.random.default_rng(2)
    one = write(folder, "a.csv", random.uniform(-50, 50, (40, 3)), random.normal(0.0, 0.05, (40, 3)))
    two = write(folder, "b.csv", random.uniform(-50, 50, (30, 3)), random.normal(0.0, 0.005, (30, 3)))
    machine, pictures = folder / "machine.toml", folder / "pictures"
    words = ["compare", one, "--after", two, "--model", machine, "--plots", pictures, "--json"]
    assert run([str(word) for word in words]) == 0
    data = json.loads(capsys.readouterr().out)["before_after"]
    assert data["shared_poses"] == 0 and data["unmatched"] == {"before": 40, "after": 30}
    assert data["reduction_percent"]["total"] > 80.0
    assert (pictures / "before_after.png").stat().st_size > 10_000


def test_a_run_without_targets_is_refused(folder: Path) -> None:
    file = load_machine(folder / "machine.toml")
    target = np.random.default_rng(3).uniform(-40.0, 40.0, (20, 3))
    table = read_table(write(folder, "a.csv", target, np.zeros((20, 3))))
    blind = table.replace(target=np.full((20, 3), np.nan), command=np.full((20, 3), 290.0))
    with pytest.raises(TableError, match="no targets"):
        compare_pair(table, blind, file)
