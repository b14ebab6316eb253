"""Effects by name: those of the library, and those of files that the user names."""

import difflib
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
from ptt.effects.base import Effect
from ptt.effects.own import load_effects, try_laws
from ptt.errors import InputError, ModelError, shown

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


def library(*files: str | Path, tried: bool = True) -> Library:
    """All known effects.

    Args:
        files: Python files of the user's own effects, run as they are.
        tried: whether the user's effects are called once on a sample run, so that faulty ones are refused here.

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
            if tried:
                try_laws(cls, str(file))
            known[name] = cls
    return MappingProxyType(known)


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
        raise ModelError(f"effect '{shown(name)}' is not known", fix=fix)
    return known[name](label)


def parse_key(text: str) -> tuple[str, str]:
    """Cut `name[label]` into name and label.

    Args:
        text: as typed on the command line.

    Returns:
        Name and label ('' where there is none).

    Raises:
        ModelError: a bracket that is opened and not closed.
    """
    name, opened, rest = text.partition("[")
    if opened and not rest.rstrip().endswith("]"):
        raise ModelError(
            f"'{shown(text)}' opens a label and does not close it", fix=f"write {shown(name.strip())}[label]"
        )
    return name.strip(), rest.rstrip("] ").strip()
