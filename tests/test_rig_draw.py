"""Drawn rigs: known truth, fit protocols, visible faults; and the sample data they share their poses with."""

import runpy
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_rig_bench import BENCH, COMMAND, TARGET

from ptt.challenge.cases import names_of
from ptt.challenge.hide import FAULTS, hide_faults
from ptt.effects.registry import library
from ptt.errors import WorkspaceError
from ptt.machine import MachineFile, load_machine
from ptt.rig import format_rig, parse_rig, simulate
from ptt.rig.draw import PROTOCOLS, DrawnRig, draw_rig
from ptt.rig.nominal import ideal_machine
from ptt.rig.schema import Section
from ptt.rig.targets import make_loop, make_volume, there_and_back

DATA = Path(__file__).resolve().parents[1] / "data"


@cache
def machine_file() -> MachineFile:
    return load_machine(DATA / "machine.toml")


@pytest.fixture
def machine() -> MachineFile:
    return machine_file()


def read_of(drawn: DrawnRig) -> np.ndarray:
    return simulate(drawn.rig, drawn.targets, noise=False).frame[["x_meas", "y_meas", "z_meas"]].to_numpy()


@cache
def sound_of(seed: int, protocol: str) -> tuple[DrawnRig, np.ndarray]:
    """A sound rig and its readings, which all faults of a protocol are held against."""
    drawn = draw_rig(seed, machine_file(), protocol)
    return drawn, read_of(drawn)


@pytest.mark.parametrize("name", [name for name, fault in FAULTS.items() if not fault.unseen])
def test_every_fault_can_be_seen_on_its_protocol(name: str) -> None:
    for seed in range(4):
        sound, readings = sound_of(seed, FAULTS[name].protocols[seed % len(FAULTS[name].protocols)])
        moved = 1e3 * (read_of(hide_faults(sound, [name], seed)) - readings)
        assert (moved**2).sum() / 4.0**2 > 25.0, seed  # against a noise of 4 um per coordinate: five sigma


def test_names_are_those_of_the_library() -> None:
    assert {FAULTS[name].called for name in names_of("single")} <= set(library())
    assert not set(names_of("unknown")) & set(library())


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_protocols(protocol: str, machine: MachineFile) -> None:
    drawn = draw_rig(1, machine, protocol, rows=240)
    assert drawn.truth == {} and drawn.protocol == protocol
    rows = simulate(drawn.rig, drawn.targets).frame
    assert 200 <= (rows["role"] != "base").sum() <= 260
    assert (rows["role"] == "base").sum() == 8


def test_draws_repeat_and_can_be_sealed(machine: MachineFile) -> None:
    one, two, other = (draw_rig(seed, machine) for seed in (5, 5, 6))
    assert one.rig == two.rig != other.rig
    pd.testing.assert_frame_equal(one.targets, two.targets)
    assert parse_rig(format_rig(one.rig)) == one.rig


def test_a_drawn_rig_is_sound(machine: MachineFile) -> None:
    drawn = draw_rig(3, machine)
    poses = simulate(drawn.rig, drawn.targets, noise=False)
    pose = (poses.frame["role"] != "base").to_numpy()
    np.testing.assert_allclose(poses.truth[pose], poses.frame[TARGET].to_numpy()[pose], atol=1e-9)


def test_truth_is_what_the_rig_holds(machine: MachineFile) -> None:
    drawn = hide_faults(draw_rig(2, machine), ["backlash"], 2)
    assert list(drawn.rig.drive.backlash_mm) == drawn.truth["backlash"]["backlash_mm"]
    sections = [getattr(drawn.rig, name) for name in ("thermal", "geometry", "structure")]
    assert all(isinstance(section, Section) and section == type(section)() for section in sections)


def test_a_machine_too_small_for_the_run_is_refused(machine: MachineFile) -> None:
    links = {
        "base_radius_mm": 50.0,
        "platform_radius_mm": 20.0,
        "link_length_mm": 60.0,
        "slider_travel_mm": (0.0, 120.0),
    }
    small = replace(machine, machine=machine.machine.model_copy(update=links))
    with pytest.raises(WorkspaceError, match="cannot go everywhere in a run over 120 x 120 x 100 mm"):
        draw_rig(1, small, "path")
    tight = replace(machine, machine=machine.machine.model_copy(update={"slider_travel_mm": (270.0, 300.0)}))
    with pytest.raises(WorkspaceError, match="no pose within 120 x 120 x 100 mm"):
        draw_rig(1, tight, "volume")


def test_volume_has_repeats_both_directions_and_datum_visits(machine: MachineFile) -> None:
    targets = make_volume(ideal_machine(machine.machine), 300, 4)
    assert 290 <= len(targets) <= 300
    frame = simulate(parse_rig({"machine": BENCH}), targets, noise=False).frame
    direction = np.sign(np.diff(frame[COMMAND].to_numpy(), axis=0, prepend=frame[COMMAND].to_numpy()[:1]))
    keys = frame[TARGET].assign(**{f"d{leg}": direction[:, leg - 1] for leg in (1, 2, 3)})
    groups = keys[keys["d1"] != 0].groupby([*TARGET, "d1", "d2", "d3"]).size()
    assert (groups - 1).sum() >= 40  # degrees of freedom of pure error
    sides = groups.reset_index().groupby(TARGET).size()
    assert (sides >= 2).sum() >= 10  # poses reached from both sides
    assert (targets["role"] == "datum").sum() >= 4
    assert (np.abs(targets[TARGET]) <= [60.0, 60.0, 50.0]).all().all()
    for leg in COMMAND:
        phase = np.unique(np.floor(frame[leg].to_numpy() % 5.0))
        assert len(phase) == 5


def test_loop_is_smooth_and_closed() -> None:
    path = make_loop(120)
    step = np.diff(np.vstack([path, path[:1]]), axis=0)
    length = np.linalg.norm(step, axis=1)
    assert length.max() < 2.5 * length.min()
    assert len(there_and_back(path)) == 238


def test_sample_data_are_what_the_script_writes(tmp_path: Path) -> None:
    runpy.run_path(str(DATA / "make.py"))["main"](tmp_path)
    written = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file())
    assert len(written) == 18
    for path in written:
        assert (tmp_path / path).read_bytes() == (DATA / path).read_bytes(), path


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_sample_errors_are_of_the_expected_size(number: int) -> None:
    run = pd.read_csv(DATA / f"experiment{number}.csv")
    pose = run[run["role"] == "pose"]
    assert len(pose) == 7 * 180
    error = np.linalg.norm(pose[["x_meas", "y_meas", "z_meas"]].to_numpy() - pose[TARGET].to_numpy(), axis=1)
    assert error.min() > 0.1
    assert error.max() < 2.0
    assert pose["payload_kg"].unique().tolist() == [[0.0], [0.0], [1.0], [3.0], [5.0]][number - 1]
