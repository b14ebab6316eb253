"""What a rig needs beyond the bounds of its single keys."""

import re

from ptt.errors import InputError, shown
from ptt.rig import schema
from ptt.rig.arm_odd_schema import ArmLaw, OfArm
from ptt.rig.rig import Rig

SLIDERS_ONLY = ("controller", "drive", "thermal", "geometry", "structure")
_ARM_VARIABLE = re.compile(r"(q|direction)[1-7]|[xyz]|payload|temperature|memory|time")


def check_rig(rig: Rig) -> None:
    """Refuse what no single key can show to be wrong.

    Args:
        rig: as parsed.

    Raises:
        InputError: tables of different length, an event with two times or none, faults of the other mechanism, or lists
            and joints that do not fit the arm.
    """
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
    for name in foreign:
        section = getattr(rig, name)
        if section != type(section)():
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
