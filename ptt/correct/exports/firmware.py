"""Common part of the exports for printer firmware: fit a delta, write it, judge the written figures."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ptt.correct.exports.delta import Delta, fit_delta, require_anticlockwise
from ptt.correct.exports.format import LEAST_UM, NOTHING_TO_GAIN, USELESS, ErrorLeft, Options, Written, said_held
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import cannot_hold, network_note
from ptt.correct.exports.left import WorkspaceSample, error_left, holdings, left_of_drawing, sample_workspace
from ptt.correct.exports.whole import write_all
from ptt.errors import InputError

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

SHAPE = "all towers stand upright at one radius, and their sliders have no tables"
WORSE = 1.0  # um: a format that is worse than the drawing by less is not refused
MEASURE = "then home, measure again and see `ptt evaluate BEFORE.csv AFTER.csv`"

Printed = Callable[[Delta, WorkspaceSample], tuple[list[str], Delta]]


@dataclass(frozen=True)
class Firmware:
    """A firmware and its limits.

    Attributes:
        name: of the firmware.
        comment: what begins a comment.
        lines: delta -> the lines of the file, and the delta with the figures rounded as written.
        load: how to load the file.
        scale: how to correct the travel per step of each slider, to precede the factors.
        tilted: whether it has a tilt of the bed.
        anticlockwise: whether its towers must be numbered anticlockwise.
    """

    name: str
    comment: str
    lines: Printed
    load: str
    scale: str
    tilted: bool = False
    anticlockwise: bool = False


def write_delta(compensator: "Compensator", out: Path, options: Options, firmware: Firmware) -> Written:
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
    sample = sample_workspace(compensator, options)
    delta, tangent = fit_delta(sample, tilted=firmware.tilted)
    file = compensator.model.file
    if firmware.anticlockwise:
        require_anticlockwise(delta, firmware.name, file.source)
    lines, printed = firmware.lines(delta, sample)
    left = error_left(sample, printed.sliders(sample.targets))
    refuse_worse(left, firmware.name, file.source)
    why = cannot_hold(sample, tangent, SHAPE, hints=_hints(sample, firmware))
    holds, cannot = holdings(sample, why)
    shape = left_of_drawing(
        sample, options, lambda bare: fit_delta(bare, tilted=firmware.tilted)[0].sliders(bare.targets)
    )
    notes = what_to_do(f"{firmware.load}; {MEASURE}", left, shape=shape)
    told = [*head_lines(compensator, options), *judged(left, holds, [item.effect for item in cannot]), *notes]
    text = "\n".join([*(f"{firmware.comment} {line}" for line in told), *lines]) + "\n"
    return Written(write_all({out: text}), holds, cannot, left, (*notes, *network_note(sample)))


def _hints(sample: WorkspaceSample, firmware: Firmware) -> dict[str, str]:
    """Advice for effects that the delta cannot hold but another setting of the firmware can."""
    scale = [term.theta for term in sample.compensator.model.terms if term.effect.name == "lead-scale"]
    if not scale:
        return {}
    factors = ", ".join(f"{1.0 + float(value):.6f}" for value in sum(scale[1:], scale[0]))
    again = "home, measure again and refit instead of loading this file"
    return {"lead-scale": f"first {firmware.scale} {factors}, {again}"}


def what_to_do(load: str, left: ErrorLeft, *, arm: bool = False, shape: float = 0.0) -> tuple[str, ...]:
    """Advice on a file: load it, or a better alternative.

    Args:
        load: how it is loaded.
        left: its remaining error.
        arm: whether it is a serial arm's, whose programs do not state the posture and are not corrected.
        shape: error of the format for the machine as drawn, um: if not zero, the controller does not compute the
            drawing, and corrected programs do not suit it either.

    Returns:
        One line each; at least one, and a second is an alternative to the first.
    """
    programs = "" if arm else "correct each program with `ptt program`, or "
    whole = f"send what `ptt predict` or --to c works out: the whole model leaves {left.model:.1f} um"
    model = f"keep the drawing's figures in the controller and {programs}{whole}"
    if shape >= LEAST_UM:
        load += (
            f"; for a machine exactly as drawn it would leave {shape:.1f} um: it cannot represent leaning rails or "
            "uneven azimuths"
        )
        model = f"{whole} (`ptt program` needs a controller that computes the drawing, which this one cannot)"
    if left.corrects:
        return (load, f"or, instead of this file, {model}") if left.gains else (load,)
    return (f"{USELESS}; {model}",) if left.gains else (NOTHING_TO_GAIN,)


def judged(left: ErrorLeft, holds: tuple[str, ...], cannot: list[str]) -> list[str]:
    """Lines of a file's head about its error."""
    return [
        f"error over the workspace, rms: drawing {left.drawing:.1f} um, this file {left.format:.1f} um,"
        f" whole model {left.model:.1f} um",
        f"holds {said_held(holds, cannot, left)}",
        *([f"cannot hold {', '.join(cannot)}"] if cannot else []),
    ]


def refuse_worse(left: ErrorLeft, name: str, source: str) -> None:
    """Refuse a format with a larger error than the unchanged drawing.

    Args:
        left: what it leaves.
        name: of the format.
        source: the machine file.

    Raises:
        InputError: leaning rails or uneven azimuths of the drawing itself have no place in it.
    """
    if left.format > left.drawing + WORSE or not np.isfinite(left.format):
        raise InputError(
            f"{name} cannot express this drawing (leaning rails or uneven azimuths): it would miss by"
            f" {left.format:.0f} um, the unchanged drawing by {left.drawing:.0f} um",
            where=source,
            fix="take --to c, onnx, siemens or table",
        )


def reach_of(sample: WorkspaceSample) -> tuple[float, float]:
    """Largest distance of the targets from the z axis, rounded up, and their least z, rounded down, mm."""
    return float(np.ceil(np.hypot(*sample.targets[:, :2].T).max())), float(np.floor(sample.targets[:, 2].min()))
