"""The commented file that a user's own effect starts from."""

import re

from ptt.effects.registry import library
from ptt.errors import InputError

RESERVED = ("new", "check", "atlas")

_TEXT = '''"""An effect of your own: use it with --effects FILE.py; test it with ptt effects check FILE.py."""

import torch

from ptt.effects import Effect, Parameter  # and Phrase, for words


class {class_name}(Effect):
    """Say the physical cause here in one line.

    Then the equation; this one is dp = (a, b, 0) (mean(q) - q0): something pulls sideways, more at greater height.
    """

    name = "{name}"
    # Where the shift is added, and its shape. "drive": (n, k) at the joints, mm or rad. "geometry": (n, slots) of the
    # mechanism, mm. "structure": (n, 3) mm at the tool. "metrology": (n, 3) mm of the reading, never compensated.
    stage = "structure"
    mechanisms = ("three-ptt",)  # and "serial", where it fits an arm
    # least_joints = 5  # that an arm has to have, where it names the fourth joint or a later one
    # Stem, unit (of mm, rad, s, K, kg, N; "1" for none), usual size, meaning; per_joint=True: one value for each joint;
    # count: so many values. lower, upper: physical bounds only.
    parameters = (Parameter("pull", "1", 1e-4, "sideways shift per mm of height, x and y", count=2),)
    requires = ()  # contexts that must vary in the data: "payload", "temperature", "time", "speed", "direction"
    # What a value above and one below zero means, for the words of a diagnosis; who: the subject where it is no joint.
    # phrases = (Phrase("pull", "pulls {{what}} toward +{{axis}}", "pulls {{what}} toward -{{axis}}", "the hose"),)
    # reverses = True  # where it depends on the way a joint came
    # follows_clock = True  # where it follows time or temperature

    def basis(self, view, shape):
        """Shift per unit of each parameter, (n, 3, 2)."""
        # view.q joints (n, k), view.p tool (n, 3), view.payload kg, view.warmth K, view.time s, view.velocity,
        # view.direction; use torch functions of these only, so that it can be differentiated.
        height = (view.q - view.home).mean(dim=1)
        return height[:, None, None] * torch.eye(3, 2, dtype=torch.float64)
'''


def template(name: str) -> str:
    """Text of a working effect that the user changes into their own.

    Args:
        name: its name, lower case words joined by hyphens.

    Returns:
        Python source.

    Raises:
        InputError: the name is taken, or is not such a name.
    """
    require_free_name(name)
    return _TEXT.format(name=name, class_name=class_name(name))


def require_free_name(name: str) -> None:
    """Refuse a name that a user's effect may not have.

    Args:
        name: to be checked.

    Raises:
        InputError: it is taken, or is not of lower case words joined by hyphens.
    """
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        raise InputError(f"'{name}' is not a name for an effect", fix="use lower case words and hyphens, as cable-drag")
    if name in library() or name in RESERVED:
        raise InputError(f"the name '{name}' is taken", fix="give it another name")


def class_name(name: str) -> str:
    """Python class for an effect's name: CableDrag for cable-drag."""
    return "".join(word.capitalize() for word in name.split("-"))
