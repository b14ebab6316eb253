"""Write arm/ beside this script: a run of a serial arm with a hidden fault, measured by a tracker that stood anywhere.

The arm is the drawing of machines/ur10.toml on the virtual arm of `ptt.rig`. A rerun gives the same bytes.

Usage: python data/make_arm.py [FOLDER]
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from ptt.drawing import SerialSpec
from ptt.files import write_text
from ptt.machine import format_machine, load_machine
from ptt.rig import write_run
from ptt.rig.draw_arm import draw_arm

SEED, ROWS, SIGMA_MM = 41, 220, 0.01
MACHINE = Path(__file__).parent / "machines" / "ur10.toml"


def main(folder: Path) -> None:
    """Write machine, run and targets."""
    file = load_machine(MACHINE)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA_MM}), text="")
    assert isinstance(file.machine, SerialSpec)
    run = draw_arm(file.machine, "backlash", SEED, ROWS, SIGMA_MM)
    joints = {f"q{i}_cmd_rad": np.round(q, 7) for i, q in enumerate(run.q.T, 1)}
    context = {"time_s": run.time_s, "payload_kg": np.round(run.payload_kg, 2), "temp_c": np.round(run.temp_c, 2)}
    names = {"name": [f"p{number}" for number in range(1, ROWS + 1)]}
    read = {f"{axis}_meas": np.round(value, 4) for axis, value in zip("xyz", run.readings.T, strict=True)}
    place = folder / "arm"
    place.mkdir(parents=True, exist_ok=True)
    write_text(place / "machine.toml", format_machine(file))
    write_run(pd.DataFrame(names | context | joints | read), place / "run.csv")
    write_run(pd.DataFrame(names | context | joints), place / "targets.csv")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
