"""A log, a run with more rows than memory holds: a Parquet file read part by part, in the process that works on a part.

Neighbouring rows are read with a part, so that its speeds and directions are those of the whole travel; the memory of
hysteresis at its first row is passed on from the part before (`ptt.run.turns`).
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ptt.effects.memory import entry_after, keep_direction
from ptt.errors import InputError
from ptt.fitting.chunks import CHUNK, NEIGHBOUR_ROWS, stretches, take_entered
from ptt.fleet.log_columns import log_table
from ptt.fleet.log_query import HEADER, SOURCE, ask_log
from ptt.fleet.log_whole import Display, display_of, require_filled, require_once, settle_rows
from ptt.fleet.readings import plain_columns
from ptt.machine import MachineFile
from ptt.run.base_frame import into_base
from ptt.run.behind import carried_on
from ptt.run.driven import by_feed
from ptt.run.lost import without_lost
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.ranges import ranges_of
from ptt.run.rounded import rounded_to, unrounded_by
from ptt.run.table import Table
from ptt.run.target_frame import in_base
from ptt.run.turns import Entry
from ptt.run.view import View
from ptt.run.viewing import build_view, lags_of

SPREAD = 4_000  # rows, evenly spaced over a log, from which the frame and what varies are found (one to two times)
KEPT_ROWS = 4  # of these rows that `Log.whole` keeps: it is sent with every task

Part = tuple[int, int]  # first row, and the row after the last


@dataclass(frozen=True)
class LogState:
    """The state at the end of one part of a log, from which the next part starts.

    Attributes:
        entry: memory of hysteresis at the next part's first row.
        direction: direction in which each joint moved last, (k,), +1 or -1.
        clock: last time that was read, s since the first row; NaN where there was none yet.
        back: sum of all steps by which the time went back until then, s.
        behind: how much warmer bodies are than the temperature there, which they follow late, (m,) K; None where they
            are not late.
    """

    entry: Entry
    direction: Tensor
    clock: float
    back: float
    behind: Tensor | None


@dataclass(frozen=True)
class Log:
    """A long log, and what each of its parts has to know of the whole.

    Attributes:
        machine: the machine.
        file: Parquet file with the columns of a tracker CSV, in any of their units, in travel order.
        rows: number of its rows.
        parts: first row, and row after the last, of each part.
        whole: a problem of few rows that holds what all parts share: the first estimate of the motion into the base
            frame, what varies, in which frame targets are stated.
        ranges: column -> lowest and highest payload, temperature and speed.
        driven: whether the machine moved while it was read, so that rows have speeds.
        clock: time of the first row, s.
        noise: the noise floor from the first rows or the machine file; None where neither gives one.
        rounded: `ptt.run.rounded.rounded_to`: step of joint commands that the targets tell finer, mm or degrees.
        display: how the display of its thermometer goes from step to step; None where temperatures are no display's.
    """

    machine: MachineFile
    file: Path
    rows: int
    parts: tuple[Part, ...]
    whole: Problem
    ranges: dict[str, list[float]]
    driven: bool
    clock: float
    noise: Noise | None
    rounded: float = 0.0
    display: Display | None = None


def open_log(machine: MachineFile, file: str | Path, size: int = CHUNK) -> Log:
    """Open a log: count its rows, cut it into parts, and find what all parts share.

    Args:
        machine: the machine.
        file: Parquet file with the columns of a tracker CSV, one run in travel order.
        size: most rows of a part.

    Returns:
        The log.

    Raises:
        InputError: it cannot be read, or has what parts cannot have: base reflectors, an arm's own mount, several
            runs, empty cells that a part cannot fill, all rows twice.
    """
    path = Path(file)
    rows = int(ask_log(path, f"SELECT count(*) AS rows FROM {SOURCE}")["rows"][0])
    parts, step = tuple(stretches(rows, size)), max(rows // SPREAD, 1)
    if len(parts) > 1:
        require_filled(path, rows, NEIGHBOUR_ROWS)
    require_once(path, rows)
    display = display_of(path, rows)
    few = read_log(machine, path, f"WHERE file_row_number % {step} = 0")
    spread = build_problem(machine, settle_rows(few, display))
    _require_one_run(spread, path)
    table = settle_rows(read_log(machine, path, f"LIMIT {CHUNK}"), display)
    first = build_problem(machine, table)
    seen = build_view(machine, in_base(table, first.stated_in))
    driven = ("speed" in seen.varies) == ("speed" in first.view.varies)
    clock = 0.0 if table.time_s is None else float(table.time_s[0])
    varies = first.view.varies | spread.view.varies - {"speed", "direction"}  # these two need consecutive rows
    whole = take_entered(spread, [(0, KEPT_ROWS)], [None])
    whole = replace(
        whole, view=replace(whole.view, varies=varies, beginnings=(0.0,))
    )  # one run, whose clock is its own
    rounded = rounded_to(machine, in_base(spread.table, spread.stated_in))
    return Log(
        machine, path, rows, parts, whole, ranges_of(spread), driven, clock, first.noise, rounded, display
    )  # fmt: skip


def read_part(log: Log, part: Part) -> Problem:
    """Read a part with its neighbouring rows; the state before it is not applied yet.

    Args:
        log: the log.
        part: its rows.

    Returns:
        The rows as a problem, from which `enter_part` removes the neighbours.
    """
    low, high = max(part[0] - NEIGHBOUR_ROWS, 0), min(part[1] + NEIGHBOUR_ROWS, log.rows)
    table, whole = read_log(log.machine, log.file, f"LIMIT {high - low} OFFSET {low}"), log.whole
    table = settle_rows(table, log.display)
    view = build_view(log.machine, unrounded_by(log.machine, in_base(table, whole.stated_in), log.rounded))
    time = view.time if table.time_s is None else torch.as_tensor(np.asarray(table.time_s, float) - log.clock)
    fed = by_feed(view, *log.ranges.get("feed_mm_s", (0.0, 0.0)))
    view = replace(
        view if log.driven else view.standing(fed), varies=whole.view.varies, time=time,
        behind=None if whole.view.behind is None else lags_of(table),
        number=torch.arange(low, high, dtype=torch.float64), beginnings=whole.view.beginnings,
    )  # fmt: skip
    frame, observed = np.zeros(table.rows, dtype=int), np.isfinite(table.measured).all(axis=1)
    measured = into_base(table.measured, frame, whole.rotation, whole.shift)
    return replace(
        whole, table=table, view=view, measured=measured, used=observed & (table.role != "base"), frame=frame,
        mount=np.full(table.rows, -1), noise=log.noise,
    )  # fmt: skip


def enter_part(problem: Problem, part: Part, state: LogState | None) -> Problem:
    """The rows of a part alone, with the state at the end of the part before applied.

    Args:
        problem: from `read_part`.
        part: its rows.
        state: at the end of the part before; None for the first part.

    Returns:
        The part as a problem.
    """
    number = problem.view.number
    assert number is not None
    if state is not None:
        problem = replace(problem, view=keep_direction(problem.view, state.direction))
    low = int(number[0])
    if state is not None and state.behind is not None:
        problem = replace(problem, view=_carried_on(problem.view, part[0] - low - 1, state.behind))
    problem = take_entered(problem, [(part[0] - low, part[1] - low)], [state.entry if state else None])
    return replace(problem, view=replace(problem.view, time=problem.view.time + _gone_back(problem.view.time, state)))


def _carried_on(view: View, row: int, behind: Tensor) -> View:
    """The view with bodies as warm as they are from a row on, whose lags are known, (m,) K."""
    assert view.behind is not None
    time = (view.time + _gone_back(view.time, None))[row:].numpy()
    after = torch.as_tensor(carried_on(view.behind[row:].numpy(), time, behind.numpy()))
    return replace(view, behind=torch.cat([view.behind[:row], after]))


def hand_on(problem: Problem, part: Part, state: LogState | None) -> LogState:
    """The state at the end of a part, arguments as of `enter_part`: the only step that cannot be done in parallel."""
    view, low = enter_part(problem, part, state).view, max(part[0] - NEIGHBOUR_ROWS, 0)
    shown = problem.view.time[part[0] - low : part[1] - low]
    told = torch.isfinite(shown)
    behind = None if view.behind is None else view.behind[-1]
    if not told.any():
        clock, back = (state.clock, state.back) if state else (np.nan, 0.0)
    else:
        clock = float(shown[told][-1])
        back = float(view.time[told][-1]) - clock
    return LogState(entry_after(view), view.direction[-1], clock, back, behind)


def _gone_back(shown: Tensor, state: LogState | None) -> Tensor:
    """What to add to the time of each row so that it never goes back (as in `ptt.run.viewing.elapsed`), (n,) s."""
    told, before = torch.isfinite(shown), state.clock if state else np.nan
    steps = torch.diff(shown[told], prepend=shown.new_full((1,), before)).nan_to_num()  # nothing comes before the first
    back = torch.full_like(shown, state.back if state else 0.0)
    back[told] += (-steps).clamp(min=0.0).cumsum(0)
    return back


def _require_one_run(problem: Problem, path: Path) -> None:
    base, mounts, runs = problem.base is not None, problem.mounts > 0, len(problem.table.run_label) > 1
    what = "base reflectors" if base else "an arm's own mount" if mounts else "several runs" if runs else ""
    if what:
        fix = "read it whole (ptt fit), or cut it into one log for each run"
        raise InputError(f"has {what}, which cannot be fitted in parts", where=str(path), fix=fix)


def read_log(machine: MachineFile, path: Path, which: str) -> Table:
    """Read some rows of a log.

    Args:
        machine: the machine.
        path: Parquet file.
        which: end of the SQL query, such as 'LIMIT 20'.

    Returns:
        The rows, with their line numbers; readings of a lost beam are left out.

    Raises:
        InputError: it cannot be read, has no readings, or a column or value that a run is refused for.
    """
    columns = plain_columns(ask_log(path, f"SELECT * FROM {SOURCE} {which}"))
    return without_lost(log_table(machine, columns, columns["file_row_number"] + HEADER, path.name))
