"""Effects by name: the library, and those of a file that the user names."""

import difflib
import importlib.util
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from ptt.effects import (
    dh_offsets,
    drive,
    joint_error_map,
    links,
    metrology,
    reversal,
    screw,
    self_weight,
    structure,
    towers,
    twist,
)
from ptt.effects.base import STAGES, Effect
from ptt.errors import InputError, ModelError

Library = Mapping[str, type[Effect]]

_CLASSES: tuple[type[Effect], ...] = (
    drive.HomingOffset,
    drive.HomingSlip,
    screw.LeadScale,
    screw.ScrewErrorMap,
    screw.OncePerRev,
    reversal.Backlash,
    reversal.Windup,
    drive.FollowingError,
    screw.ScrewGrowth,
    drive.AxisCompliance,
    towers.TowerPosition,
    towers.TowerTilt,
    links.LinkLength,
    towers.GuideStraightness,
    links.JointOffset,
    links.JointClearance,
    links.LinkCompliance,
    twist.PlatformTwist,
    joint_error_map.JointErrorMap,
    dh_offsets.DhOffsets,
    self_weight.SelfWeight,
    structure.ColumnBend,
    structure.FrameGrowth,
    metrology.TrackerFrame,
    metrology.TrackerScale,
    metrology.TrackerDrift,
    metrology.SetupJump,
)


def classes() -> dict[str, type[Effect]]:
    """The effects of the library by the names of their classes."""
    return {cls.__name__: cls for cls in _CLASSES}


def library(*files: str | Path) -> Library:
    """All known effects.

    Args:
        files: Python files of the user's own effects, run as they are.

    Returns:
        Name -> class.

    Raises:
        InputError: a file cannot be loaded, or defines a name that is taken.
    """
    known = {cls.name: cls for cls in _CLASSES}
    for file in files:
        for name, cls in load_effects(file).items():
            if name in known:
                raise InputError(f"effect '{name}' exists already", where=str(file), fix="give it another name")
            known[name] = cls
    return MappingProxyType(known)


def load_effects(path: str | Path) -> dict[str, type[Effect]]:
    """Load the effects that a user's file defines. The file is run: name only files you trust.

    Args:
        path: Python file with subclasses of `ptt.effects.Effect`.

    Returns:
        Name -> class.

    Raises:
        InputError: the file is missing, fails, or defines no effect or an incomplete one.
    """
    where = str(path)
    if not Path(path).is_file():
        raise InputError("no such file", where=where, fix="check the path after --effects")
    spec = importlib.util.spec_from_file_location(f"ptt_own_{Path(path).stem}", path)
    if spec is None or spec.loader is None:
        raise InputError("not a Python file", where=where, fix="name a file that ends in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up there
    try:
        # Compiled here: the import system's cache would leave files behind, and miss an edit within the same second.
        exec(compile(Path(path).read_bytes(), where, "exec"), vars(module))
    except Exception as error:
        raise InputError(f"cannot be run: {type(error).__name__}: {error}", where=where, fix="mend the file") from error
    own = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Effect) and value.__module__ == module.__name__
    ]
    if not own:
        raise InputError("defines no effect", where=where, fix="`ptt effects new NAME` writes a template")
    for cls in own:
        _check_class(cls, where)
        if sum(cls.name == other.name for other in own) > 1:
            raise InputError(f"defines effect '{cls.name}' twice", where=where, fix="give one of them another name")
    return {cls.name: cls for cls in own}


def make_effect(known: Library, name: str, label: str = "") -> Effect:
    """Build an effect by name.

    Args:
        known: name -> class.
        name: the effect's name.
        label: tells two of a kind apart.

    Returns:
        The effect.

    Raises:
        ModelError: the name is not known; a near one is suggested.
    """
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        fix = (
            f"did you mean '{near[0]}'?"
            if near
            else "`ptt effects` lists them; a file of your own needs --effects FILE.py"
        )
        raise ModelError(f"effect '{name}' is not known", fix=fix)
    return known[name](label)


def parse_key(text: str) -> tuple[str, str]:
    """Cut `name[label]` into name and label.

    Args:
        text: as typed on the command line.

    Returns:
        Name and label ('' where there is none).
    """
    name, _, rest = text.partition("[")
    return name.strip(), rest.rstrip("] ").strip()


def _check_class(cls: type[Effect], where: str) -> None:
    if not cls.name:
        raise InputError(f"class {cls.__name__} has no name", where=where, fix='write name = "my-effect" in it')
    if cls.stage not in STAGES:
        raise InputError(
            f"stage '{cls.stage}' of {cls.name} is not known", where=where, fix=f"use one of {', '.join(STAGES)}"
        )
    roles = [parameter.role == "linear" for parameter in cls.parameters]
    if not any(roles) or roles != sorted(roles, reverse=True):
        raise InputError(
            f"parameters of {cls.name} need a linear one, and the linear ones first", where=where, fix="reorder them"
        )
