"""A run with hidden faults, and the seal on what they are; opened again to score a model against it."""

import base64
import hashlib
import io
import json
import secrets
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd

from ptt.challenge.cases import draw, plan
from ptt.challenge.truth import READINGS
from ptt.documents import parse_json
from ptt.errors import InputError
from ptt.files import read_text, write_text
from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.machine_schema import ControllerSpec
from ptt.rig import format_rig, parse_rig, simulate, write_run
from ptt.rig.draw import DrawnRig

MACHINE, RUN, TARGETS, SEAL = "machine.toml", "run.csv", "targets.csv", "sealed.json"
Level = Literal["none", "single", "multi", "unknown"]
Asked = Literal[Level, "any"]
LEVELS: tuple[Level, ...] = get_args(Level)
ROWS = 300
LEAST_ROWS = 24
MOST_SEED = 2**31
SEEDS = 2**62  # that may be given: a file holds no whole number of more than 63 bits
DIGITS = {"time_s": 3, "temp_c": 3, **{f"{axis}_meas": 4 for axis in "xyz"}}
MM_DIGITS, RAD_DIGITS = 6, 9  # of joint commands: a nanometre at the tool of either machine
NOTE = (
    "The hidden faults, packed so that nobody reads them by accident. This is not encryption: anyone who wants to can "
    "unpack it. `ptt challenge reveal` does, and scores your model."
)
BENCH = """\
# The drawing of the bench: a 3-PTT whose sliders run above the platform.
[machine]
kind = "three-ptt"
name = "bench"
base_radius_mm = 200.0
platform_radius_mm = 100.0
link_length_mm = 300.0
slider_azimuth_deg = [0.0, 120.0, 240.0]
slider_travel_mm = [150.0, 420.0]
screw_lead_mm = 5.0
reflector_mm = [0.0, 0.0, 0.0]

[tracker]
frame = "fitted"
sigma_mm = 0.004
"""


@dataclass(frozen=True)
class Challenge:
    """A run whose faults are sealed.

    Attributes:
        folder: with the machine, the run, its targets and the seal.
        level: as asked; 'any' does not tell.
        rows: of the run.
    """

    folder: Path
    level: str
    rows: int

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        files = {"machine": MACHINE, "run": RUN, "targets": TARGETS, "sealed": SEAL}
        places = {key: str(self.folder / name) for key, name in files.items()}
        return {"folder": str(self.folder), "level": self.level, "rows": self.rows, **places}


@dataclass(frozen=True)
class Sealed:
    """What the seal held.

    Attributes:
        drawn: rig, targets, faults.
        level: as drawn.
    """

    drawn: DrawnRig
    level: str


def bench() -> MachineFile:
    """The machine that challenges are drawn for: the one of the sample data, its tracker frame fitted."""
    return parse_machine(BENCH, "bench")


def new_challenge(
    folder: str | Path,
    level: Asked,
    *,
    seed: int | None = None,
    rows: int = ROWS,
    machine: MachineFile | None = None,
    foreign: bool = False,
) -> Challenge:
    """Draw a rig, run it, and seal what is wrong with it.

    Args:
        folder: made where it does not exist.
        level: 'single', 'multi' (two to five), 'unknown' (a fault outside the library, and up to two of it), 'none', or
            'any' of them.
        seed: of everything; None draws one that nobody knows.
        rows: about how many.
        machine: the drawing, of a 3-PTT or an arm; None takes the bench.
        foreign: draw the machine, its path and its tracker's noise, too.

    Returns:
        Where everything is.

    Raises:
        InputError: an unknown level, too few rows, a seed out of bounds, or a folder that holds a challenge already.
        WorkspaceError: the drawing does not reach the poses of a run.
    """
    place = Path(folder)
    if level not in (*LEVELS, "any"):
        raise InputError(
            f"level '{level}' is not known", where="--level", fix="use single, multi, unknown, none or any"
        )
    if rows < LEAST_ROWS:
        raise InputError(f"{rows} rows are too few", where="--rows", fix=f"ask for at least {LEAST_ROWS}")
    if seed is not None and not 0 <= seed < SEEDS:
        raise InputError(f"no file can hold the seed {seed}", where="--seed", fix=f"give one from 0 to {SEEDS - 1}")
    if foreign and machine is not None:
        raise InputError(
            "a drawing and a foreign machine are asked for", where="--foreign", fix="leave one of them out"
        )
    if (place / SEAL).exists():
        raise InputError("holds a challenge already", where=str(place), fix="name another folder, or remove this one")
    seed = secrets.randbelow(MOST_SEED) if seed is None else seed
    file = None if foreign else _bare(machine or bench())
    arm = file is not None and file.machine.kind == "serial"
    case = plan(draw_level(level, seed), 1, seed, rows=rows, bench=file, arm=arm)[0]
    return write_challenge(place, draw(case)[0], level)


def draw_level(level: Asked, seed: int) -> Level:
    """The level itself, or, where any will do, the one that the seed chooses."""
    return LEVELS[np.random.default_rng([seed, 31]).integers(len(LEVELS))] if level == "any" else level


def write_challenge(folder: str | Path, drawn: DrawnRig, level: str) -> Challenge:
    """Write the machine, a run, its targets and the seal; the same rig gives the same bytes.

    Args:
        folder: made where it does not exist; what is there is replaced.
        drawn: rig, targets, faults.
        level: for the seal.

    Returns:
        Where everything is.
    """
    place = Path(folder)
    rig = drawn.rig
    digits = dict.fromkeys(rig.commanded, MM_DIGITS if rig.serial is None else RAD_DIGITS)
    frame = simulate(rig, drawn.targets).frame.round(DIGITS | digits).drop(columns=[*drawn.absent])
    # An arm reaches a place in many postures: its commands are part of what is wanted.
    hidden = [*READINGS, *(rig.commanded if rig.serial is None else ())]
    write_text(place / MACHINE, format_machine(rig.machine))
    write_run(frame, place / RUN)
    write_run(frame[frame["role"] != "base"].drop(columns=hidden), place / TARGETS)
    write_text(place / SEAL, seal(drawn, level))
    return Challenge(place, level, len(frame))


def seal(drawn: DrawnRig, level: str) -> str:
    """Pack a rig and what is hidden in it.

    Args:
        drawn: rig, targets, faults.
        level: as drawn.

    Returns:
        JSON text that `unseal` reads back.
    """
    content = {
        "level": level,
        "protocol": drawn.protocol,
        "truth": drawn.truth,
        "rig": format_rig(drawn.rig),
        "targets": drawn.targets.to_csv(index=False, lineterminator="\n"),
    }
    packed = zlib.compress(json.dumps(content, sort_keys=False).encode(), 9)
    text = base64.b64encode(packed).decode()
    whole = {"note": NOTE, "format": 1, "sha256": hashlib.sha256(packed).hexdigest(), "sealed": text}
    return json.dumps(whole, indent=2) + "\n"


def unseal(text: str, where: str = SEAL) -> Sealed:
    """Open a seal.

    Args:
        text: as `seal` wrote it.
        where: name of the file for messages.

    Returns:
        What it held.

    Raises:
        InputError: not a seal, or changed since it was made.
    """
    try:
        whole = parse_json(text, where)
        packed = base64.b64decode(whole["sealed"], validate=True)
        digest = whole["sha256"]
    except (InputError, KeyError, TypeError, ValueError):  # ValueError: not in base64
        raise InputError("not a sealed challenge", where=where, fix="`ptt challenge new` makes one") from None
    if hashlib.sha256(packed).hexdigest() != digest:
        raise InputError(
            "was changed since it was sealed", where=where, fix="fetch it again, or draw another challenge"
        )
    content = json.loads(zlib.decompress(packed))
    targets = pd.read_csv(io.StringIO(content["targets"]), keep_default_na=False)
    drawn = DrawnRig(parse_rig(content["rig"], where), targets, content["truth"], content["protocol"])
    return Sealed(drawn, content["level"])


def open_challenge(folder: str | Path) -> Sealed:
    """Open the seal of a challenge.

    Args:
        folder: of the challenge.

    Returns:
        What it held.

    Raises:
        InputError: no challenge there, or a broken seal.
    """
    path = Path(folder) / SEAL
    if not path.exists():
        raise InputError("holds no challenge", where=str(folder), fix="`ptt challenge new` makes one")
    return unseal(read_text(path), str(path))


def _bare(file: MachineFile) -> MachineFile:
    """The drawing alone: a rig has no fitted effects, and its controller compensates nothing."""
    bare = replace(file, effect=(), history=())
    return bare if bare.controller == ControllerSpec() else replace(bare, controller=ControllerSpec(), text="")
