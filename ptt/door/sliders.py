"""Columns of sliders.csv, and its summary as JSON and text."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ptt.correct.commands import Commands
from ptt.door.tally import Tally
from ptt.run.readers.columns import file_title
from ptt.run.readers.mapping import IGNORE
from ptt.run.table import Table
from ptt.run.target_frame import RunFrame
from ptt.run.written import columns_of

SEEN_UM = 0.1  # difference of the two forms of a command that is worth a word; no tracker sees less


def sliders_columns(table: Table, commands: Commands, *, sent: bool | None = None) -> dict[str, np.ndarray]:
    """Columns of the input, then what to send.

    Args:
        table: the targets.
        commands: what to send there.
        sent: whether all rows of the list are sent; None where these are all rows.

    Returns:
        Title -> (n,).
    """
    columns = _as_given(table)
    _put(columns, table.joint_prefix, commands.q)
    _put(columns, "reversal", commands.reversal)
    columns["in_domain"] = _of_targets(commands.in_domain, commands.targets)
    columns["status"] = commands.status
    columns["shift_um"] = 1e3 * commands.shift
    columns["sigma_um"] = 1e3 * commands.sigma
    if not (commands.sent[commands.targets].all() if sent is None else sent):
        _put(columns, "nearest", commands.nearest)
        columns["nearest_mm"] = commands.nearest_gap
    return columns


def _of_targets(values: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Values of targets, (n,); None on base reflectors."""
    return values if targets.all() else np.where(targets, values.astype(object), np.array(None))


def _as_given(table: Table) -> dict[str, np.ndarray]:
    """Columns of the input in its order, empty ones included, then values that were set for all rows."""
    held = columns_of(table)
    empty = {"name": table.name, "role": table.role}
    meant = table.understood.mapping.columns
    own = [title if quantity == IGNORE else file_title(quantity) for title, quantity in meant.items()]
    return {title: held.get(title, empty.get(title, np.full(table.rows, np.nan))) for title in own} | held


def _put(columns: dict[str, np.ndarray], stem: str, values: np.ndarray) -> None:
    columns.update({f"{stem}{joint + 1}": values[:, joint] for joint in range(values.shape[1])})


def summary_of(counted: Tally, out: str | None, network: bool, limit_mm: float) -> dict[str, Any]:
    """Summary of commands, for JSON."""
    return {
        "rows": counted.rows,
        "base_rows": counted.base,
        "out": out,
        "status": counted.status,
        "sent": counted.sent,
        "limit_mm": limit_mm,
        "network": network,
        "in_domain": counted.in_domain,
        **counted.figures(),
    }


def frame_figures(frames: Iterable[RunFrame]) -> dict[str, Any]:
    """Frames in which targets were stated, other than the base frame, for JSON."""
    return {"target_frame": [frame.to_dict() for frame in frames if frame.source != "base"]}


def text_of_figures(data: dict[str, Any]) -> str:
    """Summary of commands as text."""
    counts = ", ".join(f"{count} {status}" for status, count in data["status"].items() if count)
    network = f", {data['in_domain']} in the network's training domain" if data["network"] else ", physics alone"
    lines = [(f"{data['out']}: " if data["out"] else "") + f"{data['rows']} rows ({counts}){network}"]
    if data["base_rows"]:
        lines.append(f"  {data['base_rows']} more rows of base reflectors, without commands: the machine stands there")
    shift, sigma, gap = (data[f"{name}_um"] for name in ("largest_shift", "largest_sigma", "first_order_difference"))
    if shift is not None:
        unsure = "" if sigma is None else f", uncertain by {sigma:.1f} um at most"
        lines.append(f"  largest static correction {shift:.1f} um{unsure}")
    if gap is not None:  # where no joint moves the tool one way there is no such form
        form = "the first-order form f(p) - J_a dp (J_a at p - dp/2) would put the tool at most"
        apart = f"; {form} {gap:.1f} um elsewhere" if gap >= SEEN_UM else ""
        lines.append(f"  sent: {data['form']}{apart}")
    if reversal := reversal_of(data):
        lines.append(f"  reversal: {data['reversal']} (largest part {reversal})")
        lines.append("  start: each joint is taken to reach the first target in the direction of its next move")
    return "\n".join(lines)


def reversal_of(data: Mapping[str, Any]) -> str:
    """The largest reversal compensation of a summary in words: of a slider in um, of an arm's joint in urad."""
    for unit in ("um", "urad"):
        if (largest := data.get(f"largest_reversal_{unit}")) is not None:
            return f"{largest:.1f} {unit}"
    return ""
