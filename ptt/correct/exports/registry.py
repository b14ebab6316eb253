"""Export formats by name."""

import difflib
import importlib
import importlib.util
from typing import cast

from ptt.correct.exports.format import SERIAL, THREE_PTT, Format, Write
from ptt.errors import InputError

_ROOM = "ptt.correct.exports"
FORMATS: tuple[Format, ...] = (
    Format("c", f"{_ROOM}.c", (THREE_PTT, SERIAL), "C99 source: commands one after the other, reversal included"),
    Format("onnx", f"{_ROOM}.onnx", (THREE_PTT, SERIAL), "an ONNX graph: commands in batches, reversal left aside"),
    Format("klipper", f"{_ROOM}.klipper", (THREE_PTT,), "printer.cfg of a delta: radius, arms, angles, end stops"),
    Format("linuxcnc", f"{_ROOM}.linuxcnc", (THREE_PTT,), "lineardeltakins and one compensation file per axis", True),
    Format("reprapfirmware", f"{_ROOM}.reprapfirmware", (THREE_PTT,), "M665 and M666 of RepRapFirmware"),
    Format("marlin", f"{_ROOM}.marlin", (THREE_PTT,), "M665 and M666 of Marlin"),
    Format("siemens", f"{_ROOM}.siemens", (THREE_PTT, SERIAL), "$AA_ENC_COMP, one compensation table per axis", True),
    Format("urdf", f"{_ROOM}.urdf", (SERIAL,), "joint origins of the calibrated arm"),
    Format("table", f"{_ROOM}.table", (THREE_PTT,), "CSV grid of corrections over the workspace", True),
)


def find_format(name: str) -> Format:
    """Find a format.

    Args:
        name: as typed.

    Returns:
        The format.

    Raises:
        InputError: there is none of that name.
    """
    known = {each.name: each for each in available()}
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known, n=1)
    fix = f"did you mean '{near[0]}'?" if near else f"take one of {', '.join(known)}"
    raise InputError(f"no export format '{name}'", where="--to", fix=fix)


def available() -> list[Format]:
    """Formats whose module is there."""
    return [each for each in FORMATS if importlib.util.find_spec(each.module)]


def writer(chosen: Format, kind: str) -> Write:
    """The function that writes a format for a machine.

    Args:
        chosen: the format.
        kind: mechanism family of the machine.

    Returns:
        Its `write`.

    Raises:
        InputError: the format is for other machines.
    """
    if kind not in chosen.mechanisms:
        fix = f"take one of {', '.join(each.name for each in available() if kind in each.mechanisms)}"
        raise InputError(f"format '{chosen.name}' is not for a {kind} machine", where="--to", fix=fix)
    return cast(Write, importlib.import_module(chosen.module).write)
