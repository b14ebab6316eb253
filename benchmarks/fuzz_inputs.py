"""Sound inputs that the fuzzer starts from, small enough for thousands of cases, and the commands that use them."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

BENCH = """[machine]
kind = "three-ptt"
name = "bench"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_travel_mm = [150.0, 420.0]
screw_lead_mm = 5.0
platform_mass_kg = 1.0

[controller]
compensates = []

[tracker]
frame = "fitted"
sigma_mm = 0.004
"""
FITTED = """
[[effect]]
name = "homing-offset"
[effect.parameters]
offset_mm = { value = [0.1, -0.05, 0.02], std = [0.01, 0.01, 0.01] }

[[effect]]
name = "backlash"
[effect.parameters]
gap_mm = { value = [0.041, 0.052, 0.037], std = [0.001, 0.001, 0.001] }
"""
RIG = """machine = "machine.toml"
seed = 3

[conditions]
label = "small"
cycles = 1
payload_kg = 1.0
feed_mm_s = 20.0

[drive]
homing_mm = [0.1, -0.05, 0.02]
backlash_mm = [0.041, 0.052, 0.037]

[tracker]
translation_mm = [0.1, 0.2, 0.1]
wander_um = 1.0
"""
ANSWERS = 'decimal = "."\nencoding = "utf-8"\n\n[columns]\nx_meas = "x_meas"\n\n[units]\nx_meas = "mm"\n'
OWN = '''"""An effect of one's own."""

import torch

from ptt.effects import Effect, Parameter


class Pull(Effect):
    """Something pulls sideways, more at greater height."""

    name = "pull"
    stage = "structure"
    mechanisms = ("three-ptt",)
    parameters = (Parameter("pull", "1", 1e-4, "sideways shift per mm of height, x and y", count=2),)
    requires = ()

    def basis(self, view, shape):
        """Shift per unit of each parameter, (n, 3, 2)."""
        height = (view.q - view.home).mean(dim=1)
        return height[:, None, None] * torch.eye(3, 2, dtype=torch.float64)
'''
PART = """%
(a slot, a corner and an arc)
N10 G21 G90 G17 G94
N20 G0 X-20 Y-10 Z5
N30 G1 Z-2 F240
N40 X20 F600
N50 G3 X25 Y-5 I0 J5
N60 G1 Y10
N70 G2 X15 Y20 R10
N80 G91 G1 X-5 Y-3
N90 G90 G0 Z5
M30
%
"""
ARM = (
    """[machine]
kind = "serial"
name = "arm"
convention = "standard"
tool_mm = [0.0, 0.0, 50.0]
"""
    + "".join(
        f"\n[[machine.joint]]\nalpha_deg = {alpha}\na_mm = {a}\nd_mm = {d}\nlimits_deg = [-170.0, 170.0]\n"
        for alpha, a, d in ((90.0, 0.0, 300.0), (0.0, 400.0, 0.0), (90.0, 50.0, 0.0), (-90.0, 0.0, 350.0))
    )
    + """
[tracker]
frame = "fitted"
tool = "fitted"
sigma_mm = 0.01
"""
)
ARM_FITTED = """
[[effect]]
name = "backlash"
[effect.parameters]
gap_rad = { value = [0.0004, 0.0, 0.0003, 0.0], std = [1e-05, 1e-05, 1e-05, 1e-05] }
"""


FLEET = (
    ["fleet", "init", "store"],
    ["fleet", "add", "store", "bench", "run.csv", "--model", "model.toml", "--date", "2026-01-02"],
    ["fleet", "run", "store"],
)


def make_inputs(place: Path, run: Callable[[list[str]], object], fleet: bool = True) -> None:
    """Write the sound inputs into a folder, each by the commands themselves where one makes it.

    Args:
        place: an empty folder.
        run: runs a command line in it, and raises where it does not work.
        fleet: whether a fleet's store is made as well.
    """
    (place / "machine.toml").write_text(BENCH)
    (place / "model.toml").write_text(BENCH + FITTED)
    (place / "rig.toml").write_text(RIG)
    (place / "map.toml").write_text(ANSWERS)
    (place / "own.py").write_text(OWN)
    (place / "part.ngc").write_text(PART)
    (place / "arm.toml").write_text(ARM)
    (place / "arm_model.toml").write_text(ARM + ARM_FITTED)
    _arm(place)
    _targets(place / "targets.csv")
    _scale_log().to_csv(place / "scale.csv", index=False)
    _axis_runs().to_csv(place / "axis.csv", index=False)
    for words in (
        ["simulate", "rig.toml", "targets.csv", "--seed", "3", "--out", "run.csv"],
        ["simulate", "rig.toml", "targets.csv", "--seed", "4", "--out", "also.csv"],
        ["predict", "targets.csv", "--model", "model.toml", "--out", "sliders.csv"],
        ["train", "run.csv", "--machine", "model.toml", "--out", "comp"],
        ["fit", "run.csv", "--model", "model.toml", "--out", "solved.toml"],
        *(FLEET if fleet else ()),
    ):
        run(words)
    depends = {"residual": "slider 2", "on": "b2", "share": 0.4, "p_value": 1e-5, "shape": "period", "period_mm": 5.0}
    found = {"depends_on": [depends | {"curve": {"at": [180.0, 285.0, 390.0]}}]}
    (place / "found.json").write_text(json.dumps(found))


def _targets(path: Path) -> None:
    """Two passes, there and back, over an ellipse that climbs: 24 poses, each reached from both sides."""
    angle = np.linspace(0.0, 4.0 * np.pi, 12, endpoint=False)
    there = np.column_stack([45.0 * np.cos(angle), 40.0 * np.sin(angle), 6.0 * angle]).round(3)
    rows = np.vstack([there, there[::-1]])
    frame = pd.DataFrame(rows, columns=["x_cmd", "y_cmd", "z_cmd"])
    frame.insert(0, "name", [f"p{index + 1}" for index in range(len(rows))])
    frame.to_csv(path, index=False)


def _arm(place: Path) -> None:
    """Thirty random poses of an arm with play, as a virtual tracker reads them, and some of them as targets."""
    from ptt.machine import load_machine
    from ptt.rig.draw_arm import draw_arm

    drawn = draw_arm(load_machine(place / "arm.toml").machine, "backlash", 3, rows=30)
    joints = [f"q{index + 1}_cmd_rad" for index in range(drawn.q.shape[1])]
    commands = pd.DataFrame(drawn.q.round(6), columns=joints)
    readings = pd.DataFrame(drawn.readings.round(4), columns=["x_meas", "y_meas", "z_meas"])
    more = pd.DataFrame({"payload_kg": drawn.payload_kg, "temp_c": drawn.temp_c.round(2), "time_s": drawn.time_s})
    pd.concat([commands, readings, more], axis=1).to_csv(place / "arm.csv", index=False)
    commands.head(12).to_csv(place / "arm_targets.csv", index=False)


def _scale_log() -> pd.DataFrame:
    """Two turns forward, two back, with 41 um of play, sampled evenly; two sliders."""
    turns = np.concatenate([np.linspace(0.0, 2.0, 200), np.linspace(2.0, 0.0, 200)])
    scale = 5.0 * turns
    scale[200:] = np.minimum(10.0, scale[200:] + 0.041)
    one = pd.DataFrame({"payload_kg": 0, "cycle": 1, "command_turns": turns.round(4), "scale_mm": scale.round(3)})
    return pd.concat([one.assign(slider=number) for number in (1, 2)])[["slider", *one.columns]]


def _axis_runs() -> pd.DataFrame:
    """Five positions of one axis, both ways, five times."""
    rng = np.random.default_rng(1)
    rows = []
    for cycle in range(5):
        for way, order in (("up", range(5)), ("down", reversed(range(5)))):
            rows += [(way, 50.0 * i, 50.0 * i + 0.01 * i + rng.normal(0.0, 0.002), cycle) for i in order]
    return pd.DataFrame(rows, columns=["direction", "target_mm", "measured_mm", "cycle"]).round(4)
