"""Random arms without faults: drawing, run, conditions and noise are all drawn by seed."""

import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from ptt.machine import MachineFile, format_machine
from ptt.rig.draw import DrawnRig, Protocol
from ptt.rig.draw_arm_machine import ForeignArm, draw_arm_file
from ptt.rig.draw_arm_paths import draw_arm_plan
from ptt.rig.draw_foreign import STATIC, draw_rise, draw_set_up, state_noise
from ptt.rig.draw_noise import NOISES, draw_noise, stated_sigma
from ptt.rig.rig_file import parse_rig
from ptt.rig.schedule import TARGET

Random = np.random.Generator
ROWS = (40, 700)
LOUDER = (1.0, 6.0)  # times a bench: longer ways, warmer air, a nest set by hand
LENGTHS = ("white_mm", "outlier_mm", "axis_um", "quantum_um", "wander_um", "radial_um", "sideways_um_per_m")
ARM_PROTOCOLS: tuple[Protocol, ...] = ("volume", "payload", "warmup")
KG_A_METRE = 8.0  # what an arm carries at the most, by its reach
TURN_MRAD = (20.0, 20.0, 3000.0)  # greatest turns of the tracker's frame: any way about the upright
MOUNT_MM = 40.0  # reflector beside the tool point, where its mount is fitted
UNWANTED = 0.25  # share of runs in which nobody wrote down where the tool was wanted


def draw_foreign_arm(
    seed: int,
    protocol: Protocol = "volume",
    *,
    noise: str | None = None,
    rows: int | None = None,
    path: str | None = None,
    arm: ForeignArm | None = None,
) -> DrawnRig:
    """Draw an arm without faults and a run of it.

    Args:
        seed: of everything.
        protocol: what changes during the run besides the pose: 'volume' nothing, 'payload', 'warmup'.
        noise: kind of noise, None lets the seed choose.
        rows: about how many readings, None lets the seed choose from 40 to 700.
        path: kind of path, None lets the seed choose.
        arm: a drawing to take instead of one drawn by the seed.

    Returns:
        The rig, without faults.
    """
    random = np.random.default_rng([seed, 83])
    drawn_rows, kind = round(float(np.exp(random.uniform(*np.log(ROWS))))), str(random.choice(list(NOISES)))
    arm, kind = arm or draw_arm_file(seed), noise or kind
    plan = draw_arm_plan(seed, arm, rows or drawn_rows, path)
    dwell = float(np.round(random.uniform(4.0, 40.0), 1))
    times = len(plan.targets) * plan.cycles
    conditions, targets = CONDITIONS[protocol](random, arm, plan.targets, plan.cycles, times * dwell)
    per_run = "fitted-per-run" in (arm.file.tracker.frame, arm.file.tracker.tool)
    conditions |= {"dwell_s": dwell, "feed_mm_s": float(random.choice([100.0, 250.0])), "cycles": plan.cycles}
    values = _louder(draw_noise(kind, seed), float(np.exp(random.uniform(*np.log(LOUDER)))))
    tracker = {**draw_set_up(random, arm.file, shift_mm=3000.0, turn_mrad=TURN_MRAD, digits=3), **values}
    tracker["station_mm"] = _farther(tracker["station_mm"], arm.reach_mm)
    told = random.random() < 0.5
    sigma = stated_sigma(values, float(np.linalg.norm(tracker["station_mm"]))) * random.uniform(0.8, 1.25)
    file = state_noise(arm.file, sigma if told else None)
    content: dict[str, Any] = {
        "machine": tomllib.loads(format_machine(file)),
        "seed": seed,
        "conditions": {**conditions, "run_per_cycle": per_run},
        "arm": _mount(random, file),
        "tracker": tracker,
    }
    absent = STATIC if protocol == "volume" and random.random() < 0.4 else ()
    if random.random() < UNWANTED:
        absent = (*absent, *TARGET)
    notes = {"noise": kind, "path": plan.path, "repeats": plan.repeats, "family": arm.family}
    return DrawnRig(parse_rig(content), targets, {}, protocol, np.full(3, arm.reach_mm), absent, notes)


Made = tuple[dict[str, Any], pd.DataFrame]


def _still(random: Random, arm: ForeignArm, targets: pd.DataFrame, cycles: int, lasts: float) -> Made:
    return {}, targets


def _loads(random: Random, arm: ForeignArm, targets: pd.DataFrame, cycles: int, lasts: float) -> Made:
    """Two to four loads, in blocks of the run or one for each cycle."""
    most = KG_A_METRE * 1e-3 * arm.reach_mm * random.uniform(0.4, 1.0)
    loads = np.round(random.permutation(np.linspace(0.0, most, int(random.integers(2, 5)))), 2)
    if cycles > 1:
        return {"payload_per_cycle_kg": loads.tolist(), "pause_s": 60.0}, targets
    blocks = len(loads) * int(random.integers(1, 3))
    number = np.arange(len(targets)) * blocks // len(targets)
    return {}, targets.assign(payload_kg=loads[number % len(loads)])


def _warming(random: Random, arm: ForeignArm, targets: pd.DataFrame, cycles: int, lasts: float) -> Made:
    room = {"start_c": arm.file.machine.reference_temp_c, "rise_k": draw_rise(random)}
    return {"room": room | {"time_constant_s": lasts * random.uniform(0.2, 0.6)}}, targets


CONDITIONS: dict[str, Callable[[Random, ForeignArm, pd.DataFrame, int, float], Made]] = {
    "volume": _still,
    "payload": _loads,
    "warmup": _warming,
}


def _louder(values: dict[str, Any], times: float) -> dict[str, Any]:
    """Noise whose lengths are multiplied by a factor."""
    return {key: (np.asarray(value) * times).tolist() if key in LENGTHS else value for key, value in values.items()}


def _farther(station: list[float], reach: float) -> list[float]:
    """A station as far outside the arm's reach as it was from the base's origin, mm."""
    place = np.asarray(station)
    distance = float(np.linalg.norm(place))
    return np.round(place * (distance + reach) / distance, 1).tolist()


def _mount(random: Random, file: MachineFile) -> dict[str, Any]:
    """Where the reflector sits beside the tool point, where nobody measured it."""
    place = np.round(random.uniform(-MOUNT_MM, MOUNT_MM, 3), 3).tolist()
    if file.tracker.tool == "trusted":
        return {}
    return {"reflector_mm": place} | ({"reflector_scatter_mm": 0.5} if file.tracker.tool == "fitted-per-run" else {})
