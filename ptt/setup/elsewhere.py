"""Readings or targets of a whole run that are off the commands by one rigid motion."""

from dataclasses import replace

import numpy as np

from ptt.run.axes import rms_length
from ptt.run.target_frame import RunFrame, find_frame, stated_frame
from ptt.setup.columns import said
from ptt.setup.fitted import FRAME_SLIP, frame_words
from ptt.setup.judged import BROKEN, MOST_ROWS, judge, thinned
from ptt.setup.proof import BEYOND_FAULTS, FALL
from ptt.setup.reach import out_of_reach
from ptt.setup.result import Finding
from ptt.setup.rigid import align_many, column_medians
from ptt.setup.rows import LEAST_KNOWN, places
from ptt.setup.score import forward_many
from ptt.setup.setup import Setup, used_rows

UNHEARD = 5.0  # mm: no ordinary fault moves all readings so far
HARDLY = 0.5  # share of moved targets out of reach from which it is not the targets that are off
UPRIGHT = 2.0  # mm sideways, within ordinary faults: a larger shift in z may then be one of all slider zeros
FREE_FRAME = 'write frame = "fitted" under [tracker], or register the tracker anew'


def find_own_frames(setup: Setup) -> tuple[list[Finding], Setup]:
    """Targets in a frame of their own, by the commands, that the machine file does not state.

    Every command of the program takes them as such, so nothing is wrong; but the user may not know.

    Args:
        setup: both files of a 3-PTT, the geometry in order, targets as in the frame that the machine file states.

    Returns:
        At most one finding, and the files as they are.
    """
    stated, table = stated_frame(setup.file.targets), setup.table
    if stated.source == "unknown" or table.command is None:
        return [], setup
    place, target = forward_many([setup])[0], stated.as_stated(table.target)
    runs = [(table.run == run) & used_rows(table) for run in np.unique(table.run)]
    frames = [find_frame(target[rows], place[rows], setup.file.targets) for rows in runs]
    known = np.isfinite(target).all(axis=1) & np.isfinite(place).all(axis=1)
    own = [(f, target[rows & known]) for f, rows in zip(frames, runs, strict=True) if f.source == "commands"]
    own = [(frame, points) for frame, points in own if len(points) >= LEAST_KNOWN and _way(frame, points) > FRAME_SLIP]
    if not own:
        return [], setup
    frame, points = own[0]
    away = rms_length(points - frame.into_base(points))
    apart = "" if len(own) == len(frames) == 1 else f" in {len(own)} of {len(frames)} runs"
    words = f"targets and commands differ by {1e3 * away:,.0f} um{apart}; the targets are stated in {frame.words}"
    fix = f"nothing has to be done if the targets are a workpiece's; to state it, write {_told(frame)} under [targets]"
    return [said(setup, "target-frame", words, fix, False)], setup


def find_aside(setup: Setup) -> tuple[list[Finding], Setup]:
    """Readings in a trusted frame that are all off by one rigid motion: of targets, reflector or frame.

    A platform only translates, so an offset of the reflector and one of the frame look the same.

    Args:
        setup: both files of a 3-PTT in which nothing else was found.

    Returns:
        At most one finding, and the files with the frame fitted, or the targets moved where no command says that the
        readings are off.
    """
    place, reading = places(setup), setup.table.measured
    known = np.isfinite(place).all(axis=1) & np.isfinite(reading).all(axis=1) & used_rows(setup.table)
    if setup.free or known.sum() < LEAST_KNOWN:
        return [], setup
    fitted = _with_fitted_frame(setup)
    before, after = (judge(thinned(each, MOST_ROWS), ()).agreement.rms for each in (setup, fitted))
    pair = 1 if np.isfinite(before[1]) else 0
    if not before[pair] > max(UNHEARD, FALL * after[pair]) or np.nan_to_num(after).max() > BEYOND_FAULTS:
        return [], setup
    turn, shift, left = (part[0] for part in align_many(place[known][None], reading[known][None]))
    apart = reading[known] - place[known]
    even = np.linalg.norm(apart - column_medians(apart), axis=1)
    shifted = float(np.median(even)) < max(2.0 * float(np.median(left)), BROKEN)
    motion = RunFrame("commands", np.eye(3), column_medians(apart)) if shifted else RunFrame("commands", turn, shift)
    how = f"all shifted by ({listed(motion.origin, 1)}) mm" if shifted else frame_words(turn, shift)
    cured = setup.with_rows(target=motion.into_base(setup.table.target))
    of_targets = not pair and (out_of_reach(cured) or 0.0) < HARDLY
    far, left_over = 1e3 * float(before[pair]), 1e3 * float(after[pair])
    words = (
        f"the readings differ from the {'commands' if pair else 'targets'} by {far:,.0f} um, {how}; with that motion "
        f"taken off the error falls to {left_over:,.0f} um: the frame is trusted, yet "
        f"{_who(motion, shifted, of_targets)}"
    )
    fix = FREE_FRAME
    if of_targets and stated_frame(setup.file.targets).source == "base":
        fix = f"write {_told(motion)} under [targets] if the targets are stated in that frame; if not, {fix}"
    elif shifted:
        fix += f"; or subtract ({listed(motion.origin, 3)}) mm from x_meas, y_meas, z_meas"
    found = said(setup, "target-frame" if of_targets else "wrong-reflector", words, fix)
    return [replace(found, before_um=far, after_um=left_over)], cured if of_targets else fitted


def _who(motion: RunFrame, shifted: bool, of_targets: bool) -> str:
    """What may be off, in words."""
    if of_targets:
        return f"targets and readings are in two frames{', or the reflector sits aside' if shifted else ''}"
    if not shifted:
        return "the readings are not in the base frame: the tracker stood elsewhere when it was registered"
    height = ", or all sliders count from another zero" if np.abs(motion.origin[:2]).max() < UPRIGHT else ""
    return f"the reflector, or the origin of the frame, lies that far aside{height}"


def _with_fitted_frame(setup: Setup) -> Setup:
    tracker = setup.file.tracker.model_copy(update={"frame": "fitted"})
    return replace(setup, file=replace(setup.file, tracker=tracker))


def _way(frame: RunFrame, target: np.ndarray) -> float:
    """Median displacement of targets by a frame, mm."""
    return float(np.median(np.linalg.norm(frame.into_base(target) - target, axis=1)))


def _told(frame: RunFrame) -> str:
    """Lines of the machine file that state a frame."""
    turned = float(np.linalg.norm(frame.turn_deg)) > 1e-4
    turn = f" and turn_deg = [{listed(frame.turn_deg, 4)}]" if turned else ""
    return f"origin_mm = [{listed(frame.origin, 3)}]{turn}"


def listed(values: np.ndarray, digits: int) -> str:
    """Numbers as a list in a machine file has them, rounded; none is minus zero."""
    return ", ".join(f"{value + 0.0:.{digits}f}" for value in np.round(values, digits))
