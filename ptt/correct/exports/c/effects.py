"""Translation of a model's effects into calls of fixed C functions with tables of parameters."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib.resources import files

import numpy as np
import torch

from ptt.correct.exports.c.numbers import table
from ptt.correct.terms import split_terms
from ptt.effects import Effect
from ptt.effects.joint_error_map import FAST, SLOW
from ptt.effects.layout import sizes
from ptt.effects.reversal import gap_of
from ptt.effects.shapes import FINE, KNOTS, SHAPES, curve_pieces, wavy_pieces
from ptt.machine import MachineFile
from ptt.model.model import Model

PIECES, FINE_PIECES = KNOTS - 1, FINE * (KNOTS - 1)
AHEAD = (
    "its shift follows the velocity, which `ptt predict` takes from the rows on both sides; commands made one by one "
    "do not know the rows ahead: use the lags in the controller's velocity feed-forward"
)
OWN = "an effect of your own: there is no C code for it"
SECOND = "one of its kind is in the code already, and the memories of two do not add up"
STRAIGHT = "the arm's joints reverse within straight moves; only `ptt predict` finds where"
SMOOTH_WAY = "joints reverse between rows on a smooth path; only `ptt predict` finds where"


@dataclass(frozen=True)
class Parts:
    """A model's effects as C.

    Attributes:
        tables: parameters.
        functions: text of the fixed functions that are called.
        calls: stage -> lines that call them.
        needs: what they need: 'drawing' (Jacobian and pose), 'force', or 'use NAME' for a function.
        gap: (k,) backlash of each joint, mm or rad.
        waits: whether a reversal has an effect only once the backlash is taken up (play operator).
        windup: (2, k) height and length of each joint's wind-up; None without.
        chain: (k, 5) Denavit-Hartenberg errors of an arm's links; None without.
        cannot: key of an effect without C code -> why.
    """

    tables: str = ""
    functions: str = ""
    calls: dict[str, list[str]] = field(default_factory=lambda: {"drive": [], "geometry": [], "structure": []})
    needs: frozenset[str] = frozenset()
    gap: np.ndarray | None = None
    waits: bool = True
    windup: np.ndarray | None = None
    chain: np.ndarray | None = None
    cannot: dict[str, str] = field(default_factory=dict)

    @property
    def reverses(self) -> bool:
        """Whether the code has path-dependent effects."""
        return self.gap is not None or self.windup is not None


@dataclass(frozen=True)
class Fragment:
    """One fixed function.

    Attributes:
        text: C.
        needs: what it needs, as in `Parts`.
        uses: names of other fragments that it calls.
    """

    text: str
    needs: frozenset[str]
    uses: tuple[str, ...]


def kernel(name: str) -> str:
    """The text of a file of fixed C."""
    return files("ptt.correct.exports.c").joinpath("kernel", name).read_text(encoding="utf-8")


@lru_cache(maxsize=4)
def fragments(kind: str) -> dict[str, Fragment]:
    """Fixed functions of the effects of a mechanism family, by effect.

    Args:
        kind: mechanism family.

    Returns:
        Name -> fragment.
    """
    found: dict[str, Fragment] = {}
    for name in (
        ("effects_three_ptt.c.in",) if kind == "three-ptt" else ("effects_three_ptt.c.in", "effects_serial.c.in")
    ):
        for head, body in re.findall(r"/\*: (.*?) \*/\n(.*?)(?=/\*: |\Z)", kernel(name), re.S):
            words = head.split()
            said = dict(word.split("=") for word in words[1:])
            needs = frozenset(said["needs"].split(",")) if "needs" in said else frozenset[str]()
            found[words[0]] = Fragment(body, needs, tuple(said.get("uses", "").split(",")) if "uses" in said else ())
    found["spline"] = Fragment(kernel("spline.c.in"), frozenset(), ())
    return found


def parts_of(model: Model) -> Parts:
    """Translate the effects that commands correct into tables and calls.

    Args:
        model: effects with their parameters.

    Returns:
        The parts, and which effects are not among them.
    """
    steady, reversing, _ = split_terms(model)
    parts = Parts()
    for index, (effect, theta) in enumerate(steady):
        parts = _steady(parts, effect, theta.numpy(), model.file, index)
    for effect, theta in reversing:
        parts = _reversing(parts, effect, theta.numpy(), model.file)
    return replace(parts, functions=_functions(parts, model.file.machine.kind))


def _steady(parts: Parts, effect: Effect, theta: np.ndarray, file: MachineFile, index: int) -> Parts:
    kind, joints = file.machine.kind, file.machine.joints
    if effect.name == "dh-offsets":
        errors = theta.reshape(5, joints).T * _slots(file)
        return replace(parts, chain=errors if parts.chain is None else parts.chain + errors)
    name = "homing-offset" if effect.name == "homing-slip" else effect.name
    fragment = fragments(kind).get(name)
    if fragment is None or name.startswith("_"):
        why = AHEAD if name == "following-error" else OWN
        return replace(parts, cannot=parts.cannot | {effect.key: why})
    arguments, text = _arguments(effect, theta, joints, f"ptt_t{index}")
    out = "g" if effect.stage == "geometry" else "d"
    parts.calls[effect.stage].append(
        f"    {name.replace('-', '_')}({arguments}, s, {out}); /* {_plain(effect.key)} */\n"
    )
    needs = parts.needs | fragment.needs | {f"use {name}"}
    return replace(parts, tables=parts.tables + text, needs=needs)


def _arguments(effect: Effect, theta: np.ndarray, joints: int, name: str) -> tuple[str, str]:
    """Arguments of an effect's function, and its tables as C text."""
    note = _plain(effect.key)
    cut = np.split(theta, np.cumsum(sizes(effect, joints))[:-1])
    if effect.name == "screw-error-map":
        curve, straight, fine, low, high = (part.reshape(joints, -1) for part in cut)
        pieces = [wavy_pieces(*leg) for leg in zip(curve, straight, fine, strict=True)]
        ends = np.concatenate([low, high], axis=1)
        return f"{name}, {name}_range", table(name, pieces, note=note) + table(f"{name}_range", ends)
    if effect.name == "guide-straightness":
        curves, (straight, low, high) = cut[:-3], cut[-3:]
        lines = straight.reshape(joints, len(curves), 2)
        pieces = [
            curve_pieces(curve.reshape(joints, SHAPES)[leg], lines[leg, number])
            for number, curve in enumerate(curves)
            for leg in range(joints)
        ]
        ends = np.stack([low, high], axis=1)
        return f"{name}, {name}_range", table(name, pieces, note=note) + table(f"{name}_range", ends)
    if effect.name == "joint-error-map":
        waves = np.stack(
            [np.concatenate([part.reshape(joints, -1) for part in cut[start::2]], axis=1) for start in (0, 1)]
        )
        return name, table(name, np.moveaxis(waves, 0, -1), note=note)
    return name, table(name, theta, note=note)


def _reversing(parts: Parts, effect: Effect, theta: np.ndarray, file: MachineFile) -> Parts:
    if file.machine.moves == "straight" and file.machine.kind == "serial":
        why = STRAIGHT
    elif file.machine.moves == "smooth":
        why = SMOOTH_WAY
    elif effect.name == "backlash" and parts.gap is None:
        gap, waits = gap_of(torch.as_tensor(theta))
        return replace(parts, gap=gap.numpy(), waits=waits)
    elif effect.name == "windup" and parts.windup is None:
        return replace(parts, windup=theta.reshape(2, -1))
    else:
        why = SECOND if effect.name in ("backlash", "windup") else OWN
    return replace(parts, cannot=parts.cannot | {effect.key: why})


def _slots(file: MachineFile) -> np.ndarray:
    """Mask (k, 5) of an arm's link errors: the Hayati angle exists between parallel axes only."""
    from ptt.mechanisms import build_mechanism
    from ptt.mechanisms.serial import Serial

    arm = build_mechanism(file.machine)
    assert isinstance(arm, Serial)
    mask = np.ones((arm.joints, 5))
    mask[:, 4] = arm.parallel_axes()
    return mask


def _functions(parts: Parts, kind: str) -> str:
    """Text of the functions that are called, each after those that it uses."""
    known = fragments(kind)
    wanted: list[str] = []

    def take(name: str) -> None:
        for used in known[name].uses:
            take(used)
        if name not in wanted:
            wanted.append(name)

    for need in sorted(parts.needs):
        if need.startswith("use "):
            take(need.removeprefix("use "))
    text = "".join(known[name].text for name in wanted)
    return (
        text.replace("@PIECES@", str(PIECES))
        .replace("@FINE_PIECES@", str(FINE_PIECES))
        .replace("@HARMONICS@", str(SLOW + FAST))
    )


def _plain(text: str) -> str:
    return "".join(c if c.isalnum() or c in "-_[] ." else "?" for c in text)


def stage_functions(calls: dict[str, list[str]], stages: Sequence[str]) -> str:
    """C functions of the stages.

    Args:
        calls: stage -> lines.
        stages: which of them.

    Returns:
        C text.
    """
    text = ""
    for stage in stages:
        out = "g" if stage == "geometry" else "d"
        lines: Sequence[str] = calls[stage] or ["    (void)s;\n", f"    (void){out};\n"]
        text += f"static void ptt_{stage}(const ptt_seen *s, double *{out})\n{{\n{''.join(lines)}}}\n\n"
    return text
