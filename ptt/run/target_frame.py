"""The frame in which targets are stated: the rigid motion from targets to the commands' nominal positions.

A controller may count targets in a workpiece's frame. A rigid motion that carries every target to the nominal position
of its command is then no accident: corrections in commands are far smaller, and no rigid motion removes them all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np
import torch

from ptt.errors import TableError
from ptt.machine import MachineFile
from ptt.machine_schema import TargetsSpec
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.rotations import rotation_vector
from ptt.record import Record
from ptt.run.frames import align
from ptt.run.table import Table

LIMIT = 5.0  # mm, median: corrections in commands are far smaller, swapped axes and other machines far larger
ARM_LIMIT = 20.0  # mm: commands may be encoder readings, which differ from the targets by no more
PURE = 0.01  # share of the distance left by a motion, below which nothing but a rigid motion lies between
TURNED = 0.01  # rad: larger than the rotation of any correction, 2 mm over 200 mm
SHIFTED = 1.0  # mm: a larger distance that is purely a rigid motion is no correction
WORTH = 0.1  # a rotation below `TURNED` is kept only if it leaves less than this share of what a shift leaves
LEAST_ROWS = 4  # fewest rows for a rotation
SEEN_MM = 0.05  # smaller shifts are not mentioned

Source = Literal["base", "stated", "commands", "unknown", "contrary"]


@dataclass(frozen=True, eq=False)
class RunFrame(Record):
    """How the targets of one run lie in the base frame: base = rotation @ target + origin.

    Attributes:
        source: 'base' (they are stated in it), 'stated' (by the machine file), 'commands' (found from them), 'unknown'
            (an arm's, for another tool), 'contrary' (no rigid motion makes them fit the commands).
        rotation: (3, 3).
        origin: (3,) mm.
        left: median distance that remains between targets and nominal positions of commands, mm; NaN without commands.
        rows: number of rows that it was found from.
        doubt: median displacement, mm, of a pure rigid motion between targets and commands that is small enough to be a
            correction; zero where there is none.
    """

    keys: ClassVar[str] = "source, origin_mm: origin, turn_deg, left_mm: left, rows"

    source: Source = "base"
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    left: float = float("nan")
    rows: int = 0
    doubt: float = 0.0

    @property
    def turn_deg(self) -> np.ndarray:
        """Rotation vector, (3,) degrees."""
        return np.degrees(rotation_vector(torch.from_numpy(self.rotation)).numpy())

    def into_base(self, target: np.ndarray) -> np.ndarray:
        """Targets (n, 3) mm as stated -> in the base frame."""
        return np.asarray(target @ self.rotation.T + self.origin) if self.source in MOVED else target

    def as_stated(self, place: np.ndarray) -> np.ndarray:
        """Places (n, 3) mm in the base frame -> as the run states targets."""
        return np.asarray((place - self.origin) @ self.rotation) if self.source in MOVED else place

    @property
    def words(self) -> str:
        """One line for a person."""
        origin = ", ".join(f"{value:.3f}" for value in self.origin)
        angle = float(np.linalg.norm(self.turn_deg))
        axis = ", ".join(f"{value:.3f}" for value in self.turn_deg)
        turned = f"turned by {angle:.3f} deg (rotation vector {axis})" if angle > 1e-4 else "not turned"
        told = f"from {self.rows} commands, {self.left:.3f} mm left over (median)"
        how = "as the machine file states" if self.source == "stated" else told
        return f"a frame of their own: its origin at ({origin}) mm of the base frame, {turned}; {how}"


MOVED = ("stated", "commands")


def target_frames(file: MachineFile, table: Table, *, corrected: bool = False) -> tuple[RunFrame, ...]:
    """Find the frame in which each run of a table states its targets.

    Args:
        file: the machine.
        table: n rows.
        corrected: whether the commands may hold a correction: then a rigid motion as small as one is no frame.

    Returns:
        One frame for each run.

    Raises:
        TableError: targets and slider commands that no rigid motion brings together, or targets in an unknown frame.
    """
    place = np.full((table.rows, 3), np.nan)
    if table.command is not None:
        known = np.isfinite(table.command).all(axis=1) & (table.role != "base")
        place[known] = build_mechanism(file.machine).forward(torch.tensor(table.command[known])).numpy()
    arm = file.machine.kind == "serial"
    frames = []
    for run, label in enumerate(table.run_label):
        here = table.run == run
        frame = find_frame(table.target[here], place[here], file.targets, arm=arm, corrected=corrected)
        _require_frame(frame, table, here, label if table.of_several_files else table.source)
        frames.append(frame)
    return tuple(frames)


def _require_frame(frame: RunFrame, table: Table, here: np.ndarray, where: str) -> None:
    if frame.source == "contrary":
        raise TableError(
            f"targets and slider commands disagree by {frame.left:.0f} mm (median)",
            where=where,
            fix="`ptt check` names mistakes in the set-up; where it finds none, is it another machine?",
        )
    alone = here & (table.role != "base") if table.command is None else here & np.isnan(table.command).all(axis=1)
    if frame.source == "unknown" and np.isfinite(table.target[alone]).any():
        raise TableError(
            "in which frame are these targets stated? The runs that the model was fitted to contradict each other",
            where=where,
            fix="write origin_mm and turn_deg under [targets] in the machine file, or give joint commands",
        )


def in_base(table: Table, frames: Sequence[RunFrame]) -> Table:
    """The table with its targets in the base frame.

    Args:
        table: n rows.
        frames: in which each run states its targets.

    Returns:
        The same table where they all are.
    """
    if all(frame.source == "base" for frame in frames):
        return table
    target = table.target.copy()
    for run, frame in enumerate(frames):
        target[table.run == run] = frame.into_base(table.target[table.run == run])
    return table.replace(target=target)


def stated_frame(spec: TargetsSpec) -> RunFrame:
    """The frame that a machine file states.

    Args:
        spec: its [targets] section.

    Returns:
        The frame; that of the base where the file states none.
    """
    if spec.frame == "unknown":
        return RunFrame("unknown")
    if not any(spec.origin_mm) and not any(spec.turn_deg):
        return RunFrame()
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(np.radians(spec.turn_deg)).as_matrix()
    return RunFrame("stated", turn, np.array(spec.origin_mm))


def kept_frame(spec: TargetsSpec, frames: Sequence[RunFrame]) -> TargetsSpec:
    """The [targets] section that a model keeps for later targets.

    Args:
        spec: the section so far.
        frames: those of the runs it was fitted on.

    Returns:
        The frame that all runs share, 'unknown' where they differ; the section so far where no commands determine it.
    """
    told = [frame for frame in frames if frame.rows]
    if not told or spec.frame == "base":
        return spec
    specs = {_spec(frame, spec) for frame in told}
    first = specs.pop()
    alike = all(np.allclose(each.origin_mm, first.origin_mm, atol=SEEN_MM) for each in specs)
    alike &= all(np.allclose(each.turn_deg, first.turn_deg, atol=np.degrees(SEEN_MM / 1e3)) for each in specs)
    alike &= all(each.frame == first.frame for each in specs)
    return first if alike else TargetsSpec(frame="unknown")


def find_frame(
    target: np.ndarray, place: np.ndarray, spec: TargetsSpec, *, arm: bool = False, corrected: bool = False
) -> RunFrame:
    """Find how the targets of one run lie in the base frame.

    Args:
        target: (n, 3) mm, as stated, NaN where there is none.
        place: (n, 3) mm, nominal positions of the commands, NaN where there is no command.
        spec: what the machine file states.
        arm: a serial arm, whose commands may be encoders' readings and whose targets may be of another tool.
        corrected: whether the commands may hold a correction.

    Returns:
        The frame.
    """
    known = stated_frame(spec)
    rows = np.isfinite(target).all(axis=1) & np.isfinite(place).all(axis=1)
    if not rows.any():
        return known
    wanted, asked = target[rows], place[rows]
    tried = [replace(each, left=_left(each, wanted, asked), rows=len(wanted)) for each in (known, RunFrame())]
    best = min((each for each in tried if each.source != "unknown"), key=lambda each: each.left)
    own = _own_frame(wanted, asked) if spec.frame != "base" else best
    angle = np.radians(np.linalg.norm(own.turn_deg))
    pure = own.left < PURE * best.left
    sure = pure and not arm and not corrected and (angle > TURNED or best.left > SHIFTED)
    if best.left <= (ARM_LIMIT if arm else LIMIT) and not sure:
        return replace(best, doubt=best.left if pure and best.left > SEEN_MM and not arm else 0.0)
    if own.left <= LIMIT and spec.frame != "base" and not _mirrored(wanted, asked, own):
        return own
    return replace(best, source="unknown" if arm else "contrary", left=min(best.left, own.left))


def _own_frame(target: np.ndarray, place: np.ndarray) -> RunFrame:
    """The rigid motion by the commands: a shift, with a rotation where that is large or leaves far less."""
    shifted = RunFrame("commands", np.eye(3), np.median(place - target, axis=0))
    shifted = replace(shifted, left=_left(shifted, target, place), rows=len(target))
    spread = np.linalg.svd(target - target.mean(axis=0), compute_uv=False) / np.sqrt(len(target))
    if len(target) < LEAST_ROWS or spread[1] < 1.0:  # mm: points on a line leave the turn about it open
        return shifted
    turn, shift = align(target, place)
    turned = RunFrame("commands", turn, shift)
    turned = replace(turned, left=_left(turned, target, place), rows=len(target))
    far = np.radians(np.linalg.norm(turned.turn_deg)) > TURNED
    return turned if far or turned.left < WORTH * shifted.left else shifted


def _left(frame: RunFrame, target: np.ndarray, place: np.ndarray) -> float:
    return float(np.median(np.linalg.norm(frame.into_base(target) - place, axis=1)))


def _mirrored(target: np.ndarray, place: np.ndarray, own: RunFrame) -> bool:
    """Whether a large turn cannot be told from swapped or reversed axes, because all targets lie in a plane."""
    if np.linalg.norm(own.turn_deg) < 90.0:
        return False
    flipped = target * [1.0, 1.0, -1.0]
    turn, shift = align(flipped, place)
    left = float(np.median(np.linalg.norm(flipped @ turn.T + shift - place, axis=1)))
    upright = own.rotation[2, 2] > 0.0
    return left <= LIMIT and not upright


def _spec(frame: RunFrame, spec: TargetsSpec) -> TargetsSpec:
    """A run's frame as a machine file states it."""
    if frame.source == "stated":
        return spec
    if frame.source == "unknown":
        return TargetsSpec(frame="unknown")
    origin, turn = (tuple(round(float(value), 6) for value in values) for values in (frame.origin, frame.turn_deg))
    return TargetsSpec(origin_mm=origin, turn_deg=turn)  # type: ignore[arg-type]
