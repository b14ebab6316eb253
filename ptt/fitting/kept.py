"""What a fit leaves uncertain, kept in the machine file, and what that means for the tool at any target."""

import base64
import hashlib
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ptt.effects.base import Effect, Parameter
from ptt.effects.layout import sizes
from ptt.fitting.chunks import CHUNK, view_chunks
from ptt.fitting.layout import FRAME_NAMES, MOUNT_NAMES
from ptt.fitting.result import FitResult
from ptt.machine_schema import CovarianceSpec, MaskedSpec
from ptt.model.chain import Shifts, linearise
from ptt.model.entries import write_model
from ptt.model.model import Model, parameter_names
from ptt.run.problem import apply_frames
from ptt.run.view import View

STEEP = 5.0  # slope of a bow at its end, in heights of the bow a length of the curve


@dataclass(frozen=True)
class Kept:
    """The joint covariance of a model's parameters and the frame, as a factor: covariance = root @ root.T.

    Attributes:
        names: one for each row, (u,); parameters as 'backlash gap_mm 2', then mount and frame.
        root: (u, r), in the parameters' own units.
        heldout: error of rows that the fit had not seen, root mean square in total, mm; None where not known.
        helped: whether these were foretold better than by the drawing, beyond chance; None where nobody knows.
        masked: what its run says of effects that the model does not have (`ptt.fitting.masked`).
    """

    names: tuple[str, ...]
    root: np.ndarray
    heldout: float | None = None
    helped: bool | None = None
    masked: MaskedSpec | None = None

    @property
    def promised(self) -> float | None:
        """How sure a command should be, mm: nothing is where the drawing foretold as well what the fit had not seen."""
        return 0.0 if self.helped is False else self.heldout

    def rows(self, names: Sequence[str]) -> np.ndarray:
        """Rows of the root by name, (len(names), r); zero for what the fit held."""
        place = {name: number for number, name in enumerate(self.names)}
        blank = np.zeros(self.root.shape[1])
        return np.array([self.root[place[name]] if name in place else blank for name in names]).reshape(-1, len(blank))


def keep_covariance(
    fitted: FitResult, heldout: float | None = None, helped: bool | None = None
) -> CovarianceSpec | None:
    """What a machine file keeps of a fit.

    Of several tracker frames the first one's is kept: what a frame takes is nothing that a command could mend.

    Args:
        fitted: the fit.
        heldout: error of rows that it had not seen, mm; None where not known.
        helped: whether these were foretold better than by the drawing; None where nobody knows.

    Returns:
        The section of the file; None where nothing was fitted.
    """
    if not len(fitted.unknowns):
        return None
    names = [_plain_name(name, fitted.layout.frames, fitted.layout.mounts) for name in fitted.layout.names]
    first = [row for row, name in enumerate(names) if name not in names[:row]]
    covariance = fitted.covariance[np.ix_(first, first)]
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    strength, way = np.linalg.eigh(covariance / np.outer(size, size))
    root = size[:, None] * way * np.sqrt(np.maximum(strength, 0.0))
    packed = base64.b64encode(zlib.compress(np.ascontiguousarray(root, dtype="<f4").tobytes(), 9)).decode()
    of = tuple(names[row] for row in first)
    values = _digest(fitted.model)
    return CovarianceSpec(of=of, root=packed, values=values, heldout_mm=heldout, helped=helped)


def kept_covariance(model: Model) -> Kept | None:
    """Read what a machine file keeps.

    Args:
        model: as read.

    Returns:
        The covariance; None where there is none, or where its parameters are no longer those of the model.
    """
    spec = model.file.covariance
    if spec is None or spec.values != _digest(model):
        return None
    count = len(spec.of)
    try:
        flat = np.frombuffer(zlib.decompress(base64.b64decode(spec.root, validate=True)), dtype="<f4").astype(float)
        return Kept(spec.of, flat.reshape(count, count), spec.heldout_mm, spec.helped, spec.masked)
    except (ValueError, zlib.error):
        return None


def tool_sigma(kept: Kept, terms: Shifts, view: View, kind: str) -> np.ndarray:
    """What the parameters leave uncertain of where the tool is, as the tracker's frame would show it.

    Parameters and frame together: what is common to all readings moves with the frame, and no command mends it. Beyond
    the heights that told a curve it is held, and how it goes on there is uncertain as well.

    Args:
        kept: the covariance.
        terms: effects of the machine with their parameters; those of the metrology move no tool.
        view: n rows.
        kind: mechanism family.

    Returns:
        (n,) mm, root of the summed variances of x, y and z.
    """
    if view.rows > CHUNK:
        return np.concatenate([tool_sigma(kept, terms, part, kind) for part in view_chunks(view, CHUNK)])
    at = linearise(terms, view)
    parts = [at.jacobian @ torch.as_tensor(kept.rows(_names(terms, view.joints, kind)))] if terms else []
    if any(name in kept.names for name in MOUNT_NAMES):
        parts.append(at.by_mount @ torch.as_tensor(kept.rows(MOUNT_NAMES)))
    if any(name in kept.names for name in FRAME_NAMES):
        still = torch.zeros(1, 6, dtype=torch.float64)
        by_frame = apply_frames(at.prediction.reading, np.zeros(view.rows, dtype=int), still)[1]
        parts.append(by_frame @ torch.as_tensor(kept.rows(FRAME_NAMES)))
    total = sum(parts, torch.zeros(view.rows, 3, kept.root.shape[1], dtype=torch.float64))
    square = total.square().sum(dim=(1, 2))
    if terms:
        square = square + unvisited(terms, view, at.jacobian).square().sum(dim=(1, 2))
    return np.asarray(square.sqrt().numpy())


def unvisited(terms: Shifts, view: View, jacobian: torch.Tensor) -> torch.Tensor:
    """How far the tool may be off because joints are beyond the heights that told their curves, standard deviations.

    A curve has a slope that wanders at random along the axis (as in `screw-error-map`). Beyond its end it is held,
    while the screw goes on with the slope of that end, and bends with the power 3/2 of the length.

    Args:
        terms: effects of the machine with their parameters.
        view: n rows.
        jacobian: of the reading by all parameters of the terms, (n, 3, p).

    Returns:
        (n, 3, c) mm, one column a joint's curve.
    """
    columns, first = [jacobian[:, :, :0]], 0
    for effect, theta in terms:
        counts = sizes(effect, view.joints)
        values = {p.stem: part for p, part in zip(effect.parameters, theta.split(counts), strict=True)}
        if {"from", "to", "straight"} <= values.keys():
            low, high = values["from"], values["to"]
            share = (torch.maximum(view.q - high, low - view.q) / (high - low)).clamp(min=0.0)  # shape: (n, k)
            far = (STEEP**2 * share**2 + share**3).sqrt()
            levels = first + _levels(effect, view.joints)  # shape: (k, curves)
            for number, curve in enumerate(_bent(effect)):
                height = values[curve.stem].reshape(view.joints, -1).abs().amax(dim=1).clamp(min=curve.usual)
                columns.append(jacobian[:, :, levels[:, number]] * (far * height)[:, None])
        first += sum(counts)
    return torch.cat(columns, dim=2)


def _bent(effect: Effect) -> list[Parameter]:
    """The parameters that are a curve's bends."""
    return [p for p in effect.parameters if p.role == "linear" and not p.held and not p.fine]


def _levels(effect: Effect, joints: int) -> np.ndarray:
    """Places, among an effect's parameters, of the level of each joint's curves, (k, curves)."""
    stems = [p.stem for p in effect.parameters]
    at = stems.index("straight")
    start, count = sum(sizes(effect, joints)[:at]), effect.parameters[at].count
    return start + np.arange(joints * count).reshape(joints, count)[:, 1::2]


def _names(terms: Shifts, joints: int, kind: str) -> list[str]:
    return [f"{effect.key} {name}" for effect, _ in terms for name in _own_names(effect, joints, kind)]


def _own_names(effect: Effect, joints: int, kind: str) -> list[str]:
    return parameter_names(effect, kind, joints)


def _plain_name(name: str, frames: int, mounts: int) -> str:
    """Names of frames and mounts without their run."""
    for plain, count in [*((each, frames) for each in FRAME_NAMES), *((each, mounts) for each in MOUNT_NAMES)]:
        if count > 1 and name.startswith(f"{plain} of run "):
            return plain
    return name


def _digest(model: Model) -> str:
    """Of which parameters a covariance is: a value that a person changed has another."""
    entries = [(e.name, e.label, {k: v.value for k, v in e.parameters.items()}) for e in write_model(model).effect]
    return hashlib.sha256(repr(entries).encode()).hexdigest()[:16]
