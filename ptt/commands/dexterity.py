"""`ptt dexterity`: condition number, manipulability, singularities."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ptt.commands.common import Json, Map, ReadOptions, note, read_rows, show

if TYPE_CHECKING:
    from ptt.machine import MachineFile
    from ptt.run.table import Table

SHOWN_ROWS = 12  # targets without status 'ok' that are listed, at most
RARE = 0.03  # share of random walks below which a family of singularities is not listed: a crossing of others


def dexterity(
    machine: Annotated[Path, typer.Argument(metavar="M.toml", help="machine.toml or compensator folder.")],
    targets: Annotated[
        Path | None, typer.Option("--targets", metavar="T.csv", help="Tool positions or joint values to examine.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE.png", help="Condition number over x and y at three heights.")
    ] = None,
    map_: Map = None,
    json: Json = False,
) -> None:
    """Show how evenly the tool moves in all directions, and how far it is from each kind of singularity."""
    import torch

    from ptt.door.model import load
    from ptt.mechanisms.dexterity_report import describe_dexterity

    file = load(machine).file
    table = None if targets is None else _in_base(file, targets, ReadOptions(map_=map_, json=json))
    poses = () if table is None else (table.target, table.command)
    data = describe_dexterity(file, *(None if each is None else torch.tensor(each) for each in poses))
    if table is not None:
        for entry, line, name in zip(data["targets"], table.line, table.name, strict=True):
            entry |= {"line": int(line), "name": str(name)}
    if plot is not None:
        from ptt.show.plots.common import save
        from ptt.show.plots.workspace import draw_dexterity

        save(draw_dexterity(file.machine), plot)
        note(f"picture in {plot}")
    show(data, _text(data), json)


def _in_base(file: "MachineFile", targets: Path, reading: ReadOptions) -> "Table":
    """Targets in the base frame, in which the mechanism stands; base reflectors are none."""
    import numpy as np

    from ptt.door.predicting import note_frames
    from ptt.run.table import take_rows
    from ptt.run.target_frame import in_base, target_frames

    table = read_rows(targets, file, reading, "targets")
    frames = target_frames(file, table)
    note_frames(frames, note)
    return take_rows(in_base(table, frames), np.flatnonzero(table.role != "base"))


def _text(data: dict[str, Any]) -> str:
    from ptt.mechanisms.serial_inverse import BENT_RAD

    home, space = data["home"], data["workspace"]
    where = "at home" if "inverse_mm" in home else f"every joint {BENT_RAD:g} rad above the middle of its limits"
    lines = [f"{data['machine']} ({data['kind']})", where + (":" if home["status"] == "ok" else f", {home['status']}:")]
    lines.append(f"  condition number {home['condition']:.3g}, manipulability {home['manipulability']:.3g}")
    if "inverse_mm" in home:
        lines.append(f"  determinant of db/dp {home['determinant']:.4g}")
        lines.append(
            f"  inverse singularity: {home['edge_mm']:.1f} mm away sideways; margin {home['inverse']:.2f} (0: singular)"
        )
        lines.append(
            f"  direct singularity: margin {home['direct']:.2f}; constraint: {home['constraint']:.2f} (0: singular)"
        )
        if home["direct"] == 0.0:
            lines.append("  the links lie in one plane or are parallel: locked sliders do not hold the tool")
    if space["poses"]:
        spread = space["condition"]
        lines.append(f"over the workspace, {space['poses']} poses: condition number {spread['least']:.3g} to "
                     f"{spread['largest']:.3g}, median {spread['median']:.3g}")  # fmt: skip
    if "near_singular_share" in space:
        lines.append(f"  near a singularity: {100 * space['near_singular_share']:.1f} % of them")
    lines += _arm(space) if "singular" in space else []
    return "\n".join(lines + _targets(data["targets"], turning="inverse_mm" not in home))


def _evenness(entries: list[dict[str, Any]], turning: bool) -> list[str]:
    """Median and worst condition number of targets; of an arm for the tool's position alone, without rotation."""
    from statistics import median

    if not entries:
        return []
    worst = max(entries, key=lambda entry: float(entry["condition"]))
    of = " of the position alone" if turning else ""
    middle = median(entry["condition"] for entry in entries)
    where = f"row {worst['line']} {worst['name']}".rstrip()
    return [f"  condition number{of}: median {middle:.3g}, worst {worst['condition']:.3g} ({where})"]


def _arm(space: dict[str, Any]) -> list[str]:
    """Most isotropic and singular poses of an arm; a rotation of one radian counts as its characteristic length."""
    position = space["most_isotropic_position"]
    lines = [
        f"  a turn of one radian counts as {space['length_mm']:.0f} mm",
        f"  most even pose: {space['condition']['least']:.3f} at q = {_degrees(space['most_isotropic_q'])} deg",
        f"  position alone: {position['condition']:.3f} at q = {_degrees(position['q'])} deg",
    ]
    told = [
        f"  singular by joint{'s' if len(family['joints']) > 1 else ''} {' and '.join(map(str, family['joints']))}: "
        f"{100 * family['share']:.0f} % of walks, as at q = {_degrees(family['q'])} deg"
        for family in space["singular"]
        if family["share"] >= RARE
    ]
    return lines + told


def _degrees(q: list[float]) -> str:
    from math import degrees

    return ", ".join(f"{degrees(value) + 0.0:.0f}" for value in q)


def _targets(entries: list[dict[str, Any]], turning: bool) -> list[str]:
    """Numbers of targets by status, their condition numbers, and those without status 'ok'; `turning` for an arm."""
    if not entries:
        return []
    counts = {status: sum(entry["status"] == status for entry in entries) for status in {e["status"] for e in entries}}
    lines = ["targets: " + ", ".join(f"{count} {status}" for status, count in sorted(counts.items()))]
    lines += _evenness(
        [entry for entry in entries if entry["condition"] == entry["condition"]], turning
    )  # NaN: no pose
    odd = [entry for entry in entries if entry["status"] != "ok"]
    lines += [f"  row {entry['line']} {entry['name']}: {entry['status']}" for entry in odd[:SHOWN_ROWS]]
    return [*lines, f"  and {len(odd) - SHOWN_ROWS} more"] if len(odd) > SHOWN_ROWS else lines
