"""Set-up mistakes of a machine file and its runs, found before any physics."""

from dataclasses import fields, replace

import numpy as np

from ptt.machine import MachineFile, ThreePttSpec
from ptt.run.table import Table, take_rows
from ptt.run.target_frame import stated_frame
from ptt.setup.arm import LEAST_ROWS as FEWEST_OF_ARM
from ptt.setup.arm import find_arm, unexplained_arm
from ptt.setup.arm_tool import find_tool
from ptt.setup.base import find_base
from ptt.setup.candidates import suggested_by_readings
from ptt.setup.clock import find_speed
from ptt.setup.columns import standing_still
from ptt.setup.context import find_units
from ptt.setup.direction import find_directions
from ptt.setup.elsewhere import find_aside, find_own_frames
from ptt.setup.geometry import (
    differ,
    explains_more,
    find_geometry,
    is_off,
    is_steep,
    left_beside_faults,
    unexplained,
)
from ptt.setup.judged import undo_all
from ptt.setup.moved import find_moved
from ptt.setup.noise import find_noise
from ptt.setup.order import find_disorder
from ptt.setup.reach import find_reach, find_speck, find_travel
from ptt.setup.result import Check, Finding
from ptt.setup.rows import find_shifted_rows, find_slip
from ptt.setup.score import LEAST_ROWS
from ptt.setup.setup import Setup, used_rows, written
from ptt.setup.shuffled import find_shuffled
from ptt.setup.stations import find_stations
from ptt.setup.stray import find_far_targets

AT_FIRST = 1000  # rows among which enough poses are counted before all rows are
OWN_FRAME = ("fitted-per-run", "measured")  # policies under which each run has a tracker frame of its own


def check_setup(file: MachineFile, table: Table, *, ordered: bool = False, units_said: bool = False) -> Check:
    """Look for mistakes in how a machine and its runs were set up.

    Args:
        file: the machine.
        table: one run or several; each set-up of the tracker is checked by itself.
        ordered: whether the user stated that the rows are in travel order.
        units_said: whether the user stated the units of the columns: then a small path is not taken for another unit.

    Returns:
        Findings, the sure ones first, and both files with those undone; a table of several files is returned unchanged.
    """
    findings: list[Finding] = []
    open_ends: list[str] = []
    cured, parts, stations, stated = file, list[Table](), list[Setup](), stated_frame(file.targets)
    places = _set_ups(file, table)
    for part in (table if len(rows) == table.rows else take_rows(table, rows) for rows in places):
        part = _of_one_file(part)
        found, after = _check_one(Setup(cured, part.replace(target=stated.into_base(part.target))), ordered, units_said)
        findings += [
            item for item in found if (item.mistake, item.words) not in {(f.mistake, f.words) for f in findings}
        ]
        open_ends += [] if any(item.sure for item in found) else _unexplained(after)
        cured = after.file
        stations.append(after)
        parts.append(after.table.replace(target=stated.as_stated(after.table.target)))
    if len(stations) > 1 and not any(item.sure for item in findings):
        elsewhere, cured = find_stations(stations)
        findings += elsewhere
    findings.sort(key=lambda item: not item.sure)
    whole = table if table.of_several_files else _together(parts, places)
    little = "" if any(item.sure for item in findings) else too_little(file, table)
    return Check(tuple(findings), written(cured, file), whole, table.rows, little, "; ".join(open_ends[:1]))


def _unexplained(setup: Setup) -> list[str]:
    """Errors that no mistake explains, in words, with columns of readings that are constant."""
    if not used_rows(setup.table).any():
        return []
    found = unexplained(setup) if isinstance(setup.file.machine, ThreePttSpec) else unexplained_arm(setup)
    return [" ".join([*found, *standing_still(setup)])] if found else []


def too_little(file: MachineFile, table: Table) -> str:
    """Why targets, commands and readings cannot be compared; '' where they can.

    Args:
        file: the machine.
        table: the run.
    """
    arm = not isinstance(file.machine, ThreePttSpec)
    if arm and table.command is None:
        return "there are no joint commands, and a tool position alone does not determine an arm's posture"
    sent = np.isfinite(table.target).all(axis=1) & (not arm)
    place = table.target
    if table.command is not None:
        place = np.nan_to_num(np.column_stack([table.target, table.command]))
        sent |= np.isfinite(table.command).all(axis=1)
    rows = used_rows(table) & sent
    read = rows & np.isfinite(table.measured).all(axis=1)
    rows, what = (read, "a reading") if read.any() else (rows, "a target or command")
    least, at = FEWEST_OF_ARM if arm else LEAST_ROWS, np.round(place[rows], 6)
    if len(np.unique(at[:AT_FIRST], axis=0)) >= least or (poses := len(np.unique(at, axis=0))) >= least:
        return ""
    return f"{poses} different pose{'' if poses == 1 else 's'} with {what}, but {least} are needed"


def _check_one(setup: Setup, ordered: bool, units_said: bool) -> tuple[list[Finding], Setup]:
    """The findings of one set-up, and its files with the sure ones undone one after the other."""
    if not used_rows(setup.table).any():
        return find_base(setup), setup
    findings: list[Finding] = []
    steps = [find_units] if ordered else [find_units, find_disorder]
    if isinstance(setup.file.machine, ThreePttSpec):
        steps += [
            find_travel,
            find_shift_unless_geometry,
            find_slip_besides,
            find_geometry,
            find_geometry,
            find_shift_unless_geometry,
            find_shuffled,
        ]
        steps += [find_far_targets]
        steps += [find_reach] if units_said else [find_speck, find_reach]
    else:
        steps += [find_arm]
    steps += [find_moved, find_directions, find_speed, find_noise]
    seen: set[tuple[object, Setup]] = set()
    for step in steps:
        if (step, setup) in seen or (step is find_moved and any(item.sure for item in findings)):
            continue  # nothing was undone since, or another sure finding takes precedence over a moved tracker
        seen.add((step, setup))
        found, after = step(setup)
        findings += found
        if any(item.sure or item.mistake == "target-frame" for item in found):
            setup = after
    of_arm = not isinstance(setup.file.machine, ThreePttSpec)
    for last in (find_tool,) if of_arm else (find_aside, find_own_frames):
        if not any(item.sure for item in findings):
            found, setup = last(setup)
            findings += found
    if any(item.sure for item in findings):
        return findings, setup  # what is wrong with the poses may be wrong with base reflectors too
    return findings + find_base(setup), setup


def find_shift_unless_geometry(setup: Setup) -> tuple[list[Finding], Setup]:
    """Shifted readings, unless a geometric mistake explains as much: on small paths both look alike."""
    if differ(setup):
        return [], setup
    rows = find_shifted_rows(setup)
    if rows[0] and not is_steep(rows[0][0]) and explains_more(setup, rows[1]):
        return [], setup
    return rows


def find_slip_besides(setup: Setup) -> tuple[list[Finding], Setup]:
    """Shifted readings that are also in another unit, left-handed, or both: neither shows alone."""
    if not is_off(setup) or differ(setup):
        return [], setup
    likely = suggested_by_readings(setup)
    for steps in dict.fromkeys((tuple(likely[:1]), tuple(likely[-1:]), (*likely[:1], *likely[-1:]))):
        found, cured = find_slip(undo_all(steps, setup)) if len(set(steps)) == len(steps) > 0 else ([], setup)
        if found and is_steep(replace(found[0], before_um=1e3 * left_beside_faults(setup))):
            slip = found[0]
            words = f"with {' and '.join(step.undone for step in steps)}, {slip.words}"
            return [
                *found,
                *(Finding(s.mistake, words, s.fix, slip.before_um, slip.after_um, True, slip.source) for s in steps),
            ], cured
    return [], setup


def _set_ups(file: MachineFile, table: Table) -> list[np.ndarray]:
    """Rows of each set-up of the tracker, (m,) int: of each file, or of each run where every run has its own frame.

    Readings of two set-ups differ by an arbitrary rigid motion; together they would look like another reflector.
    """
    if not table.rows:
        return [np.arange(0)]
    own = file.tracker.frame in OWN_FRAME
    of_run = range(len(table.run_label)) if own else table.run_file or (0,) * len(table.run_label)
    code = np.array(of_run)[table.run]
    return [np.flatnonzero(code == each) for each in dict.fromkeys(code.tolist())]


def _of_one_file(part: Table) -> Table:
    """The rows of one set-up as a table of the file they were read from."""
    source = part.file_of(part.run[0]) if part.rows else part.source
    return part.replace(source=source, files=(), run_file=())


def _together(parts: list[Table], places: list[np.ndarray]) -> Table:
    """Parts of one table put together in their original rows."""
    if len(parts) == 1:
        return parts[0]
    back = np.argsort(np.concatenate(places), kind="stable")
    columns = {
        each.name: np.concatenate([getattr(part, each.name) for part in parts])[back]
        for each in fields(Table)
        if all(isinstance(getattr(part, each.name), np.ndarray) for part in parts)
    }
    extra = {title: np.concatenate([part.extra[title] for part in parts])[back] for title in parts[0].extra}
    return parts[0].replace(**columns, extra=extra)
