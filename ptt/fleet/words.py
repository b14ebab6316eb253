"""One machine of a fleet as text: its runs, its values in the first and the last of them, its alarms."""

import math

from ptt.fleet.alarms import amount
from ptt.fleet.overview import Standing
from ptt.fleet.store import shown

NOT_MEASURED = "not measured"


def machine_in_words(machine: Standing) -> str:
    """One machine as a person reads it.

    Args:
        machine: its present state.

    Returns:
        Several lines.
    """
    lines = [shown(machine.machine), "", f"{'date':<10}  {'verdict':<16}  {'error um':>8}  {'noise um':>8}  file"]
    for past in machine.past:
        figures = "  ".join(
            "       -" if value is None else f"{value:8.1f}" for value in (past.error_um, past.noise_um)
        )
        lines.append(f"{past.date.date().isoformat()}  {past.verdict or 'waiting':<16}  {figures}  {shown(past.file)}")
        if past.accepted:
            error = "" if past.left_um is None else f"{past.left_um:.1f}"
            lines.append(f"{'':<10}  {'accepted':<16}  {error:>8}  {'':>8}  its model is used from here on")
    if machine.moves is not None:
        lines += ["", f"{'value':<44}  {'first':>16}  {'last':>16}"]
        plain = [place for place, label in enumerate(machine.names.labels) if "." not in label.rpartition(" ")[2]]
        for place in plain:
            label = machine.names.labels[place]
            ends = [_shown(machine, row, place) for row in (0, -1)]
            lines.append(f"{label:<44}  {ends[0]:>16}  {ends[1]:>16}")
        if left := len(machine.names.labels) - len(plain):
            lines.append(f"and {left} values of curves (in --json)")
    if machine.alarms:
        lines += ["", *(f"{alarm.words}" for alarm in machine.alarms)]
    last = machine.last
    if last is not None and last.words:
        lines += ["", f"the run of {last.date.date().isoformat()}:", last.words]
    return "\n".join(lines)


def _shown(machine: Standing, row: int, place: int) -> str:
    """One value in one run: its size where the run measures it; '-' where the run's model lacks it."""
    moves, usual = machine.moves, float(machine.names.usual[place])
    assert moves is not None
    value, std = float(moves.values[row, place]), float(moves.marginal_std[row, place])
    if not math.isfinite(value):
        return NOT_MEASURED if math.isfinite(moves.unseen[row, place]) else "-"
    return amount(value * usual, machine.names.units[place], std * usual)
