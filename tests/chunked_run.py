"""A run that is long enough to be taken in chunks: the sealed machine's, with faults that are known.

A fixture is imported under its own name (`problem as problem`): no line calls it, pytest finds it in the test file.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table

FILE = load_machine(Path(__file__).resolve().parents[1] / "data" / "sealed_one" / "machine.toml")
MODEL = Model(FILE)
ROWS = 3600


def run_of(folder: Path, change: Callable[[pd.DataFrame], None] | None = None, **faults: Any) -> Problem:
    drawing = FILE.machine.model_dump(mode="json", exclude_none=True)
    # It swings, too: of a temperature that rises once, readings hardly tell how late a screw follows.
    room = {"start_c": 20.0, "rise_k": 6.0, "time_constant_s": 8000.0, "swing_k": 1.0, "swing_period_s": 3000.0}
    conditions = {"dwell_s": 4.0, "room": room, "cycles": 4}
    rig = replace(parse_rig({"machine": drawing, "seed": 4, "conditions": conditions, **faults}), machine=FILE)
    frame = simulate(rig, make_volume(ideal_machine(rig.spec), ROWS // 4, 3)).frame
    if change is not None:
        change(frame)
    write_run(frame, folder / "run.csv")
    return build_problem(FILE, read_table(folder / "run.csv"))


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    def spoil(frame: pd.DataFrame) -> None:
        frame.loc[[777, 2100], "x_meas"] += 2.0

    return run_of(
        tmp_path_factory.mktemp("run"),
        spoil,
        drive={"backlash_mm": [0.04, 0.05, 0.03], "turn_um": [6.0, 5.0, 7.0]},
        thermal={"growth_um_per_m_k": 11.5, "fixed_end_mm": 450.0},
    )
