"""The truth of a rig: the share of each hidden fault in the readings, and the residual of any choice of effects."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
import torch

from ptt.challenge.hide import called, clear_faults
from ptt.effects import Library
from ptt.effects.registry import make_effect, parse_key
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.model.model import Model, rival
from ptt.rig import Rig, simulate
from ptt.rig.draw import DrawnRig
from ptt.rig.platform import rotation_matrix
from ptt.rig.schedule import TARGET
from ptt.run.axes import rms_length
from ptt.run.frames import by_own, rigid_columns, rigid_part, without_rigid_parts
from ptt.run.from_columns import columns_to_table
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table

COUNTED_SIZE = 2.0  # times the noise of one reading: smaller faults need not be found
UNDETECTABLE = 25.0  # difference of chi-squared over a whole run, five sigma, below which two models are told by none
UM_PER_MM = 1e3
MRAD_PER_RAD = 1e3
READINGS = ["x_meas", "y_meas", "z_meas"]
TEXTS = ("name", "role", "run")


@dataclass(frozen=True)
class HiddenFault:
    """One hidden fault as it shows in the readings.

    Attributes:
        name: of the effect, or of a fault outside the library.
        values: keys and values of the rig.
        size: root mean square length of its signature, mm: of the readings with all faults less those without this
            one, less what the set-up may hold.
        counts: whether it is at least COUNTED_SIZE times the noise of one reading.
        known: whether an effect of the library describes it.
    """

    name: str
    values: Mapping[str, Any]
    size: float
    counts: bool
    known: bool


@dataclass(frozen=True)
class Truth:
    """A rig whose faults are known, and its run without noise.

    Attributes:
        drawn: rig, targets, faults.
        known: effects by name.
        noise: of one reading.
        problem: the run without noise, as a model sees it.
        faults: by size, largest first.
    """

    drawn: DrawnRig
    known: Library
    noise: Noise
    problem: Problem
    faults: tuple[HiddenFault, ...]

    @property
    def hidden(self) -> tuple[str, ...]:
        """Names of the hidden faults."""
        return tuple(fault.name for fault in self.faults)

    @cached_property
    def _left(self) -> dict[frozenset[str], FitResult]:
        return {}

    def fitted(self, keys: Iterable[str]) -> FitResult:
        """Fit effects to the run without noise, weighted by the noise it would have had.

        Args:
            keys: names, with [label] where they have one.

        Returns:
            The fit.
        """
        chosen = frozenset(keys)
        if chosen not in self._left:
            model = Model(self.problem.file)
            for key in sorted(chosen):
                effect = make_effect(self.known, *parse_key(key))
                # Of an arm's zeros and link parameters the latter, which are first in order, hold the former.
                model = model if rival(effect, model.keys) else model + effect
            self._left[chosen] = fit(model, self.problem, robust=False, noise=self.noise, lean=True, coarse=True)
        return self._left[chosen]

    def left(self, keys: Iterable[str]) -> float:
        """Chi-squared of effects fitted to the run without noise: the sum of squared residuals in units of its noise.

        It is the non-centrality of the test that would tell them from the truth on this run.

        Args:
            keys: names, with [label] where they have one.

        Returns:
            The sum over all coordinates.
        """
        return self.fitted(keys).chi2

    def left_rms(self, keys: Iterable[str]) -> float:
        """The same as a root mean square length over the readings, mm."""
        return rms_length(self.fitted(keys).residual[self.problem.used])


def find_truth(drawn: DrawnRig, known: Library) -> Truth:
    """Find the share of each fault of a rig in its run.

    Args:
        drawn: rig, targets, faults.
        known: effects of the library by name.

    Returns:
        The truth.
    """
    whole = simulate(drawn.rig, drawn.targets, noise=False)
    noise = reading_noise(drawn.rig, whole.truth)
    table = table_of(whole.frame)
    problem = build_problem(drawn.rig.machine, table).with_noise(noise)
    faults = [_fault(key, drawn, problem, noise, library_has=called(drawn.rig, key) in known) for key in drawn.truth]
    return Truth(drawn, known, noise, problem, tuple(sorted(faults, key=lambda fault: -fault.size)))


def reading_noise(rig: Rig, place: np.ndarray) -> Noise:
    """Noise of one reading, from the tracker's own figures.

    Args:
        rig: with its tracker.
        place: (n, 3) mm, measured points, base frame.

    Returns:
        The noise, averaged over the places, in the axes of the readings (those of a 3-PTT are turned by milliradians).
    """
    tracker = rig.tracker
    away = place - np.asarray(tracker.station_mm)
    distance = np.linalg.norm(away, axis=1)
    beam = away / distance[:, None]
    along = np.einsum("ni,nj->nij", beam, beam)
    if tracker.white_mm is not None:
        covariance = tracker.white_mm**2 * np.eye(3)
    else:
        side = (tracker.sideways_um_per_m * distance / UM_PER_MM**2) ** 2
        covariance = np.mean(
            (tracker.radial_um / UM_PER_MM) ** 2 * along + side[:, None, None] * (np.eye(3) - along), axis=0
        )
    if rig.serial is not None:  # a tracker beside an arm is turned any way, not by milliradians
        turn = rotation_matrix(np.asarray([tracker.rotation_mrad]) / MRAD_PER_RAD)[0]
        covariance = turn @ covariance @ turn.T
    own = np.square(tracker.axis_um) + tracker.quantum_um**2 / 12.0 + tracker.wander_um**2
    return Noise(covariance + np.diag(own) / UM_PER_MM**2, "truth")


def table_of(frame: pd.DataFrame, absent: Iterable[str] = ()) -> Table:
    """A simulated run as a table, as reading its file would give it.

    Args:
        frame: of a `RunResult`.
        absent: columns that are left out.

    Returns:
        The table.
    """
    titles = [str(title) for title in frame if title not in {*absent}]
    # copies: pandas hands out arrays that cannot be written
    columns = {title: np.array(frame[title], dtype=str if title in TEXTS else float) for title in titles}
    return columns_to_table(columns, "table", "").replace(run_sha256=())


def without_rigid_motion(shift: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Shifts less their best small rigid motion, by least squares.

    Args:
        shift: (n, 3) mm.
        place: (n, 3) mm, positions at which they are.

    Returns:
        (n, 3) mm.
    """
    return np.asarray(shift - rigid_part(shift, place))


def without_set_up(
    rig: Rig, shift: np.ndarray, place: np.ndarray, run: np.ndarray, mount: np.ndarray | None = None
) -> np.ndarray:
    """Shifts less what the tracker's set-up may hold: a rigid motion, one for each run, or nothing where it is known.

    Args:
        rig: its machine file says what is known of the frame.
        shift: (n, 3) mm.
        place: (n, 3) mm, positions at which they are.
        run: (n,), label or number of each row's run.
        mount: (n, 3, 3), of `mount_columns`, where the reflector's mount on an arm is fitted.

    Returns:
        (n, 3) mm.
    """
    policy = rig.machine.tracker.frame
    if mount is not None:
        held = [_by_run(mount, run, rig.machine.tracker.tool)]
        if policy in ("fitted", "fitted-per-run"):
            held.append(_by_run(rigid_columns(torch.tensor(place)).numpy(), run, policy))
        columns = np.concatenate(held, axis=-1).reshape(shift.size, -1)
        return np.asarray(shift - (columns @ np.linalg.lstsq(columns, shift.ravel(), rcond=None)[0]).reshape(-1, 3))
    if policy in ("trusted", "measured"):
        return shift
    return without_rigid_parts(shift, place, run) if policy == "fitted-per-run" else without_rigid_motion(shift, place)


def mount_columns(drawn: DrawnRig) -> np.ndarray | None:
    """Derivatives of the readings by the position of an arm's reflector along the tool's axes.

    Args:
        drawn: the rig.

    Returns:
        (n, 3, 3), last axis the tool's; None where the mount is known, and for a 3-PTT.
    """
    rig = drawn.rig
    if rig.serial is None or rig.machine.tracker.tool == "trusted":
        return None
    here, columns = simulate(rig, drawn.targets, noise=False).frame[READINGS].to_numpy(float), []
    for way in np.eye(3):
        moved = replace(rig, arm=rig.arm.model_copy(update={"reflector_mm": tuple(rig.arm.reflector_mm + way)}))
        columns.append(simulate(moved, drawn.targets, noise=False).frame[READINGS].to_numpy(float) - here)
    return np.stack(columns, axis=-1)


def in_base_frame(rig: Rig, columns: np.ndarray) -> np.ndarray:
    """Columns of shifts in the tracker's frame, (n, 3, c), in the base frame."""
    turn = rotation_matrix(np.asarray([rig.tracker.rotation_mrad]) / MRAD_PER_RAD)[0]
    return np.einsum("ji,njc->nic", turn, columns)


def seen_place(rig: Rig, frame: pd.DataFrame) -> np.ndarray:
    """Positions of readings, (n, 3) mm, for small rigid motions: the targets; of an arm the readings themselves."""
    # The frame beside a bench is turned by milliradians, that beside an arm any way.
    return np.array(frame[TARGET if rig.serial is None else READINGS], dtype=float)


def _fault(key: str, drawn: DrawnRig, problem: Problem, noise: Noise, *, library_has: bool) -> HiddenFault:
    without = table_of(simulate(clear_faults(drawn.rig, drawn.truth, [key]), drawn.targets, noise=False).frame)
    poses = problem.used
    mount = mount_columns(drawn)
    place = problem.table.target if drawn.rig.serial is None else problem.table.measured
    shift = (problem.table.measured - without.measured)[poses]
    if problem.base is not None:  # what moves base reflectors as well nobody sees
        shift = (problem.measured - build_problem(drawn.rig.machine, without).measured)[poses]
    held = None if mount is None else mount[poses]
    if held is not None and problem.base is not None:  # readings in the base frame
        held = in_base_frame(drawn.rig, held)
    size = rms_length(without_set_up(drawn.rig, shift, place[poses], problem.table.run[poses], held))
    return HiddenFault(called(drawn.rig, key), drawn.truth[key], size, size >= COUNTED_SIZE * noise.total, library_has)


def _by_run(columns: np.ndarray, run: np.ndarray, policy: str) -> np.ndarray:
    """Columns (n, 3, c), one set for each run where the policy is "fitted-per-run"."""
    return np.concatenate(by_own(columns, run), axis=-1) if policy == "fitted-per-run" else columns
