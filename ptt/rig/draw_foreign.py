"""Random 3-PTT rigs without faults: drawing, path, conditions and noise are all drawn by seed."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ptt.machine import MachineFile, ThreePttSpec
from ptt.machine_schema import TrackerSpec
from ptt.rig.draw import DrawnRig, Protocol
from ptt.rig.draw_machine import Foreign, draw_machine_file
from ptt.rig.draw_noise import NOISES, STATION_DISTANCE, draw_noise, stated_sigma, station
from ptt.rig.nominal import ideal_machine
from ptt.rig.paths import PER_TURN, SMOOTH, draw_plan
from ptt.rig.rig_file import parse_rig

Random = np.random.Generator
ROWS = (24, 600)
LONG, LONGEST = 0.05, 2000  # share of runs that are longer, and how long they get
STATIC = ("payload_kg", "temp_c", "feed_mm_s")  # columns that say nothing where nothing of the kind changes


def draw_foreign(
    seed: int,
    protocol: Protocol = "volume",
    *,
    noise: str | None = None,
    rows: int | None = None,
    path: str | None = None,
    repeats: str | None = None,
    foreign: Foreign | None = None,
) -> DrawnRig:
    """Draw a rig without faults.

    Args:
        seed: of everything.
        protocol: what changes during the run besides the pose; 'path' is a curve, 'volume' any path.
        noise: kind of noise, None lets the seed choose.
        rows: about how many readings, None lets the seed choose from 24 to 2,000.
        path: kind of path, None lets the seed choose.
        repeats: form of the repeats, None lets the seed choose.
        foreign: a drawing with its workspace to take instead of one drawn by the seed.

    Returns:
        The rig, without faults.
    """
    random = np.random.default_rng([seed, 74])
    drawn_rows, kind = _draw_rows(random), str(random.choice(list(NOISES)))
    kind, rows = noise or kind, rows or drawn_rows
    foreign = foreign or draw_machine_file(seed)
    spec = foreign.file.machine
    assert isinstance(spec, ThreePttSpec)
    cycles, conditions = CONDITIONS[protocol](random)
    moving = protocol == "speed"
    if moving and foreign.file.tracker.frame == "measured":  # nor starts and ends it standing before base reflectors
        foreign = replace(foreign, file=replace(foreign.file, tracker=TrackerSpec()))
    if path is None and protocol in ("path", "speed"):
        path = str(random.choice(SMOOTH))
    repeats = "none" if cycles > 1 else repeats  # what is run through under every load is repeated thereby
    count = max(rows // cycles, PER_TURN if moving else 8)
    plan = draw_plan(seed, ideal_machine(spec), foreign.half_size, count, path, repeats, smooth=moving)
    conditions["cycles"] = cycles if cycles > 1 else plan.cycles
    per_run = foreign.file.tracker.frame == "fitted-per-run"
    conditions["run_per_cycle"] = per_run
    values = draw_noise(kind, seed)
    tracker = {**draw_set_up(random, foreign.file, shift_mm=2.0, turn_mrad=(2.0, 2.0, 2.0)), **values}
    datum = int(random.integers(10, 30)) * int(random.random() < 0.3)
    tracker["datum_every"] = 0 if moving else datum  # nobody breaks off a smooth run
    told = random.random() < 0.5
    away = float(np.linalg.norm(tracker["station_mm"]))
    file = state_noise(foreign.file, stated_sigma(values, away) * random.uniform(0.8, 1.25) if told else None)
    dwell = float(np.round(random.uniform(2.0, 12.0), 1))
    content = {"seed": seed, "conditions": {"dwell_s": dwell, **conditions}, "tracker": tracker}
    rig = parse_rig({"machine": spec.model_dump(mode="json", exclude_none=True), **content})
    absent = STATIC if protocol in ("path", "volume") and random.random() < 0.4 else ()
    notes = {"noise": kind, "path": plan.path, "repeats": plan.repeats}
    return DrawnRig(replace(rig, machine=file), plan.targets, {}, protocol, foreign.half_size, absent, notes)


def _draw_rows(random: Random) -> int:
    low, high = (ROWS[1], LONGEST) if random.random() < LONG else ROWS
    return round(float(np.exp(random.uniform(np.log(low), np.log(high)))))


def _still(random: Random) -> tuple[int, dict[str, Any]]:
    return 1, {"feed_mm_s": float(random.choice([20.0, 50.0, 100.0]))}


def _loads(random: Random) -> tuple[int, dict[str, Any]]:
    count = int(random.integers(2, 5))
    loads = np.round(random.permutation(np.linspace(0.0, random.uniform(2.0, 8.0), count)), 2)
    return count, {"payload_per_cycle_kg": loads.tolist(), "pause_s": 60.0}


def _warming(random: Random) -> tuple[int, dict[str, Any]]:
    room = {
        "start_c": 20.0,
        "rise_k": draw_rise(random),
        "time_constant_s": float(random.uniform(2000.0, 6000.0)),
    }
    return int(random.integers(3, 6)), {"room": room, "pause_s": float(random.uniform(600.0, 2400.0))}


def _speeds(random: Random) -> tuple[int, dict[str, Any]]:
    feeds = random.permutation([8.0, 20.0, 50.0])
    return 3, {"feed_per_cycle_mm_s": feeds.tolist(), "moving": True}


CONDITIONS: dict[Protocol, Callable[[Random], tuple[int, dict[str, Any]]]] = {
    "path": _still,
    "volume": _still,
    "payload": _loads,
    "warmup": _warming,
    "speed": _speeds,
}


def draw_rise(random: Random) -> float:
    """By how much a room warms up during a run, or, once in three, cools down, K."""
    return float(np.round(random.uniform(4.0, 10.0) * random.choice([-1.0, 1.0, 1.0]), 2))


def draw_set_up(
    random: Random, file: MachineFile, *, shift_mm: float, turn_mrad: tuple[float, ...], digits: int = 4
) -> dict[str, Any]:
    """Keys of [tracker]: where it stands, and how its frame lies within greatest shifts and turns of each axis.

    Where the file trusts the frame, it lies exactly as it says.
    """
    place = station(random.uniform(0.0, 2.0 * np.pi), STATION_DISTANCE, random.uniform(0.0, 800.0))
    shift, turn = random.uniform(-shift_mm, shift_mm, 3), random.uniform(-np.array(turn_mrad), turn_mrad)
    values: dict[str, Any] = {"station_mm": place}
    if file.tracker.frame != "trusted":
        values |= {"translation_mm": np.round(shift, digits).tolist(), "rotation_mrad": np.round(turn, 4).tolist()}
    if file.tracker.frame == "fitted-per-run":
        values |= {"frame_scatter_mm": 0.3, "frame_scatter_mrad": 0.3}
    return values


def state_noise(file: MachineFile, sigma: float | None) -> MachineFile:
    """The machine file with a stated noise, mm, to two digits; None states none."""
    rounded = None if sigma is None else float(f"{sigma:.2g}")
    return replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": rounded}), text="")
