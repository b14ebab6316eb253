"""Write sealed_one/ and sealed_three/ beside this script: runs whose hidden faults are to be found.

A rerun gives the same bytes. What is hidden follows from the seeds below and is written nowhere in clear.

Usage: python data/make_sealed.py [FOLDER]
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ptt.challenge.challenge import bench, write_challenge
from ptt.challenge.hide import hide_faults
from ptt.challenge.truth import find_truth
from ptt.effects import library
from ptt.rig import parse_rig
from ptt.rig.draw import DrawnRig, draw_rig
from ptt.rig.draw_faults import KNOWN
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume

ONE_SEED, THREE_SEED = 33, 544
LEAST = 3.0  # times the noise of one reading that every fault leaves
POSES = 75
CONDITIONS = {
    "cycles": 4,
    "payload_per_cycle_kg": [0.0, 6.0, 3.0, 6.0],
    "pause_s": 1500.0,
    "dwell_s": 5.0,
    "room": {"start_c": 18.0, "rise_k": 12.0, "time_constant_s": 4000.0},
}
STATION_MM = [1400.0, -600.0, 250.0]
KINDS = (("path", "volume"), ("payload",), ("warmup",))  # one fault of each: always there, under load, when warm


def main(folder: Path) -> None:
    """Write both."""
    write_challenge(folder / "sealed_one", first_visible(draw_one, ONE_SEED), "single")
    write_challenge(folder / "sealed_three", first_visible(draw_three, THREE_SEED), "multi")


def first_visible(draw: Callable[[int], DrawnRig], seed: int) -> DrawnRig:
    """The first rig from a seed on of which every fault can be seen well."""
    while True:
        drawn = draw(seed)
        truth = find_truth(drawn, library())
        if all(fault.size > LEAST * truth.noise.total for fault in truth.faults):
            return drawn
        seed += 1


def draw_one(seed: int) -> DrawnRig:
    """One effect, on a path or in a volume."""
    return draw_rig("single", seed, bench(), "path" if seed % 2 else "volume")


def draw_three(seed: int) -> DrawnRig:
    """Three effects on poses in a volume, visited four times while the load changes and the room warms up."""
    random = np.random.default_rng([seed, 41])
    plain = draw_rig("none", seed, bench(), "volume").rig
    machine = {key: value for key, value in plain.spec.model_dump(mode="json").items() if value is not None}
    content = {"machine": machine, "seed": seed, "conditions": CONDITIONS, "tracker": {"station_mm": STATION_MM}}
    rig = replace(parse_rig(content), machine=plain.machine)
    drawn = DrawnRig(rig, make_volume(ideal_machine(rig.spec), POSES, seed), {}, "warmup")
    tables = [
        [fault.name for fault in KNOWN if fault.protocols[0] in kinds and fault.section != "tracker"] for kinds in KINDS
    ]
    return hide_faults(drawn, [table[random.integers(len(table))] for table in tables], seed)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
