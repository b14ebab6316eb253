"""A rig measured again without noise, with the commands of a model: the errors of its tool."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from ptt.challenge.truth import READINGS, in_base_frame, mount_columns, table_of, without_set_up
from ptt.correct.compensate import compensate
from ptt.correct.task import Correction
from ptt.errors import WorkspaceError
from ptt.model.model import Model
from ptt.rig import Rig, RunResult, simulate
from ptt.rig.arm_odd_schema import SlippingTool
from ptt.rig.draw import DrawnRig
from ptt.run.axes import rms


@dataclass(frozen=True)
class ToolError:
    """True positions of the tool less the targets, without noise, less what the set-up may hold.

    That is the best rigid motion, one for each run where the machine file fits a frame per run, none where it trusts
    the frame; and of an arm whose reflector's mount is fitted a shift that moves with the tool. A frame measured by
    base reflectors counts as fitted, since a diagnosis frees it, and its held-out error is without it.

    Attributes:
        before: (n, 3) mm, with the controller's own commands.
        after: (n, 3) mm, with the model's commands; None where the machine cannot follow them.
        missed: by how much the commands themselves say that they miss their targets, (n,) mm, as at a reversal that no
            command can take; None where they cannot be sent.
        sigma: what the commands say that is uncertain of where the tool will be, (n,) mm, NaN where nothing tells; None
            where they cannot be sent.
    """

    before: np.ndarray
    after: np.ndarray | None
    missed: np.ndarray | None = None
    sigma: np.ndarray | None = None

    def to_dict(self) -> dict[str, dict[str, float] | None]:
        """Root mean squares for JSON, um."""
        return {"before": rms(self.before), "after": None if self.after is None else rms(self.after)}


def remeasure(model: Model, drawn: DrawnRig, correction: Correction | None = None) -> ToolError:
    """Run a rig, as its run has left it, with a model's commands for the run's own targets.

    Errors are taken at the rows that are read, not where the run only passes.

    Args:
        model: effects with their parameters.
        drawn: the rig and its targets.
        correction: what a network adds to the commands; None without one.

    Returns:
        The tool's error before and after.
    """
    drawn = replace(drawn, rig=as_left(drawn.rig))
    before = simulate(drawn.rig, drawn.targets, noise=False)
    poses = before.frame["role"] != "base"
    wanted = table_of(before.frame[poses])
    read, missed, sigma = before.frame[READINGS].notna().all(axis=1)[poses].to_numpy(), None, None
    mount = mount_columns(drawn)
    try:
        commands = compensate(model, wanted, correction=correction)
        if not commands.sent.all():
            return ToolError(_error(before, drawn, read, mount), None)
        missed, sigma = commands.missed[read], commands.sigma[read]
        sent = pd.DataFrame(commands.q, columns=drawn.rig.sent)
        after = _error(simulate(drawn.rig, drawn.targets, sliders=sent, noise=False), drawn, read, mount)
    except WorkspaceError:
        after = None
    return ToolError(_error(before, drawn, read, mount), after, missed, sigma)


def as_left(rig: Rig) -> Rig:
    """The rig after its run: what slipped or was knocked in the middle of it stays so.

    Args:
        rig: before its run.

    Returns:
        The same with slider or tripod off its place from the first row on.
    """
    for name, what in (("drive", "slip"), ("arm", "slip"), ("tracker", "knock")):
        section = getattr(rig, name)
        times = [key for key in (f"{what}_row", f"{what}_time_s") if getattr(section, key, None) is not None]
        if times:
            off = section.model_copy(update=dict.fromkeys(times) | {f"{what}_row": 0})
            rig = replace(rig, **{name: off})
    slipped = (item.model_copy(update={"share": 0.0}) if isinstance(item, SlippingTool) else item for item in rig.odd)
    return replace(rig, odd=tuple(slipped))


def to_run_again(rig: Rig) -> Rig:
    """The rig as its run has left it, for targets that list that run whole: each visit and each cycle's load.

    Args:
        rig: before its run.

    Returns:
        The same with nothing that would be visited more often than it is listed.
    """
    left = as_left(rig)
    conditions = left.conditions.model_copy(update={"cycles": 1})
    return replace(left, conditions=conditions, tracker=left.tracker.model_copy(update={"datum_every": 0}))


def _error(run: RunResult, drawn: DrawnRig, read: np.ndarray, mount: np.ndarray | None) -> np.ndarray:
    poses = np.flatnonzero(run.frame["role"] != "base")[read]
    wanted, went = run.frame[["x_cmd", "y_cmd", "z_cmd"]].to_numpy(float)[poses], run.truth[poses]
    machine, policy = drawn.rig.machine, drawn.rig.machine.tracker.frame
    if mount is not None:
        label = run.frame["run"].to_numpy()[poses]
        frame = "fitted" if policy == "measured" else policy
        rig = replace(drawn.rig, machine=replace(machine, tracker=machine.tracker.model_copy(update={"frame": frame})))
        return without_set_up(rig, went - wanted, wanted, label, in_base_frame(rig, mount[poses]))
    if policy == "trusted":
        return went - wanted
    label = run.frame["run"].to_numpy()[poses] if policy == "fitted-per-run" else np.zeros(len(went))
    error = np.empty_like(went)
    for one in np.unique(label):
        rows = label == one
        goal, here = wanted[rows] - wanted[rows].mean(axis=0), went[rows] - went[rows].mean(axis=0)
        error[rows] = Rotation.align_vectors(goal, here)[0].apply(here) - goal
    return error
