"""Write the bench machine, its rigs, targets and runs beside this script; a rerun gives the same bytes.

Usage: python data/make.py [FOLDER]
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from ptt.files import write_text
from ptt.rig import load_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import as_targets, make_helix, make_volume

POINTS, CYCLES = 180, 7
VOLUME_ROWS, VOLUME_SEED = 320, 20

MACHINE = """\
# The bench: a 3-PTT whose sliders run above the platform. The drawing, not the real machine.
[machine]
kind = "three-ptt"
name = "{name}"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_azimuth_deg = [0.0, 120.0, 240.0]
slider_travel_mm = [150.0, 420.0]
screw_lead_mm = 5.0
reflector_mm = [0.0, 0.0, 0.0]

[controller]
compensates = [{compensates}]

[tracker]
frame = "measured"
sigma_mm = 0.004
"""
BASE_POINTS = {
    "base 1": (380.0, 140.0, -220.0),
    "base 2": (-390.0, 180.0, -210.0),
    "base 3": (-120.0, -410.0, -230.0),
    "base 4": (260.0, 330.0, 420.0),
}
BASE_POINT = """
[[tracker.base_point]]
name = "{name}"
xyz_mm = [{x}, {y}, {z}]
sigma_mm = 0.002
"""

FAULTS = """\
[drive]
homing_mm = [0.35, -0.22, 0.12]
scale_um_per_m = [62.0, -45.0, 30.0]
curve_parabola_um = [7.0, -9.0, 5.0]
curve_cubic_um = [-3.0, 2.0, 4.0]
turn_um = [5.0, 4.0, 6.5]
turn_phase_rad = [0.7, 2.9, 4.4]
turn2_um = [0.8, 0.5, 0.6]
turn2_phase_rad = [1.0, 0.2, 5.1]
backlash_mm = [0.041, 0.052, 0.037]
windup_um = [2.5, 2.0, 3.0]
windup_length_mm = [1.5, 1.5, 1.5]
compliance_um_per_n = [0.20, 0.24, 0.18]

[geometry]
tower_radial_mm = [0.25, -0.18, 0.10]
tower_tangential_mm = [0.12, -0.20, 0.08]
lean_radial_mrad = [0.6, -0.8, 0.4]
lean_tangential_mrad = [-0.5, 0.3, 0.7]
link_mm = [0.06, -0.09, 0.04]
straightness_um = [5.0, 4.0, 6.0]
straightness_seed = 7
joint_offset_slider_mm = [0.02, -0.03, 0.015]
platform_axis_radial_mrad = [0.10, -0.15, 0.08]
platform_axis_vertical_mrad = [-0.12, 0.06, 0.10]
clearance_um = [6.0, 8.0, 5.0]

[structure]
column_bend_um_per_kg = [1.2, -0.8]

[thermal]
growth_um_per_m_k = 11.5
fixed_end_mm = 450.0
screw_lag_s = 900.0
frame_um_per_m_k = 11.5
frame_lag_s = 3600.0
link_um_per_m_k = 1.5
sensor_sigma_k = 0.02

[tracker]
station_mm = [900.0, -2900.0, 350.0]
translation_mm = [0.21, -0.34, 0.18]
rotation_mrad = [0.25, -0.40, 0.30]
wander_um = 1.0
"""
RIG = """\
# {comment}
machine = "../{machine}"
seed = {seed}

[conditions]
label = "{label}"
cycles = {cycles}
payload_kg = {payload}
feed_mm_s = {feed}
dwell_s = {dwell}

[conditions.room]
start_c = 20.4
rise_k = {rise}
time_constant_s = 5400.0

{controller}{faults}"""
COMPENSATION = """\
# What was measured with the linear scale, to its resolution.
[controller]
backlash_mm = [0.040, 0.052, 0.038]

"""
EXPERIMENTS = {
    1: ("the paper's experiment 1: the controller does not compensate backlash", False, 0.0),
    2: ("the paper's experiment 2: the controller compensates backlash", True, 0.0),
    3: ("the paper's experiment 3: as 2, with 1 kg on the platform", True, 1.0),
    4: ("the paper's experiment 4: as 2, with 3 kg on the platform", True, 3.0),
    5: ("the paper's experiment 5: as 2, with 5 kg on the platform", True, 5.0),
}


def main(folder: Path) -> None:
    """Write everything."""
    write_machines(folder)
    write_rigs(folder)
    targets = write_targets(folder)
    for number in EXPERIMENTS:
        write_measured(folder, f"experiment{number}", targets["targets"])
    write_measured(folder, "volume", targets["targets_volume"])


def write_machines(folder: Path) -> None:
    """The drawing, with and without a controller that compensates backlash."""
    points = "".join(BASE_POINT.format(name=name, x=x, y=y, z=z) for name, (x, y, z) in BASE_POINTS.items())
    for file, name, compensates in (
        ("machine.toml", "bench", ""),
        ("machine_compensated.toml", "bench, backlash compensated", '"backlash"'),
    ):
        write_text(folder / file, MACHINE.format(name=name, compensates=compensates) + points)


def write_rigs(folder: Path) -> None:
    """One virtual machine under different conditions."""
    common = {"faults": FAULTS, "feed": 20.0}
    for number, (comment, compensated, payload) in EXPERIMENTS.items():
        text = RIG.format(
            comment=f"Reality behind experiment{number}.csv: {comment}.",
            machine="machine_compensated.toml" if compensated else "machine.toml",
            controller=COMPENSATION if compensated else "",
            label=f"experiment {number}",
            seed=100 + number,
            payload=payload,
            cycles=CYCLES,
            dwell=1.5,
            rise=0.8,
            **common,
        )
        write_text(folder / "rigs" / f"experiment{number}.toml", text)
    text = RIG.format(
        comment="Reality behind volume.csv: the machine of experiment 1, random poses in a volume.",
        machine="machine.toml",
        controller="",
        label="volume",
        seed=106,
        payload=0.0,
        cycles=1,
        dwell=4.0,
        rise=0.8,
        **common,
    )
    write_text(folder / "rigs" / "volume.toml", text)


def write_targets(folder: Path) -> dict[str, pd.DataFrame]:
    """The paper's path, the same one backwards, one that was never measured, and the volume."""
    helix = make_helix(POINTS)
    drawing = ideal_machine(load_rig(folder / "rigs" / "volume.toml").spec)
    tables = {
        "targets": as_targets(helix),
        "targets_reversed": as_targets(helix[::-1], "r"),
        "targets_unseen": as_targets(make_rose(), "u"),
        "targets_volume": make_volume(drawing, VOLUME_ROWS, VOLUME_SEED),
    }
    for name, table in tables.items():
        write_run(table, folder / f"{name}.csv")
    return tables


def make_rose(points: int = 150) -> np.ndarray:
    """A second path, (n, 3) mm: a rose of three petals between radius 20 and 45 mm that rises and falls."""
    angle = 2.0 * np.pi * np.arange(points) / points
    radius = 32.5 + 12.5 * np.cos(3.0 * angle)
    rise = 22.0 + 15.0 * np.sin(2.0 * angle)
    return np.round(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rise]), 4)


def write_measured(folder: Path, name: str, targets: pd.DataFrame) -> None:
    """Run a rig, and round as tracker and controller do when they export."""
    frame = simulate(load_rig(folder / "rigs" / f"{name}.toml"), targets).frame
    digits = {
        "time_s": 1,
        "temp_c": 2,
        **{f"{axis}_meas": 4 for axis in "xyz"},
        **{f"b{leg}_cmd": 6 for leg in (1, 2, 3)},
    }
    write_run(frame.round(digits), folder / f"{name}.csv")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
