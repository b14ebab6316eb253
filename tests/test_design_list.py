"""Poses chosen from a list: those that can be driven, in whatever frame they are counted; and what a list refuses."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from scipy.spatial.transform import Rotation

from ptt.machine import load_machine, save_machine
from ptt.machine_schema import TargetsSpec

BENCH = Path(__file__).resolve().parents[1] / "data" / "machine.toml"
POSES = np.random.default_rng(0).uniform(-50.0, 50.0, (30, 3)).round(3)


def listed(path: Path, place: np.ndarray) -> Path:
    rows = [f"p{number},{x:.4f},{y:.4f},{z:.4f}\n" for number, (x, y, z) in enumerate(place.tolist())]
    path.write_text("name,x_cmd,y_cmd,z_cmd\n" + "".join(rows))
    return path


def choose(folder: Path, place: np.ndarray, *words: object, machine: Path = BENCH):
    path = listed(folder / "list.csv", place)
    return invoke("plan", machine, "--candidates", path, "--out", folder / "chosen.csv", "--json", *words)


def names(folder: Path) -> list[str]:
    return [row.split(",")[3] for row in (folder / "chosen.csv").read_text().splitlines()[1:]]


@pytest.mark.parametrize("beyond", [[0.0, 0.0, 400.0], [900.0, 0.0, 0.0]], ids=["travel", "reach"])
def test_poses_that_cannot_be_driven_are_not_chosen(tmp_path: Path, beyond: list[float]) -> None:
    """Beyond the ends of travel a pose would tell most, if it were one."""
    place = np.array([beyond, *POSES])
    asked = choose(tmp_path, place, "--rows", 10)
    assert "1 pose that cannot be driven is left aside" in asked.stderr and "p0" not in names(tmp_path)
    told = json.loads(asked.stdout)
    assert (told["left_aside"], told["whole_list"]["poses"]) == (1, 30)
    few = choose(tmp_path, place, "--rows", 31)
    assert few.exit_code == 2 and "30 poses that can be driven, of 31 in the list" in few.stderr


@pytest.mark.parametrize("rows", [0, -3])
def test_a_choice_of_no_pose_is_refused(tmp_path: Path, rows: int) -> None:
    refused = choose(tmp_path, POSES, "--rows", rows)
    assert refused.exit_code == 2 and f"{rows} poses cannot be chosen; ask for 1 or more" in refused.stderr
    assert not (tmp_path / "chosen.csv").exists()


@pytest.mark.parametrize("words", [("--payloads", "0,5"), ("--box", "10,10,10"), ("--repeats", 50)])
def test_how_poses_are_drawn_is_refused_beside_a_list_of_them(tmp_path: Path, words: tuple) -> None:
    refused = choose(tmp_path, POSES, "--rows", 10, *words)
    assert refused.exit_code == 2 and f"{words[0]}: says how poses are drawn" in refused.stderr


def test_base_reflectors_of_a_list_are_no_poses(tmp_path: Path) -> None:
    plan, chosen = tmp_path / "plan.csv", tmp_path / "chosen.csv"
    told = json.loads(invoke("plan", BENCH, "--rows", 60, "--out", plan, "--json").stdout)
    poses = sum(",base," not in row for row in plan.read_text().splitlines()[1:])
    assert poses < told["rows"]
    told = invoke("plan", BENCH, "--candidates", plan, "--rows", poses, "--out", chosen, "--json").stdout
    assert json.loads(told)["whole_list"]["poses"] == poses and "base" not in chosen.read_text()
    entries = json.loads(invoke("dexterity", BENCH, "--targets", plan, "--json").stdout)["targets"]
    assert len(entries) == poses and {entry["status"] for entry in entries} == {"ok"}


def test_a_list_is_counted_in_the_frame_that_the_machine_file_states(tmp_path: Path) -> None:
    machine, turn, origin = tmp_path / "m.toml", (0.0, 0.0, 90.0), (0.0, 40.0, 30.0)
    save_machine(replace(load_machine(BENCH), targets=TargetsSpec(origin_mm=origin, turn_deg=turn)), machine)
    own = (POSES - origin) @ Rotation.from_rotvec(turn, degrees=True).as_matrix()
    chosen, told = [], []
    for place, file in ((POSES, BENCH), (own, machine)):
        assert choose(tmp_path, place, "--rows", 8, machine=file).exit_code == 0
        chosen.append(names(tmp_path))
        entries = json.loads(invoke("dexterity", file, "--targets", tmp_path / "list.csv", "--json").stdout)["targets"]
        told.append([[entry["condition"], *entry["q"]] for entry in entries])
    assert chosen[0] == chosen[1]
    np.testing.assert_allclose(told[0], told[1], atol=1e-3)
