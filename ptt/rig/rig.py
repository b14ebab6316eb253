"""RIG.toml <-> the faults, conditions and machine that one simulated run needs."""

import difflib
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pydantic
import tomlkit

from ptt.documents import parse_toml
from ptt.errors import InputError, shown
from ptt.files import read_text
from ptt.machine import MachineFile, SerialSpec, ThreePttSpec, format_machine, load_machine, parse_machine
from ptt.rig import arm_odd_schema, odd_schema, schema
from ptt.rig.arm_odd_schema import ArmLaw, OfArm
from ptt.rig.odd_schema import Odd


@dataclass(frozen=True)
class Rig:
    """A virtual machine and the conditions it is run under.

    Attributes:
        machine: the drawing and the base reflectors.
        seed: of every random number of a run.
        conditions: payload, feed, room, repeats.
        controller: what the controller compensates by itself.
        drive: faults between command and slider.
        thermal: temperatures and growth.
        geometry: faults of rails, links, joints and platform.
        structure: bending of the column.
        arm: faults of a serial arm, which has none of drive, thermal, geometry and structure.
        odd: faults that are no effect of the library.
        tracker: metrology.
        source: the file's name for messages.
    """

    machine: MachineFile
    seed: int
    conditions: schema.Conditions
    controller: schema.Controller
    drive: schema.Drive
    thermal: schema.Thermal
    geometry: schema.Geometry
    structure: schema.Structure
    arm: schema.Arm
    odd: tuple[Odd, ...]
    tracker: schema.Tracker
    source: str = field(compare=False)

    @property
    def spec(self) -> ThreePttSpec:
        """The drawing of a 3-PTT."""
        if not isinstance(self.machine.machine, ThreePttSpec):
            what = "this needs a 3-PTT, the rig is a serial arm"
            raise InputError(what, where=self.source, fix='use a machine of kind "three-ptt"')
        return self.machine.machine

    @property
    def serial(self) -> SerialSpec | None:
        """The drawing of a serial arm; None for a 3-PTT."""
        return self.machine.machine if isinstance(self.machine.machine, SerialSpec) else None

    @property
    def sent(self) -> list[str]:
        """Columns of commands that were corrected: b1.. or q1.., one for each joint."""
        spec = self.machine.machine
        return [f"{spec.letter}{joint + 1}" for joint in range(spec.joints)]

    @property
    def commanded(self) -> list[str]:
        """Columns of joint commands in a run: mm for sliders, rad for an arm."""
        return [f"{joint}_cmd{'' if self.serial is None else '_rad'}" for joint in self.sent]


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


_ARM_VARIABLE = re.compile(r"(q|direction)[1-7]|[xyz]|payload|temperature|memory|time")
SECTIONS = ("conditions", "controller", "drive", "thermal", "geometry", "structure", "arm", "odd", "tracker")
SLIDERS_ONLY = ("controller", "drive", "thermal", "geometry", "structure")


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
    _check(rig)
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


def _check(rig: Rig) -> None:
    """Refuse what no single key can show to be wrong."""
    tables = (
        ("drive.map_um", rig.drive.map_height_mm, rig.drive.map_um),
        ("geometry.straightness_radial_um", rig.geometry.straightness_height_mm, rig.geometry.straightness_radial_um),
        (
            "geometry.straightness_tangential_um",
            rig.geometry.straightness_height_mm,
            rig.geometry.straightness_tangential_um,
        ),
    )
    for key, heights, values in tables:
        if values and (len(values) != 3 or any(len(row) != len(heights) for row in values) or len(heights) < 4):
            raise InputError(
                f"needs three lists as long as its heights, {len(heights)}, and at least 4",
                where=f"{rig.source} key {key}",
                fix="give one value per height and leg",
            )
    _check_moment(rig.tracker, "knock", ("knock_um", "knock_mrad"), rig.source)
    _check_moment(rig.drive, "slip", ("slip_mm",), rig.source)
    _check_moment(rig.arm, "slip", ("slip_mrad",), rig.source)
    _check_kind(rig)


def _check_moment(section: schema.Section, what: str, sizes: tuple[str, ...], source: str) -> None:
    """Refuse what happens once in a run at two moments, and of some size at none."""
    moments = [key for key in (f"{what}_row", f"{what}_time_s") if key in type(section).model_fields]
    given = [key for key in moments if getattr(section, key) is not None]
    place = f"{source} key {type(section).__name__.lower()}"
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)} are both given", where=place, fix="keep one of them")
    for key in sizes:
        if any(getattr(section, key)) and not given:
            raise InputError(f"{key} without a moment never happens", where=place, fix=f"give {' or '.join(moments)}")


def _check_kind(rig: Rig) -> None:
    """Refuse faults of the other mechanism, and lists that do not fit the arm."""
    foreign = ("arm",) if rig.serial is None else SLIDERS_ONLY
    empty = _Document(machine="")
    for name in foreign:
        if getattr(rig, name) != getattr(empty, name):
            own = "; a serial arm has its faults under [arm]" if rig.serial else ""
            kind = f"the machine is of kind {rig.machine.machine.kind!r}"
            raise InputError(
                f"{kind}, which has no such faults{own}", where=f"{rig.source} key {name}", fix="remove it"
            )
    _check_odd(rig)
    if rig.serial is None:
        return
    if rig.tracker.datum_every:
        raise InputError(
            "an arm has no datum pose to visit",
            where=f"{rig.source} key tracker.datum_every",
            fix="put the pose into the targets with role 'datum'",
        )
    for key, what in (
        ("moving", "an arm is read at standstill only"),
        ("report_force", "the joints of an arm report no torques"),
        ("report_direction", "the joints of an arm report no directions"),
    ):
        if getattr(rig.conditions, key):
            raise InputError(what, where=f"{rig.source} key conditions.{key}", fix="remove it")
    joints = len(rig.serial.joint)
    for key, value in rig.arm:
        if isinstance(value, tuple) and key != "reflector_mm" and len(value) not in (0, joints):
            raise InputError(
                f"{len(value)} values for an arm of {joints} joints",
                where=f"{rig.source} key arm.{key}",
                fix="give one value per joint, 0 for a sound one",
            )
    if bool(rig.arm.com_mm) and not rig.arm.mass_kg:
        what = "centres of mass without masses"
        raise InputError(what, where=f"{rig.source} key arm.com_mm", fix="give arm.mass_kg, too")
    harmonics = [[len(row) for row in table] for table in (rig.arm.ring_urad, rig.arm.ring_phase_rad)]
    if len({length for row in harmonics for length in row}) > 1 or len(harmonics[0]) < len(harmonics[1]):
        raise InputError(
            "every joint needs as many harmonics as the others, and phases as many as sizes",
            where=f"{rig.source} key arm.ring_urad",
            fix="give lists of one length, 0 for a harmonic that is not there",
        )


def _check_odd(rig: Rig) -> None:
    """Refuse kinds of the other mechanism, and joints that an arm has not."""
    joints = 0 if rig.serial is None else rig.serial.joints
    for number, fault in enumerate(rig.odd, 1):
        place = f"{rig.source} key odd[{number}]"
        if isinstance(fault, OfArm) == (rig.serial is None):
            what = f"'{fault.kind}' is not a fault of a machine of kind {rig.machine.machine.kind!r}"
            raise InputError(what, where=place, fix="remove it")
        for key in ("joint", "other"):
            if (getattr(fault, key, None) or 0) > joints > 0:
                what = f"{key} {getattr(fault, key)} of an arm of {joints} joints"
                raise InputError(what, where=place, fix=f"name one from 1 to {joints}")
        for name in fault.variables if isinstance(fault, ArmLaw) else ():
            if not _ARM_VARIABLE.fullmatch(name) or (name[-1].isdigit() and int(name[-1]) > joints):
                what = f"an arm of {joints} joints has no variable '{shown(name)}'"
                raise InputError(what, where=place, fix="use q1.., direction1.., x, y, z, payload, temperature or time")


def _explain(error: pydantic.ValidationError, where: str) -> InputError:
    """Turn the first of pydantic's findings into one line."""
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
