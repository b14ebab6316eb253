"""The rows of a run in order: cycles of the targets, datum visits, base reflectors; and their times."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from ptt.errors import TableError
from ptt.rig.nominal import Array
from ptt.rig.rig import Rig

TARGET = ["x_cmd", "y_cmd", "z_cmd"]
WHERE = "targets"  # in messages
DATUM, HOLD = -1, -2  # in `origin`: rows that no row of the targets stands for


@dataclass(frozen=True)
class Schedule:
    """The rows of a run: poses that are visited, and base reflectors that are measured meanwhile.

    Attributes:
        origin: (n,) int, row of the targets; DATUM for a datum visit, HOLD for a base reflector.
        target: (n, 3) mm, NaN where only sliders are commanded.
        command: (n, k) mm or rad, joints to send, NaN where the controller computes them from the target.
        name: (n,) str.
        role: (n,) str, pose, base or datum.
        run: (n,) int from 0.
        repeat: (n,) int from 1, number of the cycle.
        payload: (n,) kg.
        feed: (n,) mm/s.
        read: (n,) bool, False where the machine passes without a reading.
    """

    origin: Array
    target: Array
    command: Array
    name: Array
    role: Array
    run: Array
    repeat: Array
    payload: Array
    feed: Array
    read: Array

    @property
    def rows(self) -> int:
        """Number of rows n."""
        return len(self.origin)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(self.run.max()) + 1

    @property
    def held(self) -> Array:
        """(n,) bool, rows during which the machine stands still."""
        return self.role == "base"


def plan_rows(rig: Rig, commands: pd.DataFrame, sliders: pd.DataFrame | None) -> Schedule:
    """Lay out every row of a simulated run.

    Args:
        rig: its conditions and tracker say how many cycles, datum visits and base readings there are.
        commands: the targets, columns as in a targets file; for a rig of one cycle their column repeat says which cycle
            of a longer run a row is of.
        sliders: columns b1.. or q1.. to send instead, a row per row of `commands` or per row and cycle.

    Returns:
        The schedule.

    Raises:
        TableError: no rows or no pose, columns missing, cells that are no numbers, a feed of zero, sliders of another
            length, an unknown base reflector.
    """
    table = _tidy(commands, rig.commanded)
    origin, cycle = _layout(rig, table)
    pose = origin >= 0
    row = np.where(pose, origin, 0)
    role = np.where(pose, table["role"].to_numpy()[row], np.where(origin == DATUM, "datum", "base"))
    name = np.where(pose, table["name"].to_numpy()[row], np.where(origin == DATUM, "datum", ""))
    held = role == "base"
    if held.all():
        raise TableError("has base reflectors and no pose", where=WHERE, fix="give at least one target")
    name = _name_base(rig, name, origin, held)
    target = np.where(pose[:, None], table[TARGET].to_numpy(float)[row], np.asarray(rig.tracker.datum_mm))
    command = np.where(pose[:, None], table[rig.commanded].to_numpy(float)[row], np.nan)
    if sliders is not None:
        command = _replace_commands(sliders, rig.sent, command, pose, held, len(table))
    target, command = _hold(target, held), _hold(command, held)
    conditions = rig.conditions
    return Schedule(
        origin=np.where(held, HOLD, origin),
        target=target,
        command=command,
        name=name,
        role=role,
        run=cycle if conditions.run_per_cycle else np.zeros_like(cycle),
        repeat=cycle + 1,
        payload=_context(table["payload_kg"], row, pose, conditions.payload_per_cycle_kg, conditions.payload_kg, cycle),
        feed=_context(table["feed_mm_s"], row, pose, conditions.feed_per_cycle_mm_s, conditions.feed_mm_s, cycle),
        read=~pose | (table["read"].to_numpy()[row] != 0.0),
    )


def reading_times(rig: Rig, schedule: Schedule, tool: Array) -> Array:
    """Times of the readings: travel of the tool at the feed, dwells at standstill, pauses between cycles.

    Args:
        rig: its conditions say dwell and pause.
        schedule: the rows.
        tool: (n, 3) mm, commanded tool positions.

    Returns:
        (n,) s from the start of the simulation; the first row is read after one dwell.
    """
    conditions = rig.conditions
    travel = np.linalg.norm(np.diff(tool, axis=0, prepend=tool[:1]), axis=1) / schedule.feed
    stop = schedule.held | (schedule.role == "datum") | (not conditions.moving)
    step = travel + np.where(stop, conditions.dwell_s, 0.0)
    step = np.maximum(step, 1e-3)  # two readings never share a time, so that speeds stay finite
    step[0] = conditions.dwell_s
    return np.cumsum(step + conditions.pause_s * (np.diff(schedule.repeat, prepend=schedule.repeat[0]) != 0))


def _tidy(commands: pd.DataFrame, joints: list[str]) -> pd.DataFrame:
    """A copy of the targets with every column this module reads."""
    table = commands.reset_index(drop=True).copy()
    if table.empty:
        raise TableError("has no rows", where=WHERE, fix="give at least one target")
    for group in (TARGET, joints):
        present = [column in table for column in group]
        if any(present) and not all(present):
            missing = group[present.index(False)]
            raise TableError(f"column {missing} is missing", where=WHERE, fix=f"give all of {', '.join(group)}")
        if not any(present):
            table[group] = np.nan
    for column, default in (("name", ""), ("role", "pose")):
        values = table[column] if column in table else pd.Series([default] * len(table))
        table[column] = values.fillna(default).astype(str).replace("", default)
    for column in ("payload_kg", "feed_mm_s"):
        table[column] = _numbers(table, [column])[:, 0] if column in table else np.nan
    stopped = (table["feed_mm_s"] <= 0.0).to_numpy()
    if stopped.any():
        row = int(np.argmax(stopped))
        what = f"a feed of {table['feed_mm_s'].iloc[row]:g} mm/s never arrives"
        place = f"{WHERE} row {row + 1}, column feed_mm_s"
        raise TableError(what, where=place, fix="give a feed above zero, or an empty cell for the rig's own")
    table["read"] = _numbers(table, ["read"])[:, 0] if "read" in table else 1.0
    repeat = _numbers(table, ["repeat"])[:, 0] if "repeat" in table else np.ones(len(table))
    table["repeat"] = np.where(np.isfinite(repeat), repeat, 1.0).astype(int)
    numbers = {"target": _numbers(table, TARGET), "command": _numbers(table, joints)}
    table[TARGET], table[joints] = numbers["target"], numbers["command"]
    known = np.isfinite(numbers["target"]).all(1) | np.isfinite(numbers["command"]).all(1)
    empty = ~(known | (table["role"] == "base").to_numpy())
    if empty.any():
        raise TableError(
            f"row {int(np.argmax(empty)) + 1} has neither x_cmd, y_cmd, z_cmd nor {', '.join(joints)}",
            where=WHERE,
            fix="fill in one of the two",
        )
    return table


def _numbers(table: pd.DataFrame, columns: list[str], where: str = WHERE) -> Array:
    """Columns as floats, (n, c); an empty cell is NaN."""
    values = np.empty((len(table), len(columns)))
    for number, column in enumerate(columns):
        parsed = pd.to_numeric(table[column], errors="coerce").to_numpy(float)
        wrong = np.isnan(parsed) & table[column].notna().to_numpy()
        if wrong.any():
            row = int(np.argmax(wrong))
            what = f"not a number ({table[column].iloc[row]!r})"
            raise TableError(what, where=f"{where} row {row + 1}, column {column}", fix="correct the cell")
        values[:, number] = parsed
    return values


def _layout(rig: Rig, table: pd.DataFrame) -> tuple[Array, Array]:
    """`Schedule.origin` of every row, and the number of its cycle from 0, (n,) int each."""
    tracker = rig.tracker
    points = rig.machine.tracker.base_point
    measured = rig.machine.tracker.frame == "measured" if tracker.measure_base is None else tracker.measure_base
    base = [HOLD] * len(points) if measured else []
    origin: list[int] = []
    cycle: list[int] = []
    laps = _laps(rig, table)
    for place, (number, listed) in enumerate(laps):
        opens = place == 0 or rig.conditions.run_per_cycle
        closes = place == len(laps) - 1 or rig.conditions.run_per_cycle
        rows = list(base) if opens else []
        for done in listed:
            if tracker.datum_every and done and done % tracker.datum_every == 0:
                rows.append(DATUM)
            if tracker.base_every and done and done % tracker.base_every == 0:
                rows += base
            rows.append(int(done))
        rows += base if closes else []
        origin += rows
        cycle += [number] * len(rows)
    return np.array(origin), np.array(cycle)


def _laps(rig: Rig, table: pd.DataFrame) -> list[tuple[int, Array]]:
    """Number from 0 and rows of each cycle: all targets in each, or its own where the targets list a whole run."""
    cycles, rows, repeat = rig.conditions.cycles, np.arange(len(table)), table["repeat"].to_numpy()
    if cycles > 1 or (np.diff(repeat) < 0).any():  # numbers that fall again count visits of single poses
        return [(number, rows) for number in range(cycles)]
    return [*enumerate(np.split(rows, np.flatnonzero(np.diff(repeat)) + 1))]


def _name_base(rig: Rig, name: Array, origin: Array, held: Array) -> Array:
    """Names of all rows: base reflectors of the rig in the order of the machine file, those of the targets as named."""
    known = [point.name for point in rig.machine.tracker.base_point]
    own = held & (origin == HOLD)
    named = name.astype(object)
    if own.any():
        named[own] = np.resize(np.array(known, dtype=object), int(own.sum()))
    unknown = [value for value in named[held] if value not in known]
    if unknown:
        raise TableError(
            f"base reflector {unknown[0]!r} is not in the machine file",
            where=WHERE,
            fix=f"use one of {', '.join(known) or 'none'}, or add it as [[tracker.base_point]]",
        )
    return named.astype(str)


def _replace_commands(
    sliders: pd.DataFrame, joints: list[str], command: Array, pose: Array, held: Array, rows: int
) -> Array:
    """Commands with those of the targets' rows replaced by joints that are given, (n, k) mm or rad."""
    missing = [column for column in joints if column not in sliders]
    if missing:
        raise TableError(f"column {missing[0]} is missing", where="sliders", fix=f"give {', '.join(joints)}")
    values, moves = _numbers(sliders, joints, "sliders"), pose | ~held
    if len(values) == int(moves.sum()):  # datum visits among them
        pose = moves
    poses = int(pose.sum())
    if len(values) not in (rows, poses):
        raise TableError(
            f"{len(values)} rows of sliders for {rows} targets", where="sliders", fix=f"give a row per row of {WHERE}"
        )
    given = values if len(values) == poses else np.tile(values, (poses // rows, 1))
    empty = ~held[pose] & ~np.isfinite(given).all(1)
    if empty.any():
        place = f"sliders row {int(np.argmax(empty)) % len(values) + 1}"
        raise TableError(
            f"has no {', '.join(joints)} to send", where=place, fix="leave the row out of sliders and targets"
        )
    command = command.copy()
    command[pose] = given
    return command


def _hold(values: Array, held: Array) -> Array:
    """The last value before each held row, or the first after where there is none."""
    rows = np.arange(len(values))
    last = np.maximum.accumulate(np.where(held, -1, rows))
    first = int(np.argmin(held))
    return values[np.where(last < 0, first, last)]


def _context(
    column: pd.Series, row: Array, pose: Array, per_cycle: tuple[float, ...], default: float, cycle: Array
) -> Array:
    """A context value per row: the target's own, else the cycle's, else the run's."""
    usual = np.asarray(per_cycle)[cycle % len(per_cycle)] if per_cycle else np.full(len(cycle), default)
    own = np.where(pose, column.to_numpy(float)[row], np.nan)
    own = _hold(own, ~pose) if pose.any() else own
    return np.where(np.isfinite(own), own, usual)
