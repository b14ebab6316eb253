"""One identification problem: view, readings near the base frame, tracker frames, mounts and noise."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.errors import TooFewError
from ptt.machine import MachineFile
from ptt.run.base_frame import base_readings, from_base, from_poses, into_base, refuse_untrue
from ptt.run.base_readings import BaseReadings
from ptt.run.copies import pasted_rows
from ptt.run.driven import as_driven
from ptt.run.frames import rotation
from ptt.run.given_noise import given_noise
from ptt.run.mounts import find_mounts, mount_of_rows
from ptt.run.noise import Noise
from ptt.run.reach import require_closed, require_held
from ptt.run.rounded import SEEN, left_by_rounding, unrounded
from ptt.run.table import Table
from ptt.run.target_frame import RunFrame, in_base, target_frames
from ptt.run.view import View
from ptt.run.viewing import build_view

# Usual sizes of frame and mount in the prior: far wider than errors of the machine, so that what the data cannot tell
# apart goes to the frame, not to machine parameters.
SHIFT_USUAL = 10.0  # mm
TURN_USUAL = 0.05  # rad
MOUNT_USUAL = 10.0  # mm


@dataclass(frozen=True)
class Problem:
    """Readings and everything that is needed to predict them.

    Attributes:
        file: the machine.
        table: n rows in travel order.
        view: the same rows as effects see them.
        measured: readings after a first rigid motion into the base frame, (n, 3) mm, NaN where not observed.
        used: rows whose readings enter a fit, (n,) bool: poses and datums that are observed and not masked.
        frame: index of each row's tracker frame, (n,) int.
        frames: number of frames to be fitted; zero where the frame is trusted.
        mount: index of the reflector mount of each row, (n,) int; -1 where the tool point is trusted.
        mounts: number of mounts to be fitted; the view has their first values, fitted with the drawing.
        rotation: of the first rigid motion, reading_base = (reading - shift) @ rotation, (f, 3, 3).
        shift: of the first rigid motion, (f, 3) mm.
        base: readings of base reflectors, None unless the frame is measured.
        noise: the noise floor by the data or the machine file, else None.
        stated_in: the frame in which each run states its targets.
        rounded: `ptt.run.rounded.left_by_rounding`: step of joint commands, mm or degrees, and rms tool displacement by
            rounding, mm.
    """

    file: MachineFile
    table: Table
    view: View
    measured: np.ndarray
    used: np.ndarray
    frame: np.ndarray
    frames: int
    mount: np.ndarray
    mounts: int
    rotation: np.ndarray
    shift: np.ndarray
    base: BaseReadings | None
    noise: Noise | None
    stated_in: tuple[RunFrame, ...] = ()
    rounded: tuple[float, float] = (0.0, 0.0)

    @property
    def target(self) -> np.ndarray:
        """Wanted positions of the reflector in the base frame, (n, 3) mm; nominal positions where there are no targets.

        On an arm a reflector offset is added in the nominal pose. Targets that its controller states for another tool
        than the drawing's are replaced by nominal positions of the commands.
        """
        nominal, target = self.view.p.numpy(), self._in_base(self.table.target)
        if self.file.machine.kind == "serial" and np.isfinite(target).any():
            target = target + (nominal - self.view.mechanism.forward(self.view.q).numpy())
        return np.where(np.isfinite(target), target, nominal)

    @property
    def stated(self) -> np.ndarray:
        """Wanted tool positions as the runs state them, each in its own frame, (n, 3) mm."""
        place = self.target.copy()
        for run, frame in enumerate(self.stated_in):
            here = self.table.run == run
            place[here] = frame.as_stated(place[here])
        return place

    @property
    def two_sided(self) -> np.ndarray:
        """Joints that arrive from both directions at used rows, (k,) bool: in others play is only an offset."""
        direction = self.view.direction.numpy()[self.used]
        return np.asarray((direction > 0.0).any(axis=0) & (direction < 0.0).any(axis=0))

    def _in_base(self, target: np.ndarray) -> np.ndarray:
        """Targets (n, 3) mm of the table moved into the base frame, NaN where that is not known."""
        moved = target.copy()
        for run, frame in enumerate(self.stated_in):
            here = self.table.run == run
            moved[here] = np.nan if frame.source == "unknown" else frame.into_base(target[here])
        return moved

    def masked(self, hidden: np.ndarray) -> "Problem":
        """The same rows in the same travel with some readings hidden.

        Args:
            hidden: (n,) bool.

        Returns:
            The problem with those rows unused.
        """
        return replace(self, used=self.used & ~hidden)

    def anchored(self, told: np.ndarray | None = None) -> "Problem":
        """The same problem with the tracker frames fixed by the base reflectors, where there are any.

        Otherwise thousands of pose readings would outweigh a dozen of the reflectors and pull the frame toward whatever
        a model does not explain yet.

        Args:
            told: predicted readings of the base reflectors, (m, 3) mm; None for their drawn positions.
        """
        if self.base is None:
            return self
        held = replace(self, frames=0, base=None)
        if told is None:
            return held
        rotations, shifts = self.base.frames_beside(told, self.frames)
        measured = into_base(self.measured, self.frame, rotations, shifts)
        shifts = self.shift + np.einsum("fij,fj->fi", self.rotation, shifts)
        return replace(held, measured=measured, rotation=self.rotation @ rotations, shift=shifts)

    @property
    def rounding(self) -> tuple[float, float]:
        """`rounded`, or zeros where it is below the noise."""
        hidden = self.noise is not None and self.rounded[1] < SEEN * self.noise.total
        return (0.0, 0.0) if hidden else self.rounded

    def with_noise(self, noise: Noise) -> "Problem":
        """The same problem with a noise floor."""
        return replace(self, noise=noise)


def build_problem(file: MachineFile, table: Table) -> Problem:
    """Bring a table and its machine together.

    Args:
        file: the machine.
        table: n rows in travel order.

    Returns:
        The problem.

    Raises:
        WorkspaceError: targets or commands out of reach.
        PosesError: the drawing is singular at a reading.
        TableError: too few readings, targets and slider commands that contradict each other, or base reflectors
            missing that the machine file relies on.
    """
    stated_in = target_frames(file, table)
    asked = in_base(table, stated_in)
    sent = unrounded(file, asked)
    view = as_driven(build_view(file, sent), table)
    observed = np.isfinite(table.measured).all(axis=1)
    read = observed & (table.role != "base")
    used = read & ~pasted_rows(table)
    _require_places(file, table, view, used)
    policy = file.tracker.frame
    if policy == "trusted":
        refuse_untrue(table, view.p.numpy(), stated_in, used)
    if used.sum() < 4:
        raise TooFewError(f"only {used.sum()} readings", where=table.source, fix="at least 4 measured rows are needed")
    fitted, of_runs = policy in ("fitted", "fitted-per-run"), policy in ("fitted-per-run", "measured")
    frame = np.asarray(table.run, dtype=int) if of_runs else np.zeros(table.rows, dtype=int)
    count = int(frame.max()) + 1
    mount = mount_of_rows(file, table)
    rotations, shifts = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    seen = from_base(file, table, frame, count) if policy == "measured" else None
    if seen is not None:
        rotations, shifts = seen.rotations, seen.shifts
    if mount.max() >= 0:
        near = into_base(table.measured, frame, rotations, shifts)
        view = find_mounts(view, near, used, mount, frame, free=fitted)
    if fitted:
        rotations, shifts = from_poses(view, table, read, frame, count)
    measured = into_base(table.measured, frame, rotations, shifts)
    # Encoders that report where an arm stands differ a little from repeat to repeat, and so does its place.
    scatter = measured - view.p.numpy() if file.machine.kind == "serial" else measured
    noise = given_noise(table, scatter, view.direction.numpy(), file.tracker.sigma_mm, rotations, frame)
    base = None if seen is None else base_readings(file, table, view, measured, frame, seen)
    rounded = left_by_rounding(file, asked, view.jacobian.numpy()) if sent is asked else (0.0, 0.0)
    frames = 0 if policy == "trusted" else count
    mounts = int(mount.max()) + 1
    return Problem(
        file, table, view, measured, used, frame, frames, mount, mounts, rotations, shifts, base, noise, stated_in,
        rounded,
    )  # fmt: skip


def _require_places(file: MachineFile, table: Table, view: View, used: np.ndarray) -> None:
    """Refuse readings at joint values that do not determine a tool position, since no frame could be aligned."""
    known = torch.isfinite(view.p).all(dim=1) & torch.isfinite(view.jacobian).flatten(1).all(dim=1)
    lost = used & ~known.numpy()
    told = np.zeros_like(lost) if table.command is None else np.isfinite(table.command).all(axis=1)
    require_closed(table, lost & told & ~np.isfinite(view.p.numpy()).all(axis=1))
    require_held(table, lost, file.source)


def apply_frames(reading: Tensor, frame: np.ndarray, parameters: Tensor) -> tuple[Tensor, Tensor]:
    """Move base-frame readings by the small rigid motions that the fit still finds.

    Args:
        reading: (n, 3) mm.
        frame: (n,) int, frame of each row.
        parameters: (f, 6), rotation vector in rad after translation in mm.

    Returns:
        Moved readings (n, 3), and their derivative by the own frame's six parameters, (n, 3, 6).
    """
    rotations, by_vector = rotation(parameters[:, 3:])
    index = torch.as_tensor(frame)
    moved = torch.einsum("nij,nj->ni", rotations[index], reading)
    turned = torch.einsum("nijc,nj->nic", by_vector[index], reading)
    eye = torch.eye(3, dtype=reading.dtype).expand(len(reading), 3, 3)
    return moved + parameters[index, :3], torch.cat([eye, turned], dim=-1)
