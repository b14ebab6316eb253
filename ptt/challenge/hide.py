"""Faults added to a rig by name, and removed again."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from ptt.errors import InputError
from ptt.rig import Rig
from ptt.rig.arm_scene import ArmScene, scene_of_arm
from ptt.rig.draw import DrawnRig
from ptt.rig.draw_arm_known import ARM_KNOWN
from ptt.rig.draw_arm_odd import ARM_ODD
from ptt.rig.draw_faults import KNOWN, Fault, Scene
from ptt.rig.draw_odd import SHOWN_FAULTS
from ptt.rig.draw_unseen import UNSEEN_FAULTS
from ptt.rig.nominal import ideal_machine
from ptt.rig.odd_schema import Odd

FAULTS = {fault.name: fault for fault in (*KNOWN, *SHOWN_FAULTS, *UNSEEN_FAULTS)}
ARM_FAULTS = {fault.name: fault for fault in (*ARM_KNOWN, *ARM_ODD)}
_ODD: TypeAdapter[Any] = TypeAdapter(Odd)


def faults_of(rig: Rig) -> Mapping[str, Fault]:
    """Faults that can be hidden in a rig, by name; faults of a 3-PTT and of an arm may share a name."""
    return FAULTS if rig.serial is None else ARM_FAULTS


def hide_faults(drawn: DrawnRig, names: Sequence[str], seed: int, times: float = 1.0) -> DrawnRig:
    """Hide faults of random size in a rig, whether or not its run shows them.

    Args:
        drawn: the rig, its targets, and what is hidden already.
        names: of `faults_of` the rig.
        seed: of the sizes.
        times: factor on the drawn sizes, of faults all of whose values are sizes of legs.

    Returns:
        The rig with these faults as well.

    Raises:
        InputError: an unknown fault, or one that is hidden already.
    """
    random = np.random.default_rng([seed, 51])
    rig, truth = drawn.rig, dict(drawn.truth)
    scene, table = _scene(drawn), faults_of(rig)
    for name in names:
        if name not in table or table[name].called in {table[other].called for other in truth}:
            raise InputError(f"fault '{name}' is not known or hidden already", fix=f"use others of {', '.join(table)}")
        values = table[name].draw(random, scene)
        if times != 1.0:
            values = {key: (times * np.array(legs)).tolist() for key, legs in values.items()}
        truth[name] = values
        rig = _with_fault(rig, table[name].section, _at_rows(values, len(drawn.targets) * rig.conditions.cycles))
    return replace(drawn, rig=rig, truth=truth)


def clear_faults(rig: Rig, truth: Mapping[str, Mapping[str, Any]], names: Iterable[str]) -> Rig:
    """Remove faults from a rig.

    Args:
        rig: with faults.
        truth: name of the fault -> keys and values in the rig.
        names: of the faults to remove.

    Returns:
        The rig without them.
    """
    for name in names:
        section = faults_of(rig)[name].section
        if section == "odd":
            fault = _ODD.validate_python(dict(truth[name]))
            rig = replace(rig, odd=tuple(item for item in rig.odd if item != fault))
            continue
        present = getattr(rig, section)
        update = {key: type(present).model_fields[key].default for key in _at_rows(truth[name], 0)}
        rig = replace(rig, **{section: present.model_copy(update=update)})
    return rig


def called(rig: Rig, name: str) -> str:
    """Name in the library of a fault of a rig."""
    return faults_of(rig)[name].called


def _scene(drawn: DrawnRig) -> Scene | ArmScene:
    if drawn.rig.serial is not None:
        return scene_of_arm(drawn)
    return Scene(ideal_machine(drawn.rig.spec), drawn.rig.spec, drawn.half_size, drawn.protocol)


def _with_fault(rig: Rig, section: str, values: Mapping[str, Any]) -> Rig:
    if section == "odd":
        return replace(rig, odd=(*rig.odd, _ODD.validate_python(values)))
    present = getattr(rig, section)
    joined = {**present.model_dump(exclude_defaults=True), **values}
    return replace(rig, **{section: type(present).model_validate(joined)})


def _at_rows(values: Mapping[str, Any], rows: int) -> dict[str, Any]:
    """Values of the rig's file: of an event drawn at a share of the run its row."""
    shares = {"knock_share": "knock_row", "slip_share": "slip_row"}
    return {shares.get(key, key): int(value * rows) if key in shares else value for key, value in values.items()}
