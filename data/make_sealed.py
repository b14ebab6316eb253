"""Write sealed_one/ and sealed_three/ beside this script: runs whose hidden faults are to be found.

A rerun gives the same bytes. What is hidden stands below.

Usage: python data/make_sealed.py [FOLDER]
"""

import sys
from dataclasses import replace
from pathlib import Path

from ptt.challenge.challenge import bench, write_challenge
from ptt.challenge.hide import hide_faults
from ptt.rig import parse_rig
from ptt.rig.draw import DrawnRig, draw_rig
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume

ONE_SEED, THREE_SEED = 33, 544
BACKLASH_MM = (0.040284, 0.017876, 0.051792)
FRAME = {
    "station_mm": (-2377.6, -1829.5, 215.4),
    "translation_mm": (-0.2121, -0.3831, -0.3659),
    "rotation_mrad": (-0.031, -0.4092, 0.0783),
}
THREE = ("backlash", "axis-compliance", "frame-growth")  # always there, under load, when warm
POSES = 75
CONDITIONS = {
    "cycles": 4,
    "payload_per_cycle_kg": [0.0, 6.0, 3.0, 6.0],
    "pause_s": 1500.0,
    "dwell_s": 5.0,
    "room": {"start_c": 18.0, "rise_k": 12.0, "time_constant_s": 4000.0},
}
STATION_MM = [1400.0, -600.0, 250.0]


def main(folder: Path) -> None:
    """Write both."""
    write_challenge(folder / "sealed_one", draw_one(), "single")
    write_challenge(folder / "sealed_three", draw_three(), "multi")


def draw_one() -> DrawnRig:
    """Backlash on a path."""
    drawn = draw_rig(ONE_SEED, bench(), "path")
    rig, truth = drawn.rig, {"backlash": {"backlash_mm": list(BACKLASH_MM)}}
    drive = rig.drive.model_copy(update={"backlash_mm": BACKLASH_MM})
    rig = replace(rig, drive=drive, tracker=rig.tracker.model_copy(update=FRAME))
    return replace(drawn, rig=rig, truth=truth)


def draw_three() -> DrawnRig:
    """Three effects on poses in a volume, visited four times while the load changes and the room warms up."""
    machine = bench()
    spec = machine.machine.model_dump(mode="json", exclude_none=True)
    content = {"machine": spec, "seed": THREE_SEED, "conditions": CONDITIONS, "tracker": {"station_mm": STATION_MM}}
    rig = replace(parse_rig(content), machine=machine)
    drawn = DrawnRig(rig, make_volume(ideal_machine(rig.spec), POSES, THREE_SEED), {}, "warmup")
    return hide_faults(drawn, THREE, THREE_SEED)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
