"""`ptt backlash`: backlash per slider and payload from a linear-scale log."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import Json, show

if TYPE_CHECKING:
    from ptt.run.backlash.measure import BacklashResult


def backlash(
    scale: Annotated[
        Path,
        typer.Argument(metavar="LOG.csv", help="Log of a linear scale: slider, command_turns or motor_mm, scale_mm."),
    ],
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="M", help="machine.toml or compensator folder, for the screw lead."),
    ] = None,
    lead_mm: Annotated[float | None, typer.Option("--lead", metavar="MM", help="Screw lead, mm.")] = None,
    turns: Annotated[
        float | None,
        typer.Option("--turns", metavar="U", help="Motor turns in each direction, for a marked log without commands."),
    ] = None,
    resolution_um: Annotated[
        float | None, typer.Option("--resolution-um", metavar="UM", help="One count of the scale, um.")
    ] = None,
    json: Json = False,
) -> None:
    """Measure the backlash of each slider, by data length and by scale counts, for each payload."""
    from ptt.run.backlash.measure import measure_backlash
    from ptt.run.backlash.scale import read_scale_log

    lead = _lead_of(model) if lead_mm is None and model is not None else lead_mm
    resolution = None if resolution_um is None else 1e-3 * resolution_um
    result = measure_backlash(read_scale_log(scale, lead, turns, resolution))
    show(result.to_dict(), _text(result), json)


def _lead_of(model: Path) -> float | None:
    """Screw lead of a machine file, mm."""
    from ptt.correct.training.machine_of import machine_of

    return getattr(machine_of(model).machine, "screw_lead_mm", None)


def _text(result: "BacklashResult") -> str:
    """A table, one line per slider and payload."""
    titles = ("S2/S1, S2/S3", "|S1 - S3|", "gap")
    lines = [
        f"scale resolution {1e3 * result.resolution:g} um ({result.resolution_source}); um, +- one standard deviation",
        f"{'slider':>6} {'payload':>8} " + " ".join(f"{title:>16}" for title in titles) + f" {'repeat/stroke':>14}",
    ]
    for one in result.sliders:
        load = "-" if one.payload != one.payload else f"{one.payload:g} kg"
        pairs = " ".join(f"{f'{1e3 * v:.1f} +- {1e3 * s:.1f}':>16}" for v, s in (one.by_length, one.by_counts, one.gap))
        spread = "-" if len(one.positions) < 2 else f"{1e6 * one.repeatability[0]:.0f} um/m"
        lines.append(
            f"{one.slider:>6} {load:>8} {pairs} {spread:>14}{'' if one.agree else '  lengths and counts disagree'}"
        )
    if not all(r.constant_speed for one in result.sliders for r in one.reversals):
        lines.append(
            "speed not constant: the data lengths cannot be trusted, so the gap is taken from the counts there"
        )
    return "\n".join(lines)
