"""`ptt predict`: corrected commands for a list of targets."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ptt.commands.common import (
    Anyway,
    Effects,
    Json,
    Map,
    ModelPath,
    Reading,
    Set,
    check_rows,
    note,
    open_library,
    open_model,
    progress,
    read_rows,
    refuse_readings,
    show,
)

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from ptt.correct.compensate import Commands
    from ptt.run.table import Table


CANNOT_WORK = 3  # exit code: poses that cannot work
SENT = ("ok", "uncertain")
LINES_SHOWN = 5

Limit = Annotated[float, typer.Option("--limit-mm", min=0.0, help="Largest correction that is sent, mm of tool.")]


class Reversal(StrEnum):
    """Who compensates the play at a reversal: these commands, or nobody here."""

    software = "software"
    none = "none"


def predict(
    targets: Annotated[Path, typer.Argument(metavar="TARGETS.csv", help="Tool positions to reach, in travel order.")],
    model: ModelPath,
    out: Annotated[Path, typer.Option("--out", metavar="SLIDERS.csv", help="Commands to write.")],
    reversal: Annotated[
        Reversal | None, typer.Option("--reversal", help="Put reversal compensation into the commands, or not.")
    ] = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    limit_mm: Limit = 5.0,
    anyway: Anyway = False,
    json: Json = False,
) -> int:
    """Work out the commands that put the real tool on its targets: physics and network inverted, never the tracker.

    Rows that cannot be sent have a status, no command, and the nearest command that works; then the exit code is 3.
    """
    from ptt.correct.compensate import compensate, missing_context
    from ptt.correct.training.train import correction_of
    from ptt.files import write_text
    from ptt.run.target_frame import target_frames

    refuse_readings(out)
    reading = Reading(set_=set_, map_=map_, effects=effects, json=json, anyway=anyway)
    compensator = open_model(model, open_library(reading))
    table = read_rows(targets, compensator.model.file, reading, "targets", checked=True)
    check_rows(compensator.model.file, table, reading)
    frames = target_frames(compensator.model.file, table)
    for frame in frames:
        if frame.source not in ("base", "unknown"):
            note(f"targets are taken to be in {frame.words}")
    network = compensator.network
    posture = _posture(table) if network is not None and compensator.space == "joints" else None
    with progress() as tell:
        commands = compensate(
            compensator.model,
            table,
            correction=None if network is None else correction_of(network, posture),
            inside=None if network is None else lambda wanted: network.inside(wanted if posture is None else posture),
            reversal=None if reversal is None else reversal.value,
            limit=limit_mm,
            network=compensator.error,
            progress=tell,
        )
    write_text(out, _frame(table, commands).to_csv(index=False, lineterminator="\n"))
    data = _summary(commands, out, network is not None, limit_mm)
    data["target_frame"] = [frame.to_dict() for frame in frames if frame.source != "base"]
    for line in missing_context(compensator.model, table) + _warnings(table, commands):
        note(f"warning: {line}")
    show(data, _text(data), json)
    return 0 if commands.sent.all() else CANNOT_WORK


def _posture(table: "Table") -> "np.ndarray":
    """Nominal joint commands that a network over joints is asked at, (n, k) rad."""
    import numpy as np

    from ptt.errors import TableError

    if table.command is None or not np.isfinite(table.command).all():
        raise TableError(
            "the compensator's network was trained on joint commands and these targets have none",
            where=table.source,
            fix="add q1_cmd_rad, q2_cmd_rad, ... of the nominal posture",
        )
    return table.command


def _frame(table: "Table", commands: "Commands") -> "pd.DataFrame":
    """Columns of the input, then what to send; nominal joint commands of the input would be mistaken for it."""
    from ptt.run.table import table_to_frame

    prefix = table.joint_prefix
    frame = table_to_frame(table.replace(command=None))
    if "role" not in frame and "role" in table.understood.mapping.columns.values():
        frame["role"] = table.role
    first = [title for title in ("name", "role") if title in frame]
    frame = frame[first + [title for title in frame if title not in first]].copy()
    for joint in range(commands.q.shape[1]):
        frame[f"{prefix}{joint + 1}"] = commands.q[:, joint]
    for joint in range(commands.q.shape[1]):
        frame[f"reversal{joint + 1}"] = commands.reversal[:, joint]
    frame["in_domain"] = commands.in_domain
    frame["status"] = commands.status
    frame["shift_um"] = 1e3 * commands.shift
    frame["sigma_um"] = 1e3 * commands.sigma
    if not commands.sent.all():
        for joint in range(commands.q.shape[1]):
            frame[f"nearest{joint + 1}"] = commands.nearest[:, joint]
        frame["nearest_mm"] = commands.nearest_gap
    return frame


def _summary(commands: "Commands", out: Path, network: bool, limit_mm: float) -> dict[str, Any]:
    known = commands.sent & (commands.sigma >= 0.0)
    return {
        "rows": len(commands.q),
        "out": str(out),
        "status": commands.counts,
        "sent": int(commands.sent.sum()),
        "limit_mm": limit_mm,
        "network": network,
        "in_domain": int(commands.in_domain.sum()),
        "form": "exact inversion",
        "first_order_difference_um": _largest_um(commands.first_order_gap, commands.sent),
        "largest_shift_um": _largest_um(commands.shift, commands.sent),
        "largest_sigma_um": _largest_um(commands.sigma, commands.sent) if known.any() else None,
        "reversal": commands.reversal_note,
        "largest_reversal_um": _largest_um(abs(commands.reversal).max(axis=1), commands.sent),
    }


def _largest_um(values: "np.ndarray", sent: "np.ndarray") -> float:
    """Largest value of the rows that are sent, of values (n,) mm."""
    return 1e3 * float(values[sent].max(initial=0.0))


def _warnings(table: "Table", commands: "Commands") -> list[str]:
    lines = []
    if not commands.sent.all():
        kinds = [_rows_with(table, commands, status) for status in commands.counts if status not in SENT]
        count = f"{int((~commands.sent).sum())} of {len(commands.q)} rows are not sent"
        lines.append(f"{table.source}: {count}: {'; '.join(kind for kind in kinds if kind)}")
    unsure = _rows_with(table, commands, "uncertain")
    if unsure:
        lines.append(
            f"{table.source}: {unsure}: sent, but the fit leaves more open there than its held-out error says;"
            " measure near them"
        )
    outside = int((~commands.in_domain).sum())
    if outside:
        lines.append(f"{outside} of {len(commands.q)} targets lie outside the network's training domain: physics only")
    return lines


def _rows_with(table: "Table", commands: "Commands", status: str) -> str:
    rows = (commands.status == status).nonzero()[0]
    if not len(rows):
        return ""
    named = ", ".join(str(table.line[row]) for row in rows[:LINES_SHOWN])
    return (
        f"{len(rows)} {status} (row{'s' if len(rows) > 1 else ''} {named}{', ...' if len(rows) > LINES_SHOWN else ''})"
    )


def _text(data: dict[str, Any]) -> str:
    counts = ", ".join(f"{count} {status}" for status, count in data["status"].items() if count)
    return "\n".join(
        [
            f"{data['out']}: {data['rows']} rows ({counts})"
            + (f", {data['in_domain']} in the network's training domain" if data["network"] else ", physics alone"),
            f"  largest static correction {data['largest_shift_um']:.1f} um"
            + ("" if data["largest_sigma_um"] is None else f", uncertain by {data['largest_sigma_um']:.1f} um at most"),
            f"  sent: {data['form']}; the first-order form f(p) - J_a dp (eq. 13, J_a at p - dp/2) would put the tool "
            f"at most {data['first_order_difference_um']:.3f} um elsewhere",
            f"  reversal: {data['reversal']} (largest part {data['largest_reversal_um']:.1f} um)",
        ]
    )
