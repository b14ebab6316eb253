"""What the exports for printer firmware share: fit a delta, print it, judge what was printed."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ptt.correct.exports.delta import Delta, fit_delta, require_anticlockwise
from ptt.correct.exports.format import ErrorLeft, Exported, Options
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import cannot_hold, network_note
from ptt.correct.exports.left import Ground, error_left, holdings, survey
from ptt.correct.exports.whole import write_all
from ptt.errors import InputError

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

SHAPE = "all towers stand upright at one radius, and their sliders have no tables"
WORSE = 1.0  # um: less than this is no reason to refuse a format that says a little less than the drawing
HINTS = {"lead-scale": "divide each slider's steps per mm by 1 + its scale instead, and export again without it"}

Printed = Callable[[Delta, Ground], tuple[list[str], Delta]]


@dataclass(frozen=True)
class Firmware:
    """One firmware.

    Attributes:
        name: of the firmware.
        comment: what begins a comment.
        lines: delta -> the lines of the file, and the delta that they stand for, figures rounded.
        tilted: whether it has a tilt of the bed.
        anticlockwise: whether its towers must go round anticlockwise.
    """

    name: str
    comment: str
    lines: Printed
    tilted: bool = False
    anticlockwise: bool = False


def write_delta(compensator: "Compensator", out: Path, options: Options, firmware: Firmware) -> Exported:
    """Fit the delta of a firmware to a model and write it.

    Args:
        compensator: the model.
        out: the file.
        options: what the user said.
        firmware: whose.

    Returns:
        What was written, and what it leaves.

    Raises:
        InputError: the machine is none that this firmware can drive.
    """
    ground = survey(compensator, options)
    delta, tangent = fit_delta(ground, tilted=firmware.tilted)
    file = compensator.model.file
    if firmware.anticlockwise:
        require_anticlockwise(delta, firmware.name, file.source)
    lines, printed = firmware.lines(delta, ground)
    left = error_left(ground, printed.sliders(ground.targets))
    refuse_worse(left, firmware.name, file.source)
    why = cannot_hold(ground, tangent, SHAPE, hints=HINTS)
    holds, cannot = holdings(ground, why)
    told = [*head_lines(compensator, options), *judged(left, holds, [item.effect for item in cannot])]
    text = "\n".join([*(f"{firmware.comment} {line}" for line in told), *lines]) + "\n"
    return Exported(write_all({out: text}), holds, cannot, left, network_note(ground))


def judged(left: ErrorLeft, holds: tuple[str, ...], cannot: list[str]) -> list[str]:
    """What the head of a file says of the error, one line each."""
    return [
        f"error over the workspace, rms: drawing {left.drawing:.1f} um, this file {left.format:.1f} um,"
        f" whole model {left.model:.1f} um",
        f"holds {', '.join(holds) or 'no effect'}; cannot hold {', '.join(cannot) or 'none'}",
    ]


def refuse_worse(left: ErrorLeft, name: str, source: str) -> None:
    """Refuse a format that would miss by more than the drawing does.

    Args:
        left: what it leaves.
        name: of the format.
        source: the machine file.

    Raises:
        InputError: leaning rails or uneven azimuths of the drawing itself have no place in it.
    """
    if left.format > left.drawing + WORSE or not np.isfinite(left.format):
        raise InputError(
            f"{name} cannot say this drawing (rails that lean, azimuths that are uneven): it would miss by"
            f" {left.format:.0f} um, the drawing as it is by {left.drawing:.0f} um",
            where=source,
            fix="take --to c, onnx or table, or correct the programs: ptt program",
        )


def reach_of(ground: Ground) -> tuple[float, float]:
    """Largest distance of the places from the middle, and their least height, whole mm outwards."""
    return float(np.ceil(np.hypot(*ground.targets[:, :2].T).max())), float(np.floor(ground.targets[:, 2].min()))
