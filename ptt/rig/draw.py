"""Random 3-PTT rigs with known hidden faults, each measured by a protocol that shows its faults."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import pandas as pd

from ptt.errors import InputError, WorkspaceError
from ptt.machine import MachineFile
from ptt.rig.draw_faults import KNOWN, Fault, Scene
from ptt.rig.draw_noise import STATION_DISTANCE, station
from ptt.rig.draw_odd import UNKNOWN
from ptt.rig.nominal import Array, Drawing, can_reach, ideal_machine
from ptt.rig.rig import Rig
from ptt.rig.rig_file import SECTIONS, parse_rig
from ptt.rig.schedule import TARGET
from ptt.rig.schema import Section
from ptt.rig.targets import HALF_SIZE, as_targets, make_helix, make_loop, make_volume, there_and_back

Level = Literal["none", "single", "multi", "unknown"]
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


def draw_rig(
    level: Level,
    seed: int,
    machine: MachineFile,
    protocol: Protocol | None = None,
    *,
    rows: int = 300,
    fault: str | None = None,
) -> DrawnRig:
    """Hide faults in a machine.

    Args:
        level: "none"; "single", one effect of the library; "multi", two to four; "unknown", one fault that no effect
            describes and up to two that effects describe.
        seed: of the choice, the sizes, the poses and the noise.
        machine: the drawing.
        protocol: how it is measured; None lets the seed choose one that shows the faults.
        rows: about how many readings.
        fault: name of the fault to hide at level "single" or "unknown", None lets the seed choose.

    Returns:
        The rig, its targets, and the truth.

    Raises:
        InputError: an unknown level, protocol or fault, or one that the protocol cannot show.
        WorkspaceError: the machine does not reach the poses of the run.
    """
    random = np.random.default_rng([seed, 21])
    chosen, protocol = _choose(level, random, protocol, fault)
    base = parse_rig({"machine": _bare(machine), "seed": seed})
    rig = replace(base, machine=machine)
    drawing = ideal_machine(rig.spec)
    scene = Scene(drawing, rig.spec, HALF_SIZE, protocol)
    targets, conditions = _measure(protocol, drawing, rows, seed)
    if not can_reach(drawing, targets[TARGET].to_numpy(float)).all():
        volume = " x ".join(f"{2.0 * half:g}" for half in HALF_SIZE)
        what = f"this machine cannot go everywhere in a run over {volume} mm about p = 0"
        raise WorkspaceError(what, [], where=machine.source, fix="take a machine that reaches more of it")
    settings: dict[str, dict[str, Any]] = {"conditions": conditions, "tracker": _frame(random)}
    odd: list[dict[str, Any]] = []
    truth: dict[str, dict[str, Any]] = {}
    for item in chosen:
        size = item.draw(random, scene)
        truth[item.name] = size
        if item.section == "odd":
            odd.append(size)
        else:
            settings.setdefault(item.section, {}).update(size)
    if "knock_share" in settings["tracker"]:
        share = settings["tracker"].pop("knock_share")
        settings["tracker"]["knock_row"] = int(share * len(targets) * conditions.get("cycles", 1))
    return DrawnRig(_apply(rig, settings, odd), targets, truth, protocol)


def fault_names(level: Literal["single", "unknown"] = "single", protocol: Protocol | None = None) -> tuple[str, ...]:
    """Names of the faults that `draw_rig` hides.

    Args:
        level: "single" for effects of the library, "unknown" for faults outside it.
        protocol: only faults that it can show; None for all.

    Returns:
        Names in a fixed order.
    """
    table = KNOWN if level == "single" else UNKNOWN
    return tuple(item.name for item in table if protocol is None or protocol in item.protocols)


def _choose(  # the order of draws is part of a seed's meaning
    level: Level, random: np.random.Generator, protocol: Protocol | None, fault: str | None
) -> tuple[list[Fault], Protocol]:
    if level not in ("none", "single", "multi", "unknown"):
        raise InputError(f"level {level!r} is not known", fix="use none, single, multi or unknown")
    if protocol is not None and protocol not in PROTOCOLS:
        raise InputError(f"protocol {protocol!r} is not known", fix=f"use one of {', '.join(PROTOCOLS)}")
    table = UNKNOWN if level == "unknown" else KNOWN
    fits = [item for item in table if (protocol in (None, *item.protocols)) and fault in (None, item.name)]
    if not fits:
        raise InputError(
            f"no fault {fault or ''!r} that protocol {protocol!r} can show", fix="choose another protocol or fault"
        )
    first = fits[random.integers(len(fits))]
    if protocol is None:
        protocol = PROTOCOLS[1] if level == "none" else first.protocols[random.integers(len(first.protocols))]
    more = [item for item in KNOWN if protocol in item.protocols and item is not first]
    if level == "none":
        return [], protocol
    extra = {"single": (0, 1), "multi": (1, 4), "unknown": (0, 3)}[level]
    picked = random.permutation(len(more))[: int(random.integers(*extra))]
    return [first, *(more[number] for number in picked)], protocol


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


def _apply(rig: Rig, settings: Mapping[str, Mapping[str, Any]], odd: list[dict[str, Any]]) -> Rig:
    content: dict[str, Any] = {
        name: getattr(rig, name).model_dump(mode="json", exclude_defaults=True)
        for name in SECTIONS
        if isinstance(getattr(rig, name), Section)
    }
    for name, values in settings.items():
        content[name] |= values
    parsed = parse_rig({**content, "odd": odd, "seed": rig.seed, "machine": _bare(rig.machine)})
    return replace(parsed, machine=rig.machine)


def _bare(machine: MachineFile) -> dict[str, Any]:
    return machine.machine.model_dump(mode="json", exclude_none=True)
