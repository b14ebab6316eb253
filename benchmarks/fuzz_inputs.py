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
COMPARE, PREDICT = ["compare", "run.csv", "--model", "model.toml", "--json"], ["predict", "targets.csv"]
# command line, the inputs that it reads, its output, and how often it is drawn (slow ones less)
COMMANDS: tuple[tuple[list[str], tuple[str, ...], str, int], ...] = (
    (COMPARE, ("run.csv", "model.toml"), "", 6),
    ([*COMPARE, "--map", "map.toml"], ("map.toml", "run.csv"), "", 3),
    ([*COMPARE, "--also", "also.csv"], ("also.csv",), "", 2),
    (["compare", "run.csv", "--model", "comp", "--json"], ("comp",), "", 3),
    (["check", "run.csv", "--model", "machine.toml", "--json"], ("run.csv", "machine.toml"), "", 8),
    (["check", "run.csv", "--model", "machine.toml", "--out-run", "out.csv", "--json"], ("run.csv",), "out.csv", 3),
    (["diagnose", "run.csv", "--model", "machine.toml", "--steps", "1", "--json"], ("run.csv", "machine.toml"), "", 1),
    (["add", "run.csv", "link-length", "--model", "model.toml", "--out", "out.toml", "--json"],
     ("run.csv", "model.toml"), "out.toml", 2),
    (["add", "run.csv", "pull", "--model", "model.toml", "--effects", "own.py", "--out", "out.toml", "--json"],
     ("own.py",), "out.toml", 5),
    (["fit", "run.csv", "--model", "model.toml", "--out", "out.toml", "--json"], ("run.csv", "model.toml"),
     "out.toml", 3),
    (["remove", "run.csv", "backlash", "--model", "model.toml", "--out", "out.toml", "--json"], ("model.toml",),
     "out.toml", 1),
    ([*PREDICT, "--model", "model.toml", "--out", "out.csv", "--json"], ("targets.csv", "model.toml"), "out.csv", 8),
    ([*PREDICT, "--model", "comp", "--out", "out.csv", "--json"], ("comp", "targets.csv"), "out.csv", 12),
    (["train", "run.csv", "--machine", "model.toml", "--out", "folder", "--json"], ("run.csv", "model.toml"),
     "folder", 1),
    (["evaluate", "run.csv", "also.csv", "--json"], ("run.csv", "also.csv"), "", 6),
    (["iso", "run.csv", "--model", "machine.toml", "--json"], ("run.csv", "machine.toml"), "", 5),
    (["iso", "axis.csv", "--json"], ("axis.csv",), "", 5),
    (["backlash", "scale.csv", "--lead", "5", "--json"], ("scale.csv",), "", 8),
    (["backlash", "scale.csv", "--model", "machine.toml", "--json"], ("machine.toml", "scale.csv"), "", 3),
    (["simulate", "rig.toml", "targets.csv", "--out", "out.csv", "--json"], ("rig.toml", "targets.csv"), "out.csv", 8),
    (["simulate", "rig.toml", "targets.csv", "--sliders", "sliders.csv", "--out", "out.csv", "--json"],
     ("sliders.csv",), "out.csv", 5),
    (["plan", "machine.toml", "--out", "out.csv", "--rows", "40", "--json"], ("machine.toml",), "out.csv", 1),
    (["dexterity", "machine.toml", "--targets", "targets.csv", "--json"], ("machine.toml", "targets.csv"), "", 3),
    (["effects", "--effects", "own.py", "--json"], ("own.py",), "", 3),
    (["effects", "check", "own.py", "--json"], ("own.py",), "", 3),
    (["effects", "new", "cable-drag", "--like", "found.json", "--out", "out.py", "--json"], ("found.json",),
     "out.py", 3),
)  # fmt: skip


def make_inputs(place: Path, run: Callable[[list[str]], int]) -> None:
    """Write the sound inputs into a folder, each by the commands themselves where one makes it.

    Args:
        place: an empty folder.
        run: runs a command line in it and returns the exit code.
    """
    (place / "machine.toml").write_text(BENCH)
    (place / "model.toml").write_text(BENCH + FITTED)
    (place / "rig.toml").write_text(RIG)
    (place / "map.toml").write_text(ANSWERS)
    (place / "own.py").write_text(OWN)
    _targets(place / "targets.csv")
    _scale_log().to_csv(place / "scale.csv", index=False)
    _axis_runs().to_csv(place / "axis.csv", index=False)
    for words in (
        ["simulate", "rig.toml", "targets.csv", "--seed", "3", "--out", "run.csv"],
        ["simulate", "rig.toml", "targets.csv", "--seed", "4", "--out", "also.csv"],
        [*PREDICT, "--model", "model.toml", "--out", "sliders.csv"],
        ["train", "run.csv", "--machine", "model.toml", "--out", "comp"],
    ):
        if run(words):
            raise RuntimeError(f"{words} fails on sound inputs")
    found = {"depends_on": [{"residual": "slider 2", "on": "b2", "share": 0.4, "p_value": 1e-5, "period_mm": 5.0}]}
    (place / "found.json").write_text(json.dumps(found))


def _targets(path: Path) -> None:
    """Two passes, there and back, over an ellipse that climbs: 24 poses, each reached from both sides."""
    angle = np.linspace(0.0, 4.0 * np.pi, 12, endpoint=False)
    there = np.column_stack([45.0 * np.cos(angle), 40.0 * np.sin(angle), 6.0 * angle]).round(3)
    rows = np.vstack([there, there[::-1]])
    frame = pd.DataFrame(rows, columns=["x_cmd", "y_cmd", "z_cmd"])
    frame.insert(0, "name", [f"p{index + 1}" for index in range(len(rows))])
    frame.to_csv(path, index=False)


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
