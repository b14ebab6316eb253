"""What `ptt.evaluate` gives: errors before and after, as a value, as a table, as text and as a picture."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ptt.door.result import Result
from ptt.judge.evaluation import Evaluation
from ptt.record import plain
from ptt.run.axes import AXES_TOTAL
from ptt.run.noise import source_in_words
from ptt.run.taken import frames_said

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SHOWN_ROWS = 5
UNALIGNED = (
    "without frame alignment (readings as measured: if the tracker was set up anew, its position counts as error):"
)


@dataclass(frozen=True, eq=False, repr=False)
class Evaluated(Result):
    """Errors before and after a compensation.

    Attributes:
        result: errors of the rows that count, before and after; of several protocols the first.
        protocols: the same by protocol, where the errors are computed on held-out rows; empty where measured.
        judged: whether goals were set.
        notes: what was found on the way, a line each.
        warnings: doubts about the comparison of two runs: few rows in common, poses visited more often, another load,
            temperature or speed, gross readings, or a tracker set up anew in each.
        set_up: of a single run, the frames of targets and tracker that were removed.
    """

    result: Evaluation
    protocols: Mapping[str, Evaluation]
    judged: bool = False
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    set_up: Mapping[str, Any] = field(default_factory=dict)

    def _figures(self) -> Mapping[str, Any]:
        short = {name: _short(one) for name, one in self.protocols.items()}
        figures = self.result.to_dict() | {"warnings": list(self.warnings)}
        return figures | ({"protocols": short} if short else {}) | dict(self.set_up)

    def __str__(self) -> str:
        """What the command prints."""
        return "\n".join([*(f"WARNING: {one}" for one in self.warnings), _text(self.to_dict(), self.judged)])

    def to_frame(self) -> "pd.DataFrame":
        """One row for each axis, the total and the length: before and after in um, reduction in percent."""
        import pandas as pd

        data = self.to_dict()
        return pd.DataFrame({**data["axes"], "total": data["total"], "length": data["length"]}).T

    def plot(self) -> "Figure":
        """Draw the error of each axis along the path, before above and after below."""
        from ptt.show.plots.compensation import draw_error_curves

        noise = None if self.result.noise is None else plain(self.result.noise.to_dict())
        return draw_error_curves(self.result.before, self.result.after, noise_um=noise)


def _short(result: Evaluation) -> dict[str, Any]:
    data = result.to_dict()
    return {key: data[key] for key in ("axes", "total", "length", "rest_is_noise", "protocol")}


def _text(data: dict[str, Any], judged: bool) -> str:
    protocol = data["protocol"]
    kind = "measured" if protocol["measured"] else "computed, not measured"
    lines = [f"{kind}; {protocol['rows']} rows, {protocol['poses']} poses; frame {protocol['frame']}"]
    lines[0] += f"; z from {'the first pose' if protocol['z_datum'] == 'first' else 'the base'}"
    if "protocols" in data:
        for name, one in data["protocols"].items():
            lines += ["", f"{name}: {one['protocol']['held_out']}", *_table(one, judged)]
        said = frames_said(data["frame_taken"])
        lines += ["", *said] if said else []
    else:
        lines += _table(data, judged)
        lines += ["", UNALIGNED, *_table(data["unaligned"], judged=False)]
    if data["noise_um"]:
        noise = data["noise_um"]
        figures = ", ".join(f"{axis} {noise[axis]:.1f}" for axis in AXES_TOTAL)
        lines += ["", f"noise floor, one standard deviation in um: {figures} (from {source_in_words(noise['source'])})"]
    for side, rows in data["unmatched"].items():
        if rows:
            more = f" and {len(rows) - SHOWN_ROWS} more" if len(rows) > SHOWN_ROWS else ""
            lines.append(f"in {side} alone, without counterpart: {', '.join(rows[:SHOWN_ROWS])}{more}")
    return "\n".join(lines)


def _table(data: dict[str, Any], judged: bool) -> list[str]:
    lines = [f"  {'mean |error|':<12} {'before um':>10} {'after um':>10} {'less %':>8}"]
    for name, row in (*data["axes"].items(), ("length", data["length"])):
        gained = row["reduction_percent"]
        line = f"  {name:<12} {row['before_um']:>10.1f} {row['after_um']:>10.1f}"
        line += f" {'-' if gained is None else f'{gained:.1f}':>8}"
        noise = bool(data.get("rest_is_noise", {}).get(name))
        lines.append("  ".join([line, *_remarks(row, noise, judged and "goal_met" in row)]))
    return lines


def _remarks(row: dict[str, Any], is_noise: bool, judged: bool) -> list[str]:
    """Remarks on an axis: on the goal where one was set, and where only noise is left."""
    noise = ["what is left is noise"] if is_noise else []
    if not judged:
        return noise
    if row["goal_met"]:
        return [f"goal {row['goal_percent']:.0f} met"]
    return [f"goal {row['goal_percent']:.0f} {'not measurable:' if noise else 'missed'}", *noise]
