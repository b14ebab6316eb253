"""`ptt iso`: ISO 230-2 figures of axis runs, ISO 9283 figures of a tracker run."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ptt.commands.common import (
    Also,
    Effects,
    Json,
    Map,
    Set,
    Targets,
    parse_settings,
    refuse_idle,
    show,
)

if TYPE_CHECKING:
    from ptt.judge.iso.figures import IsoPoses
    from ptt.machine import MachineFile
    from ptt.run.table import Table

SHOWN_GROSS = 5  # gross readings that are listed, at most


def iso(
    run: Annotated[
        Path,
        typer.Argument(metavar="RUN.csv", help="Tracker run, or axis runs with direction, target_mm, measured_mm."),
    ],
    model: Annotated[
        Path | None, typer.Option("--model", metavar="M", help="machine.toml or compensator folder.")
    ] = None,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    any_direction: Annotated[
        bool, typer.Option(help="Do not distinguish the directions of approach to a pose.")
    ] = False,
    json: Json = False,
) -> None:
    """Compute ISO 230-2 figures of an axis, or ISO 9283 figures of poses measured repeatedly."""
    from ptt.errors import TableError
    from ptt.judge.iso.figures import IsoAxes, is_axis_file, iso_of_poses, read_axis_figures

    if effects:  # not needed, but a file that cannot be loaded is refused
        from ptt.effects.registry import library

        library(*effects)
    result: IsoAxes | IsoPoses
    if is_axis_file(run):
        idle = {"--also": also, "--targets": targets, "--set": set_, "--map": map_, "--any-direction": any_direction}
        refuse_idle(idle, "does not apply to axis runs, which hold only targets and readings", "leave it out")
        result = read_axis_figures(run)
    else:
        reading = {"also": also or (), "targets": targets, "set_values": parse_settings(set_ or []), "mapping": map_}
        table, file = _run_table(run, model, reading)
        per_run = file is not None and file.tracker.frame == "fitted-per-run"
        try:
            result = iso_of_poses(table, per_run, not any_direction, file)
        except TableError as error:
            raise type(error)(error.what, where=error.where or table.source, fix=error.fix) from error
    show(result.to_dict(), _text(result.to_dict()), json)


def _run_table(run: Path, model: Path | None, reading: dict[str, Any]) -> "tuple[Table, MachineFile | None]":
    """The run, with targets from its commands where it has none, and the machine."""
    from ptt.run.reading import read_table

    if model is None:
        return read_table(run, None, **reading), None
    from ptt.correct.training.machine_of import machine_of
    from ptt.run.wanted import placed

    file = machine_of(model)
    spec = file.machine
    table = read_table(run, joints=spec.joints, joint_prefix=spec.letter, ends=spec.travel_ends, **reading)
    return placed(file, table), file


def _text(figures: dict[str, Any]) -> str:
    """The figures as a person reads them, um."""
    return "\n".join(_axes_lines(figures) if "axes" in figures else _pose_lines(figures))


def _axes_lines(figures: dict[str, Any]) -> list[str]:
    lines = []
    for axis in figures["axes"]:
        lines.append(
            f"{axis['axis']}: {axis['standard']}, {len(axis['targets'])} targets, {axis['runs']} runs each way"
        )
        lines.append(f"  {'um':<30}{'up':>12}{'down':>12}{'both':>12}")
        for name, key in (("repeatability R", "R_um"), ("systematic deviation E", "E_um"), ("accuracy A", "A_um")):
            lines.append(f"  {name:<30}" + "".join(_cell(axis[key][way]) for way in ("up", "down", "both")))
        for name, key in (("reversal B", "B_um"), ("mean reversal", "B_mean_um"), ("mean deviation M", "M_um")):
            lines.append(f"  {name:<30}{'':>24}{_cell(axis[key])}")
    return lines


def _pose_lines(figures: dict[str, Any]) -> list[str]:
    from ptt.judge.iso.pose_figures import named_figures

    after = figures["aligned"]
    lines = [
        f"{figures['standard']}: {len(after['poses'])} poses repeated, {after['single_poses']} measured once left out",
        f"  {'um':<30}{'mean':>12}{'worst':>12}",
    ]
    for name, pair in named_figures(figures):
        mean, worst = (pair["mean"], pair["worst"]) if pair else (None, None)
        lines.append(f"  {name:<30}{_cell(mean)}{_cell(worst)}")
    if after["AD_um"]:
        lines.append("AD and RD are of the distances from each pose to the next one")
    return lines + _gross_lines(figures)


def _gross_lines(figures: dict[str, Any]) -> list[str]:
    """Gross readings, which count all the same, and the figures without them."""
    if not figures["gross"]:
        return []
    named, rest = figures["gross"][:SHOWN_GROSS], len(figures["gross"]) - SHOWN_GROSS
    rows = f"{', '.join(named)}{f' and {rest} more' if rest > 0 else ''}"
    told = figures["without_gross"]
    if told is None:
        return [f"gross readings count, as the standard has it: {rows}; without them no pose was measured twice"]
    pairs = [(name, told[key]) for name, key in (("RP", "RP_um"), ("AP, aligned,", "AP_um"))]
    would = " and ".join(f"{name} {pair['mean']:.1f} (worst {pair['worst']:.1f})" for name, pair in pairs)
    return [f"gross readings count, as the standard has it: {rows}; without them {would} um"]


def _cell(value: float | None) -> str:
    return f"{'-':>12}" if value is None else f"{value:12.1f}"
