"""Reading a machine file that cannot be built because a diameter was given for a radius, so that it can be checked."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import tomlkit

from ptt.documents import parse_toml
from ptt.errors import InputError, MachineError
from ptt.files import read_text
from ptt.machine import MachineFile, ThreePttSpec, parse_machine

RADII = ("base_radius_mm", "platform_radius_mm")


def read_unbuilt(path: Path) -> MachineFile | None:
    """A machine file whose links are too short as it stands, and long enough with one or both radii halved.

    Args:
        path: of the file.

    Returns:
        The machine as drawn, of which no mechanism can be built; None where something else is wrong.
    """
    try:
        text = read_text(path, MachineError)
        raw = parse_toml(text, str(path)).get("machine")
    except InputError:
        return None
    if not isinstance(raw, dict) or not all(isinstance(raw.get(key), int | float) for key in RADII):
        return None
    for keys in (each for count in (1, 2) for each in combinations(RADII, count)):
        halved = tomlkit.parse(text)
        halved["machine"].update({key: raw[key] / 2.0 for key in keys})
        try:
            file = parse_machine(tomlkit.dumps(halved), str(path))
        except MachineError:
            continue
        if isinstance(file.machine, ThreePttSpec):
            drawn = file.machine.model_copy(update={key: float(raw[key]) for key in keys})
            return replace(file, machine=drawn, text=text)
    return None
