"""Standard deviation of the tool position at any target, from what a model's fit left uncertain."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter
from ptt.effects.layout import linear_size, sizes
from ptt.effects.metrology import TrackerScale
from ptt.effects.usual import usual_values
from ptt.fitting.chunks import CHUNK, view_chunks
from ptt.fitting.kept import Kept
from ptt.fitting.layout import FRAME_NAMES, MOUNT_NAMES
from ptt.fitting.turns import likely_turns, unturned
from ptt.fitting.unnamed import Unnamed
from ptt.machine import MachineFile
from ptt.model.chain import EffectTerms, Linearised, linearise, signature
from ptt.model.model import parameter_names
from ptt.run.mounts import place_mounts
from ptt.run.problem import MOUNT_USUAL, SHIFT_USUAL, TURN_USUAL, apply_frames
from ptt.run.table import make_table
from ptt.run.view import View
from ptt.run.viewing import build_view

POSTURES = 200  # postures from which the mean of a shift with the tool is known to a tenth of its standard deviation
END_SLOPE = 5.0  # slope of a curve at its end, in heights of the curve per length of it


def tool_sigma(kept: Kept, terms: EffectTerms, view: View, file: MachineFile) -> np.ndarray:
    """Uncertainty of the tool position relative to the tracker's frame.

    Parameters and frame vary together: a shift common to all readings goes with the frame, the one by a tracker's scale
    included, and no command corrects it (with base reflectors, whose frames were held, the position is in the base
    frame). A shift that is constant on the tool belongs to the mount where that was fitted. Included are sizes of the
    drawing that the model does not have, for which its values make up only where the run went; the course of curves
    beyond the travel that determined them; and how play is taken up nearer to a reversal than any reading.

    Args:
        kept: the covariance.
        terms: effects of the machine with their parameters; those of the metrology move no tool.
        view: n rows.
        file: the machine.

    Returns:
        (n,) mm, root of the summed variances of x, y and z.
    """
    seats = _mean_shifts(kept, terms, view, file) if set(MOUNT_NAMES) & set(kept.names) else None
    parts = view_chunks(view, CHUNK) if view.rows > CHUNK else [view]
    return np.concatenate([_sigma(kept, terms, part, file.machine.kind, seats) for part in parts])


def _sigma(kept: Kept, terms: EffectTerms, view: View, kind: str, seats: Sequence[Tensor] | None) -> np.ndarray:
    """`tool_sigma` of some rows; `seats`: shifts on the tool that the mount takes, (3, r) each."""
    at = linearise(terms, view)
    ways = _ways(kept, terms, at, view, kind)
    if seats is not None:
        ways = [way - at.by_mount @ seat for way, seat in zip(ways, seats, strict=True)]
    if kept.turns:
        ways.append(unturned(terms, view, at.jacobian, likely_turns(kept.turns, kind)))
    if terms:
        ways.append(unvisited(terms, view, at.jacobian))
    square = torch.stack([way.square().sum(dim=(1, 2)) for way in ways]).sum(dim=0)
    return np.asarray(square.sqrt().numpy())


def _ways(kept: Kept, terms: EffectTerms, at: Linearised, view: View, kind: str) -> list[Tensor]:
    """Tool shifts per column of the covariance's root, (n, 3, r) mm; and of the root for sizes not in the model."""
    by_kept = _by_kept(kept, terms, at, view, kind)
    ways = [by_kept @ torch.as_tensor(kept.root)]
    if kept.unnamed is not None:
        every = torch.cat([_usual(kept, terms, by_kept, view, kind), *_by_unnamed(kept.unnamed, at, view)], dim=2)
        ways.append(every @ torch.as_tensor(kept.unnamed.root))
    return ways


def _mean_shifts(kept: Kept, terms: EffectTerms, view: View, file: MachineFile) -> list[Tensor]:
    """Mean shift on the tool per column of the roots, (3, r) mm each, over postures all over the workspace.

    No reading distinguishes the last joint's zero from a rotated reflector mount. Either hardly moves the reflector,
    and shifts another tool point by the same amount in all postures.
    """
    limits = view.travel_limits.numpy()
    q = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (POSTURES, view.joints))
    place = view.mechanism.forward(torch.as_tensor(q)).numpy()
    there = build_view(file, make_table(place, command=q))
    if view.mount is not None:
        there = place_mounts(there, np.zeros(POSTURES, dtype=int), view.mount[:1].numpy())
    at = linearise(terms, there)
    ways = _ways(kept, terms, at, there, file.machine.kind)
    return [torch.einsum("nij,nir->jr", at.by_mount, way) / POSTURES for way in ways]


def _by_kept(kept: Kept, terms: EffectTerms, at: Linearised, view: View, kind: str) -> Tensor:
    """Derivative of the tool position by each kept parameter, (n, 3, u) in its unit; zero for those not in use."""
    place = {name: number for number, name in enumerate(kept.names)}
    found = torch.zeros(view.rows, 3, len(place), dtype=torch.float64)
    still = torch.zeros(1, 6, dtype=torch.float64)
    by_frame = apply_frames(at.prediction.reading, np.zeros(view.rows, dtype=int), still)[1]
    parts = [
        (_names(terms, view.joints, kind), at.jacobian),
        (MOUNT_NAMES, at.by_mount),
        (FRAME_NAMES, by_frame),
    ]
    if set(FRAME_NAMES) <= set(place):
        parts.append((_own_names(TrackerScale(), view.joints, kind)[1:], by_frame))  # its shift, x, y, z
    for names, columns in parts:
        own = [number for number, name in enumerate(names) if name in place]
        found[:, :, [place[names[number]] for number in own]] = columns[:, :, own]
    return found


def _usual(kept: Kept, terms: EffectTerms, by_kept: Tensor, view: View, kind: str) -> Tensor:
    """`_by_kept` in usual sizes, (n, 3, u)."""
    usual = dict(zip(MOUNT_NAMES, [MOUNT_USUAL] * 3, strict=True))
    usual |= dict(zip(FRAME_NAMES, [SHIFT_USUAL] * 3 + [TURN_USUAL] * 3, strict=True))
    for effect, _ in terms:
        usual |= dict(zip(_own_names(effect, view.joints, kind), usual_values(effect, view).tolist(), strict=True))
    return by_kept * torch.tensor([usual.get(name, 0.0) for name in kept.names], dtype=torch.float64)


def _by_unnamed(unnamed: Unnamed, at: Linearised, view: View) -> list[Tensor]:
    """Derivatives by sizes of the drawing that the model does not have, (n, 3, p) each, in usual sizes."""
    return [
        signature(at.chain, effect, {}) * usual_values(effect, view)[: linear_size(effect, view.joints)]
        for effect in unnamed.effects
    ]


def unvisited(terms: EffectTerms, view: View, jacobian: Tensor) -> Tensor:
    """Standard deviations of the tool position where joints are beyond the travel that determined their curves.

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
            far = (END_SLOPE**2 * share**2 + share**3).sqrt()
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


def _names(terms: EffectTerms, joints: int, kind: str) -> list[str]:
    return [name for effect, _ in terms for name in _own_names(effect, joints, kind)]


def _own_names(effect: Effect, joints: int, kind: str) -> list[str]:
    return [f"{effect.key} {name}" for name in parameter_names(effect, kind, joints)]
