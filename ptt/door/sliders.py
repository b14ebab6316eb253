"""sliders.csv column by column, and what is said of it."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from ptt.correct.compensate import Commands
from ptt.door.tally import Tally
from ptt.run.readers.columns import file_title
from ptt.run.readers.mapping import IGNORE
from ptt.run.table import Table
from ptt.run.target_frame import RunFrame
from ptt.run.written import columns_of

if TYPE_CHECKING:
    pass


def sliders_columns(table: Table, commands: Commands, *, sent: bool | None = None) -> dict[str, np.ndarray]:
    """Columns of the input, then what to send.

    Args:
        table: the targets.
        commands: what to send there.
        sent: whether all rows of the list are sent, where these are some of them.

    Returns:
        Title -> (n,).
    """
    columns = _as_given(table)
    _put(columns, table.joint_prefix, commands.q)
    _put(columns, "reversal", commands.reversal)
    columns["in_domain"] = commands.in_domain
    columns["status"] = commands.status
    columns["shift_um"] = 1e3 * commands.shift
    columns["sigma_um"] = 1e3 * commands.sigma
    if not (commands.sent.all() if sent is None else sent):
        _put(columns, "nearest", commands.nearest)
        columns["nearest_mm"] = commands.nearest_gap
    return columns


def _as_given(table: Table) -> dict[str, np.ndarray]:
    """Every column of the input in its own order, also those without content; what was set for all rows behind them."""
    held = columns_of(table)
    empty = {"name": table.name, "role": table.role}
    meant = table.understood.mapping.columns
    own = [title if quantity == IGNORE else file_title(quantity) for title, quantity in meant.items()]
    return {title: held.get(title, empty.get(title, np.full(table.rows, np.nan))) for title in own} | held


def _put(columns: dict[str, np.ndarray], stem: str, values: np.ndarray) -> None:
    columns.update({f"{stem}{joint + 1}": values[:, joint] for joint in range(values.shape[1])})


def summary_of(counted: Tally, out: str | None, network: bool, limit_mm: float) -> dict[str, Any]:
    """What is said of commands, for JSON."""
    return {
        "rows": counted.rows,
        "out": out,
        "status": counted.status,
        "sent": counted.sent,
        "limit_mm": limit_mm,
        "network": network,
        "in_domain": counted.in_domain,
        **counted.figures(),
    }


def frame_figures(frames: Iterable[RunFrame]) -> dict[str, Any]:
    """In which frames targets were stated, for JSON."""
    return {"target_frame": [frame.to_dict() for frame in frames if frame.source != "base"]}


def text_of_figures(data: dict[str, Any]) -> str:
    """The same for a person."""
    counts = ", ".join(f"{count} {status}" for status, count in data["status"].items() if count)
    return "\n".join(
        [
            (f"{data['out']}: " if data["out"] else "")
            + f"{data['rows']} rows ({counts})"
            + (f", {data['in_domain']} in the network's training domain" if data["network"] else ", physics alone"),
            f"  largest static correction {data['largest_shift_um']:.1f} um"
            + ("" if data["largest_sigma_um"] is None else f", uncertain by {data['largest_sigma_um']:.1f} um at most"),
            f"  sent: {data['form']}; the first-order form f(p) - J_a dp (eq. 13, J_a at p - dp/2) would put the tool "
            f"at most {data['first_order_difference_um']:.3f} um elsewhere",
            f"  reversal: {data['reversal']} (largest part {data['largest_reversal_um']:.1f} um)",
        ]
    )
