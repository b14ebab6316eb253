"""Random rigs of serial arms with known hidden faults, each with a run that shows all of them."""

import tomllib
from typing import Any

import numpy as np
import pandas as pd

from ptt.errors import InputError
from ptt.machine import MachineFile, SerialSpec, format_machine
from ptt.rig.arm_faults import arm_values, tool_on_drawing
from ptt.rig.draw import DrawnRig, Level
from ptt.rig.draw_arm import ARM_FAULTS, NAMES, SECONDS_A_ROW, ArmFault, draw_faults, draw_masses, joint_ranges
from ptt.rig.nominal import Array
from ptt.rig.rig_file import parse_rig

SIGMA_MM = 0.01  # of one coordinate: a laser tracker at the reach of an arm, where the machine file states nothing
NUDGE = 1e-4  # rad, step of the numerical derivative of the tool's place
ARM_LEVELS: tuple[Level, ...] = ("none", "single", "multi")


def draw_serial(level: Level, seed: int, machine: MachineFile, rows: int = 220) -> DrawnRig:
    """Hide faults in an arm.

    Args:
        level: "none"; "single"; "multi", two to four.
        seed: of the choice, the sizes, the poses and the noise.
        machine: the drawing.
        rows: poses of the run.

    Returns:
        The rig, its targets, and the truth.

    Raises:
        InputError: a level that no arm is drawn at, or a machine that is none.
    """
    spec = machine.machine
    if not isinstance(spec, SerialSpec):
        raise InputError("this draws serial arms only", fix='use a machine of kind "serial"')
    if level not in ARM_LEVELS:
        fix = f"use {', '.join(ARM_LEVELS)}, or any of them by 'any'; leave --machine out for the bench"
        raise InputError(f"no arm is drawn at level '{level}'", where="--level", fix=fix)
    random = np.random.default_rng([seed, 71])
    truth = {NAMES[kind]: _values(kind, spec, random) for kind in _choose(level, spec, random)}
    q = _poses(spec, rows, random)
    content: dict[str, Any] = {
        "machine": tomllib.loads(format_machine(machine)),
        "seed": seed,
        "conditions": _conditions(spec, rows, random),
        "arm": {key: value for values in truth.values() for key, value in values.items()},
        "tracker": _tracker(machine, random),
    }
    if machine.tracker.tool == "fitted":
        content["arm"]["reflector_mm"] = np.round(random.uniform(-30.0, 30.0, 3), 3).tolist()
    rig = parse_rig(content)
    targets = pd.DataFrame(q, columns=rig.commanded)
    targets.insert(0, "name", [f"p{number + 1}" for number in range(rows)])
    return DrawnRig(rig, targets.assign(payload_kg=_loads(rows, truth, random)), truth, "volume")


def _choose(level: Level, spec: SerialSpec, random: np.random.Generator) -> list[ArmFault]:
    """Kinds of faults; links that weigh what no drawing says and a payload would strain the same springs."""
    kinds = [kind for kind in ARM_FAULTS if kind not in ("none", "weight")]
    if level == "single" and all(link.mass_kg is None for link in spec.joint):
        kinds.append("weight")
    count = {"none": 0, "single": 1}.get(level) if level != "multi" else int(random.integers(2, len(kinds) + 1))
    return [kinds[number] for number in random.permutation(len(kinds))[:count]]


def _values(kind: ArmFault, spec: SerialSpec, random: np.random.Generator) -> dict[str, Any]:
    values = arm_values(draw_faults(kind, len(spec.joint), random))
    if kind == "weight":
        masses = draw_masses(spec, random)
        values |= {"mass_kg": masses[:, 0].tolist(), "com_mm": masses[:, 1:].tolist()}
    return values


def _poses(spec: SerialSpec, rows: int, random: np.random.Generator) -> Array:
    """Joint commands (n, k) rad: of twice as many the half that is farthest from a singular posture.

    A stretched arm that sags cannot be sent farther out: its commands could not be corrected.
    """
    q = random.uniform(*joint_ranges(spec), (2 * rows, len(spec.joint)))
    steps = NUDGE * np.eye(len(spec.joint))
    nudged = [tool_on_drawing(spec, q + step) - tool_on_drawing(spec, q - step) for step in steps]
    sizes = np.linalg.svd(np.stack(nudged, axis=-1), compute_uv=False)
    keep = np.argsort(-sizes[:, -1] / np.maximum(sizes[:, 0], 1e-9))[:rows]  # 0 where no joint moves the tool
    return np.asarray(q[np.sort(keep)])


def _conditions(spec: SerialSpec, rows: int, random: np.random.Generator) -> dict[str, Any]:
    """A reading twice a minute, while the room warms up."""
    rise, share = random.uniform(4.0, 9.0), random.uniform(0.15, 0.5)
    room = {"start_c": spec.reference_temp_c, "rise_k": rise, "time_constant_s": share * rows * SECONDS_A_ROW}
    return {"feed_mm_s": 250.0, "dwell_s": SECONDS_A_ROW, "room": room}


def _loads(rows: int, truth: dict[str, Any], random: np.random.Generator) -> Array:
    """Payload by quarters of the run, (n,) kg: with and without."""
    carried = 0.0 if NAMES["weight"] in truth else float(np.round(random.uniform(3.0, 8.0), 2))
    return np.where(np.arange(rows) // max(rows // 4, 1) % 2 == 0, 0.0, carried)


def _tracker(machine: MachineFile, random: np.random.Generator) -> dict[str, Any]:
    """A tracker that stood anywhere, unless the machine file trusts its frame."""
    sigma = machine.tracker.sigma_mm
    section: dict[str, Any] = {"white_mm": SIGMA_MM if sigma is None else sigma}
    turn, shift = random.uniform(-500.0, 500.0, 3), random.uniform(-800.0, 800.0, 3)
    if machine.tracker.frame != "trusted":
        section |= {"rotation_mrad": np.round(turn, 3).tolist(), "translation_mm": np.round(shift, 3).tolist()}
    return section
