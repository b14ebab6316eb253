"""RIG.toml <-> a virtual machine."""

import difflib
import tomllib
from pathlib import Path
from typing import Any

import pydantic
import tomlkit

from ptt.documents import parse_toml
from ptt.errors import InputError, shown
from ptt.files import read_text
from ptt.machine import MachineFile, format_machine, load_machine, parse_machine
from ptt.rig import arm_odd_schema, odd_schema, schema
from ptt.rig.check import check_rig
from ptt.rig.odd_schema import Odd
from ptt.rig.rig import Rig


class _Document(schema.Section):
    machine: str | dict[str, Any]
    seed: schema.NonNegativeInt = 0
    conditions: schema.Conditions = schema.Conditions()
    controller: schema.Controller = schema.Controller()
    drive: schema.Drive = schema.Drive()
    thermal: schema.Thermal = schema.Thermal()
    geometry: schema.Geometry = schema.Geometry()
    structure: schema.Structure = schema.Structure()
    arm: schema.Arm = schema.Arm()
    odd: tuple[Odd, ...] = ()
    tracker: schema.Tracker = schema.Tracker()


SECTIONS = ("conditions", "controller", "drive", "thermal", "geometry", "structure", "arm", "odd", "tracker")


def load_rig(path: str | Path) -> Rig:
    """Read a RIG.toml.

    Args:
        path: the file; a `machine = "..."` in it is looked up beside it.

    Returns:
        The rig.

    Raises:
        InputError: the file or its machine cannot be read, an unknown key, a value out of bounds.
    """
    return parse_rig(read_text(path), str(path))


def parse_rig(content: str | dict[str, Any], where: str = "rig.toml") -> Rig:
    """Parse a rig.

    Args:
        content: TOML text or the dictionary it stands for. `machine` is a path relative to `where`, a table as the
            [machine] of a machine file, or a whole machine file as a table.
        where: name of the file for messages and for the machine's path.

    Returns:
        The rig.

    Raises:
        InputError: not TOML, an unknown or missing key, a value out of bounds.
    """
    raw = parse_toml(content, where) if isinstance(content, str) else content
    try:
        document = _Document.model_validate(raw)
    except pydantic.ValidationError as error:
        if isinstance(raw.get("machine"), dict) and "tracker" in raw and "seed" not in raw:
            what, fix = (
                "is a machine file",
                f'name a rig that says machine = "{Path(where).name}" and what is hidden in it',
            )
            raise InputError(what, where=where, fix=fix) from None
        raise _explain(error, where) from None
    rig = Rig(
        _find_machine(document.machine, where),
        document.seed,
        **{name: getattr(document, name) for name in SECTIONS},
        source=where,
    )
    check_rig(rig)
    return rig


def format_rig(rig: Rig) -> str:
    """Write a rig as TOML with its machine inside; keys at their default are left out.

    Args:
        rig: the rig.

    Returns:
        TOML text that `parse_rig` reads back to an equal rig.
    """
    document: dict[str, Any] = {"seed": rig.seed}
    for name in SECTIONS:
        section = getattr(rig, name)
        values = (
            [item.model_dump(mode="json", exclude_none=True) for item in section]
            if isinstance(section, tuple)
            else section.model_dump(mode="json", exclude_defaults=True, exclude_none=True)
        )
        if values:
            document[name] = values
    document["machine"] = tomllib.loads(format_machine(rig.machine))
    return tomlkit.dumps(document)


def _find_machine(machine: str | dict[str, Any], where: str) -> MachineFile:
    if isinstance(machine, str):
        return load_machine(Path(where).parent / machine)
    whole = machine if isinstance(machine.get("machine"), dict) else {"machine": machine}
    return parse_machine(tomlkit.dumps(whole), where)


def _explain(error: pydantic.ValidationError, where: str) -> InputError:
    """The first of pydantic's errors as one message."""
    first = error.errors()[0]
    path = [str(part) for part in first["loc"]]
    if first["type"] == "extra_forbidden":
        known = [
            name
            for name in (*vars(schema).values(), *vars(odd_schema).values(), *vars(arm_odd_schema).values())
            if isinstance(name, type) and issubclass(name, schema.Section)
        ]
        keys = [key for section in known for key in section.model_fields] + list(_Document.model_fields)
        guess = difflib.get_close_matches(path[-1], keys, n=1)
        fix = f"did you mean '{guess[0]}'?" if guess else "remove it"
        return InputError(
            f"unknown key '{shown(path[-1])}'", where=where, fix=f"{fix} (in {'.'.join(path[:-1]) or 'top'})"
        )
    message = first["msg"].removeprefix("Value error, ")
    found = "" if isinstance(first["input"], dict) else f" (found {shown(repr(first['input']))})"
    return InputError(f"{message[0].lower()}{message[1:]}{found}", where=f"{where} key {'.'.join(path)}")
