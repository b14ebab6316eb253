"""How well a model names what is hidden in a rig: found, missed, added wrongly; and what compensation makes of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from ptt.challenge.truth import MICRO, READINGS, UNSEEN, Fault, Truth, table_of
from ptt.correct.compensate import Correction, compensate
from ptt.errors import WorkspaceError
from ptt.model.model import Model, parameter_names
from ptt.rig import Rig, RunResult, simulate
from ptt.rig.draw import DrawnRig
from ptt.run.noise import Noise

Found = Literal["found", "explained", "missed", "too small"]
Named = Literal["right", "fair", "partial", "wrong"]


@dataclass(frozen=True)
class Judgement:
    """A choice of effects held against the truth.

    Attributes:
        faults: hidden fault -> 'found'; 'explained' (the effects named do all its work, by a computation on the truth);
            'missed'; 'too small' (it does not count, and was not named).
        named: effect -> 'right'; 'fair' (does the work of a fault under another name); 'partial' (helps with a fault
            that no effect describes); 'wrong'.
        instead: hidden fault -> effects that do its work under other names.
    """

    faults: dict[str, Found]
    named: dict[str, Named]
    instead: dict[str, tuple[str, ...]]

    @property
    def right(self) -> bool:
        """Whether everything that counts is found or explained, and nothing was added wrongly."""
        return "missed" not in self.faults.values() and not {"wrong", "partial"} & set(self.named.values())


@dataclass(frozen=True)
class ToolError:
    """Where the tool really went against where it was wanted, without noise, after the best rigid motion.

    The motion is one for each run where the machine file sets the tracker up anew each time, and none where it trusts
    the tracker's frame.

    Attributes:
        before: (n, 3) mm, with the controller's own commands.
        after: (n, 3) mm, with the model's commands; None where the machine cannot follow them.
        missed: by how much the commands themselves say that they miss their targets, (n,) mm, as at a reversal that no
            command can take; None where they cannot be sent.
    """

    before: np.ndarray
    after: np.ndarray | None
    missed: np.ndarray | None = None

    def to_dict(self) -> dict[str, dict[str, float] | None]:
        """Root mean squares for JSON, um."""
        return {"before": _rms(self.before), "after": None if self.after is None else _rms(self.after)}


@dataclass(frozen=True)
class Score:
    """What a model is worth, the seal opened.

    Attributes:
        judgement: effect by effect.
        faults: what was hidden.
        parameters: effect of the model -> (name, value, standard deviation or None).
        noise: of one reading.
        left_um: what the model's effects, fitted to the run without noise, leave of it.
        tool: the tool's error before and after compensation.
    """

    judgement: Judgement
    faults: tuple[Fault, ...]
    parameters: dict[str, tuple[tuple[str, float, float | None], ...]]
    noise: Noise
    left_um: float
    tool: ToolError

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "right": self.judgement.right,
            "hidden": [self._hidden(fault) for fault in self.faults],
            "named": [
                {"effect": key, "is": word, "parameters": self._parameters(key)}
                for key, word in self.judgement.named.items()
            ],
            "noise_um": self.noise.to_dict(),
            "left_um": self.left_um,
            "tool_error_um": self.tool.to_dict(),
        }

    def _hidden(self, fault: Fault) -> dict[str, Any]:
        return {
            "effect": fault.name,
            "is": self.judgement.faults[fault.name],
            "instead": list(self.judgement.instead.get(fault.name, ())),
            "size_um": MICRO * fault.size,
            "truth": dict(fault.values),
            "model": self._parameters(fault.name) if fault.name in self.parameters else None,
        }

    def _parameters(self, key: str) -> list[dict[str, Any]]:
        return [{"name": name, "value": value, "std": std} for name, value, std in self.parameters[key]]


def judge(keys: Sequence[str], truth: Truth) -> Judgement:
    """Hold the effects that were named against those that were hidden.

    A name that is not the hidden one is fair where a computation on the truth says that nobody could tell: the effects
    named are fitted to the run without noise, with and without the hidden one, and the difference stays unseen. Nothing
    but that decides, so exact ambiguities (all slider zeros and the tracker's z, tracker scale and links, radius, lead
    and zero together) and those of this one run are treated alike.

    Args:
        keys: effects named, with [label] where they have one.
        truth: what was hidden.

    Returns:
        The judgement.
    """
    extra = [key for key in keys if key not in truth.hidden]
    faults: dict[str, Found] = {}
    instead: dict[str, tuple[str, ...]] = {}
    for fault in truth.faults:
        if fault.name in keys:
            faults[fault.name] = "found"
        elif not fault.counts:
            faults[fault.name] = "too small"
        elif _explained(fault, keys, truth):
            faults[fault.name] = "explained"
            instead[fault.name] = tuple(key for key in extra if _works(key, keys, truth))
        else:
            faults[fault.name] = "missed"
    stands_in = {key for group in instead.values() for key in group}
    open_ = [fault for fault in truth.faults if faults[fault.name] == "missed"]
    odd = any(not fault.known for fault in open_)
    named: dict[str, Named] = {}
    for key in keys:
        if key in truth.hidden:
            named[key] = "right"
        elif odd and _works(key, keys, truth):
            named[key] = "partial"
        else:
            named[key] = "fair" if key in stands_in and not open_ else "wrong"
    return Judgement(faults, named, instead)


def score(model: Model, truth: Truth, correction: Correction | None = None) -> Score:
    """Score a fitted model.

    Args:
        model: effects with their parameters.
        truth: what was hidden.
        correction: what a network adds to the commands.

    Returns:
        The score.
    """
    return Score(
        judge(model.keys, truth),
        truth.faults,
        _read_parameters(model),
        truth.noise,
        MICRO * truth.left_rms(model.keys),
        remeasure(model, truth.drawn, correction),
    )


def remeasure(model: Model, drawn: DrawnRig, correction: Correction | None = None) -> ToolError:
    """Send a model's commands for the run's own targets to the rig, as the run has left it.

    What counts is where the run was read: of places that it only passed, on its way to a pose, no reading tells.

    Args:
        model: effects with their parameters.
        drawn: the rig and its targets.
        correction: what a network adds to the commands.

    Returns:
        The tool's error before and after.
    """
    drawn = replace(drawn, rig=as_left(drawn.rig))
    before = simulate(drawn.rig, drawn.targets, noise=False)
    poses = before.frame["role"] != "base"
    wanted = table_of(before.frame[poses])
    read, missed = before.frame[READINGS].notna().all(axis=1)[poses].to_numpy(), None
    try:
        commands = compensate(model, wanted, correction=correction)
        if not commands.sent.all():
            return ToolError(_error(before, drawn, read), None)
        missed = commands.missed[read]
        sent = pd.DataFrame(commands.q, columns=drawn.rig.sent)
        after = _error(simulate(drawn.rig, drawn.targets, sliders=sent, noise=False), drawn, read)
    except WorkspaceError:
        after = None
    return ToolError(_error(before, drawn, read), after, missed)


def as_left(rig: Rig) -> Rig:
    """The rig after its run: what slipped or was knocked over in the middle of it stays so.

    Args:
        rig: before its run.

    Returns:
        The same with slider or tripod off its place from the first row on.
    """
    for name, what in (("drive", "slip"), ("tracker", "knock")):
        section = getattr(rig, name)
        if getattr(section, f"{what}_row") is not None or getattr(section, f"{what}_time_s") is not None:
            off = section.model_copy(update={f"{what}_row": 0, f"{what}_time_s": None})
            rig = replace(rig, **{name: off})
    return rig


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


def _explained(fault: Fault, keys: Sequence[str], truth: Truth) -> bool:
    """Whether the effects named do all the work of a fault that was not."""
    if fault.known:
        return truth.left(keys) - truth.left([*keys, fault.name]) < UNSEEN
    return truth.left_rms(keys) < 0.5 * truth.noise.total


def _works(key: str, keys: Sequence[str], truth: Truth) -> bool:
    """Whether an effect takes something off the run without noise that the others do not."""
    return truth.left([other for other in keys if other != key]) - truth.left(keys) >= UNSEEN


def _error(run: RunResult, drawn: DrawnRig, read: np.ndarray) -> np.ndarray:
    poses = np.flatnonzero(run.frame["role"] != "base")[read]
    wanted, went = run.frame[["x_cmd", "y_cmd", "z_cmd"]].to_numpy(float)[poses], run.truth[poses]
    policy = drawn.rig.machine.tracker.frame
    if policy == "trusted":
        return went - wanted
    label = run.frame["run"].to_numpy()[poses] if policy == "fitted-per-run" else np.zeros(len(went))
    error = np.empty_like(went)
    for one in np.unique(label):
        rows = label == one
        goal, here = wanted[rows] - wanted[rows].mean(axis=0), went[rows] - went[rows].mean(axis=0)
        error[rows] = Rotation.align_vectors(goal, here)[0].apply(here) - goal
    return error


def _rms(error: np.ndarray) -> dict[str, float]:
    squares = MICRO**2 * np.square(error).mean(axis=0)
    axes: Mapping[str, float] = {axis: float(np.sqrt(square)) for axis, square in zip("xyz", squares, strict=True)}
    return {**axes, "total": float(np.sqrt(squares.sum()))}


def _read_parameters(model: Model) -> dict[str, tuple[tuple[str, float, float | None], ...]]:
    kind, parameters = model.file.machine.kind, {}
    for term in model.terms:
        names = parameter_names(term.effect, kind, model.joints)[: len(term.theta)]
        stds = [None] * len(names) if term.std is None else [float(std) for std in term.std]
        parameters[term.effect.key] = tuple(
            (name, float(value), None if std is None or not np.isfinite(std) else std)
            for name, value, std in zip(names, term.theta, stds, strict=True)
        )
    return parameters
