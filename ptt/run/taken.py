"""What the set-up took before any physics is looked at: the frame of the targets, and the tracker's."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch

from ptt.mechanisms.rotations import rotation_vector
from ptt.run.axes import rms_length
from ptt.run.problem import Problem
from ptt.run.rounded import rounded_to
from ptt.run.target_frame import in_base

WORTH_MM = 1.0  # of way, root mean square: less is what any set-up takes, and no machine is built off by more unseen
MUCH_LESS = 0.1  # of the way to the drawing's places: a tracker elsewhere would not happen to read the targets' own
SHARED = "several runs"
SHOWN_FRAMES = 3  # named in a message


def set_up(problem: Problem) -> dict[str, Any]:
    """What the frames took, for JSON.

    Args:
        problem: the readings.

    Returns:
        'target_frame': run, source, origin_mm, turn_deg, left_mm, rows of each run whose targets are not stated in the
        base frame; 'frame_taken': run, shift_mm, turn_deg, rms_mm of each tracker frame, and how far readings lay from
        their targets as they come (as_read_mm) and from where the drawing puts them before the frame was taken off and
        after it (before_mm, after_mm); drawing_off: whether that tells of a wrong drawing, not of the tracker's place.
    """
    labels = problem.table.run_label
    moved = [(labels[run], frame) for run, frame in enumerate(problem.stated_in) if frame.source != "base"]
    return {
        "target_frame": [{"run": label, **frame.to_dict()} for label, frame in moved],
        "frame_taken": _taken(problem),
    }


def set_up_lines(problem: Problem) -> list[str]:
    """What the frames took, in words; what any set-up takes is not mentioned.

    Args:
        problem: the readings.

    Returns:
        One line for each frame that took more, for each base reflector that holds none, and for rounded commands.
    """
    lines, labels = [], problem.table.run_label
    for run, frame in enumerate(problem.stated_in):
        where = f"{labels[run]}: " if len(labels) > 1 else ""
        if frame.source == "unknown":
            lines.append(f"{where}targets are stated for another tool or base than the drawing's; the commands count")
        elif frame.source != "base":
            lines.append(f"{where}targets are stated in {frame.words}{_turned_about(frame.turn_deg, frame.origin)}")
        elif frame.doubt:
            lines.append(
                f"{where}commands and targets differ by one rigid motion, {frame.doubt:.3f} mm (median): taken as a"
                " correction that was sent; if targets have a frame of their own, state it under [targets] in the"
                " machine file"
            )
    arm = problem.file.machine.kind == "serial"
    lines += [_frame_words(taken, arm=arm) for taken in _taken(problem) if taken["rms_mm"] > WORTH_MM]
    lines += _rounding_words(problem, "deg" if arm else "mm")
    if arm and problem.table.command is None:
        lines.append("no joint commands: at each target the posture nearest the middle of the joints is assumed")
    return lines + _base_words(problem)


def rounded_words(step: float, unit: str) -> str:
    """What is done with joint commands that are rounded to a step, in a unit."""
    return f"joint commands are those of the targets, rounded to {step:g} {unit}; the targets tell finer and count"


def _rounding_words(problem: Problem, unit: str) -> list[str]:
    """Joint commands of few digits: what is taken for them, or what their rounding may look like."""
    table = in_base(problem.table, problem.stated_in)
    if step := rounded_to(problem.file, table):
        return [rounded_words(step, unit)]
    step, aside = problem.rounding
    if not step:
        return []
    return [
        f"joint commands are written in steps of {step:g} {unit}: if the controller was sent more digits, rounding "
        f"alone puts the tool {1e3 * aside:.1f} um (rms) aside, differently at each pose, which no effect explains; "
        "export more digits, or the targets as well"
    ]


def frames_said(taken: Sequence[Mapping[str, Any]]) -> list[str]:
    """Errors before and after frame alignment, a line for each of the first frames; none where the frame is trusted.

    Args:
        taken: 'frame_taken' of `set_up`.
    """
    lines = []
    for frame in taken[:SHOWN_FRAMES]:
        if frame["before_mm"] is None or frame["after_mm"] is None:
            continue
        whose = f" of {frame['run']}" if len(taken) > 1 and frame["run"] else ""
        lines.append(
            f"tracker frame{whose}: readings lay {1e3 * frame['before_mm']:,.1f} um (rms) from where the drawing puts"
            f" them, {1e3 * frame['after_mm']:,.1f} um after alignment"
        )
    more = len(taken) - SHOWN_FRAMES
    return [*lines, f"and {more} more frame{'s' if more > 1 else ''}"] if more > 0 else lines


def _base_words(problem: Problem) -> list[str]:
    """Base reflectors, and single readings of some, that do not hold a frame."""
    if problem.base is None or not problem.base.aside.any():
        return []
    table, aside = problem.table, problem.base.aside
    read = (table.role == "base") & np.isfinite(table.measured).all(axis=1)
    lines = []
    for frame, own in dict.fromkeys(zip(problem.frame[aside].tolist(), table.name[aside].tolist(), strict=True)):
        here = read & (table.name == own) & (problem.frame == frame)
        count, of = int((here & aside).sum()), int(here.sum())
        label = table.run_label[table.run[here][0]]
        who = f"{label}: base reflector {own}" if len(table.run_label) > 1 and label else f"base reflector {own}"
        why = "judging by its distances to the others,"
        if count < of:
            some = "one" if count == 1 else str(count)
            lines.append(f"{who}: {some} of {of} readings left out; {why} it was misread")
        else:
            lines.append(
                f"{who} is left out: {why} it is not where [[tracker.base_point]] has it, or was misread each time; "
                "check its xyz_mm and its name in the run"
            )
    return lines


def _frame_words(taken: dict[str, Any], *, arm: bool) -> str:
    """What a tracker frame took, and where the drawing is to blame for it rather than the tracker's place."""
    where = f"{taken['run']}: " if taken["run"] else ""
    shift = ", ".join(f"{value:.3f}" for value in taken["shift_mm"])
    angle = float(np.linalg.norm(taken["turn_deg"]))
    words = (
        f"{where}frame alignment shifted the readings by ({shift}) mm and turned them by {angle:.3f} deg: they lay"
        f" {taken['before_mm']:.3f} mm (rms) from where the drawing puts them, {taken['after_mm']:.3f} mm after it"
    )
    if not taken["drawing_off"]:
        return words
    return (
        f"{words}; unaligned they lie only {taken['as_read_mm']:.3f} mm from their targets, so the tracker's position "
        "is not the cause: the drawing or the commands are wrong; check "
        + ("lengths, offsets and convention of the joints" if arm else "radii, link length, slider zeros and side")
    )


def _drawing_off(near: float | None, before: float | None, after: float | None, in_base: bool) -> bool:
    """Readings near their targets, far from the drawing's places: another frame of both, or a wrong drawing.

    Another frame of both would be stated or found, and leave no more than readings are off their targets.
    """
    if near is None or before is None or after is None or near > MUCH_LESS * before:
        return False
    return in_base or 2.0 * near < after


def _taken(problem: Problem) -> list[dict[str, Any]]:
    """Motion of the readings from the base frame, frame by frame; none where the frame is trusted."""
    found = []
    for index in range(len(problem.rotation)) if problem.file.tracker.frame != "trusted" else ():
        here = problem.used & (problem.frame == index)
        if not here.any():
            continue
        way = problem.table.measured[here] - problem.measured[here]
        read, place = problem.table.measured[here], problem.view.p.numpy()[here]
        stages = _rms(read - problem.table.target[here]), _rms(read - place), _rms(problem.measured[here] - place)
        runs = np.unique(problem.table.run[here])
        in_base = all(frame.source == "base" for frame in problem.stated_in)
        label = problem.table.run_label[runs[0]] if len(runs) == 1 else SHARED
        turn = np.degrees(rotation_vector(torch.from_numpy(problem.rotation[index])).numpy())
        found.append(
            {
                "run": label,
                "shift_mm": problem.shift[index].tolist(),
                "turn_deg": turn.tolist(),
                "rms_mm": _rms(way),
                **dict(zip(("as_read_mm", "before_mm", "after_mm"), stages, strict=True)),
                "drawing_off": _drawing_off(*stages, in_base),
            }
        )
    return found


def _rms(way: np.ndarray) -> float | None:
    """Root mean square length, mm; None where there is nothing to measure."""
    known = way[np.isfinite(way).all(axis=1)]
    return rms_length(known) if len(known) else None


def _turned_about(turn_deg: np.ndarray, origin: np.ndarray) -> str:
    """A half turn about z without a shift is what interchanged radii look like."""
    half = abs(abs(turn_deg[2]) - 180.0) < 1.0 and np.abs(turn_deg[:2]).max() < 1.0
    return " (are base and platform radius interchanged?)" if half and np.abs(origin).max() < WORTH_MM else ""
