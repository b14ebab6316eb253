"""Runs of a given 3-PTT by protocols that show its faults, and what a drawn rig is."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import pandas as pd

from ptt.errors import WorkspaceError
from ptt.machine import MachineFile, ThreePttSpec
from ptt.rig.draw_faults import KNOWN
from ptt.rig.draw_noise import STATION_DISTANCE, station
from ptt.rig.nominal import Array, Drawing, can_reach, ideal_machine
from ptt.rig.rig import Rig
from ptt.rig.rig_file import parse_rig
from ptt.rig.schedule import TARGET
from ptt.rig.targets import HALF_SIZE, as_targets, make_helix, make_loop, make_volume, there_and_back

Protocol = Literal["path", "volume", "payload", "warmup", "speed"]
PROTOCOLS: tuple[Protocol, ...] = ("path", "volume", "payload", "warmup", "speed")


@dataclass(frozen=True)
class DrawnRig:
    """A rig, how it is measured, and what is hidden in it.

    Attributes:
        rig: the virtual machine.
        targets: for `simulate`.
        truth: {name of the effect or odd fault: {key: value}}, empty for a rig without faults.
        protocol: how it is measured.
        half_size: (3,) mm, half size of the workspace about p = 0.
        absent: columns of the run that are left out of its file.
        notes: kinds of what was drawn besides, as of 'noise' and 'path'.
    """

    rig: Rig
    targets: pd.DataFrame
    truth: dict[str, dict[str, Any]]
    protocol: Protocol
    half_size: Array = field(default_factory=HALF_SIZE.copy, compare=False)
    absent: tuple[str, ...] = ()
    notes: Mapping[str, str] = field(default_factory=dict, compare=False)


def draw_rig(seed: int, machine: MachineFile, protocol: Protocol = "volume", *, rows: int = 300) -> DrawnRig:
    """Draw a run of a machine without faults, on the paths of the sample data.

    Args:
        seed: of the poses, of how the tracker stands, and of the noise.
        machine: the drawing.
        protocol: how it is measured.
        rows: about how many readings.

    Returns:
        The rig and its targets.

    Raises:
        WorkspaceError: the machine does not reach the poses of the run.
    """
    random = np.random.default_rng([seed, 21])
    random.integers(sum(protocol in fault.protocols for fault in KNOWN))  # not used: what a seed draws next stays
    spec = machine.machine
    assert isinstance(spec, ThreePttSpec)
    drawing = ideal_machine(spec)
    targets, conditions = _measure(protocol, drawing, rows, seed)
    if not can_reach(drawing, targets[TARGET].to_numpy(float)).all():
        volume = " x ".join(f"{2.0 * half:g}" for half in HALF_SIZE)
        what = f"this machine cannot go everywhere in a run over {volume} mm about p = 0"
        raise WorkspaceError(what, [], where=machine.source, fix="take a machine that reaches more of it")
    content = {"seed": seed, "conditions": conditions, "tracker": _frame(random)}
    rig = parse_rig({"machine": spec.model_dump(mode="json", exclude_none=True), **content})
    return DrawnRig(replace(rig, machine=machine), targets, {}, protocol)


def _measure(protocol: Protocol, drawing: Drawing, rows: int, seed: int) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Targets and conditions of a protocol."""
    helix = as_targets(there_and_back(make_helix(rows // 4, rise=60.0 / (rows // 4), turns=2.0, start=-30.0)))
    recipe: Mapping[Protocol, Callable[[], tuple[pd.DataFrame, dict[str, Any]]]] = {
        "path": lambda: (helix, {"cycles": 2, "feed_mm_s": 30.0}),
        "volume": lambda: (make_volume(drawing, rows, seed), {"dwell_s": 10.0}),
        "payload": lambda: (
            make_volume(drawing, rows // 3, seed),
            {"cycles": 3, "payload_per_cycle_kg": [0.0, 2.5, 5.0], "pause_s": 60.0},
        ),
        "warmup": lambda: (
            make_volume(drawing, rows // 4, seed),
            {
                "cycles": 4,
                "pause_s": 1800.0,
                "dwell_s": 5.0,
                "room": {"start_c": 20.0, "rise_k": 8.0, "time_constant_s": 4000.0},
            },
        ),
        "speed": lambda: (
            as_targets(make_loop(rows // 3)),
            {"cycles": 3, "feed_per_cycle_mm_s": [8.0, 20.0, 50.0], "moving": True},
        ),
    }
    return recipe[protocol]()


def _frame(random: np.random.Generator) -> dict[str, Any]:
    """Station and frame of the tracker, keys of [tracker]."""
    return {
        "station_mm": station(random.uniform(0.0, 2.0 * np.pi), STATION_DISTANCE, random.uniform(0.0, 600.0)),
        "translation_mm": np.round(random.uniform(-0.5, 0.5, 3), 4).tolist(),
        "rotation_mrad": np.round(random.uniform(-0.5, 0.5, 3), 4).tolist(),
    }
