"""How far the tool may be from where a model has it, at any target: by what its fit left uncertain, named or not."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter
from ptt.effects.layout import linear_size, sizes, usual_values
from ptt.fitting.chunks import CHUNK, view_chunks
from ptt.fitting.kept import Kept
from ptt.fitting.layout import FRAME_NAMES, MOUNT_NAMES
from ptt.fitting.turns import unturned
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
    """What a fit leaves uncertain of where the tool is, as the tracker's frame would show it.

    Parameters and frame together: what is common to all readings moves with the frame, and no command mends it (beside
    base reflectors, whose frames were held, it is of the tool in the base frame). What stays with the tool in all
    postures is the mount's where that was fitted. So do sizes of the drawing that the model does not have, which its
    values make good for where the run went and not elsewhere. Beyond the heights that told a curve it is held, and how
    it goes on there is uncertain as well; nearer to a reversal than any reading, so is how play is taken up.

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
    """The same of some rows, less the shifts with the tool, (3, r) each, that the mount takes."""
    at = linearise(terms, view)
    ways = _ways(kept, terms, at, view, kind)
    if seats is not None:
        ways = [way - at.by_mount @ seat for way, seat in zip(ways, seats, strict=True)]
    if kept.turns:
        lengths = torch.tensor(kept.turns, dtype=torch.float64)
        ways.append(unturned(terms, view, at.jacobian, lengths))
    if terms:
        ways.append(unvisited(terms, view, at.jacobian))
    square = torch.stack([way.square().sum(dim=(1, 2)) for way in ways]).sum(dim=0)
    return np.asarray(square.sqrt().numpy())


def _ways(kept: Kept, terms: EffectTerms, at: Linearised, view: View, kind: str) -> list[Tensor]:
    """How the tool goes with each way that the covariance has, (n, 3, r) mm; and with those of what has no name."""
    by_kept = _by_kept(kept, terms, at, view, kind)
    ways = [by_kept @ torch.as_tensor(kept.root)]
    if kept.unnamed is not None:
        every = torch.cat([_usual(kept, terms, by_kept, view, kind), *_by_unnamed(kept.unnamed, at, view)], dim=2)
        ways.append(every @ torch.as_tensor(kept.unnamed.root))
    return ways


def _mean_shifts(kept: Kept, terms: EffectTerms, view: View, file: MachineFile) -> list[Tensor]:
    """How far the tool goes with each way in its own frame, (3, r) mm, on the mean of postures all over the workspace.

    No reading tells the last joint's zero from a reflector that sits further round. Which of both it is hardly moves
    the reflector, and shifts a tool point that lies elsewhere on the tool by the same in all postures.
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
    """How the tool goes with all that a file keeps, (n, 3, u) in its units; not at all with what is not at work."""
    place = {name: number for number, name in enumerate(kept.names)}
    found = torch.zeros(view.rows, 3, len(place), dtype=torch.float64)
    still = torch.zeros(1, 6, dtype=torch.float64)
    parts = [
        (_names(terms, view.joints, kind), at.jacobian),
        (MOUNT_NAMES, at.by_mount),
        (FRAME_NAMES, apply_frames(at.prediction.reading, np.zeros(view.rows, dtype=int), still)[1]),
    ]
    for names, columns in parts:
        own = [number for number, name in enumerate(names) if name in place]
        found[:, :, [place[names[number]] for number in own]] = columns[:, :, own]
    return found


def _usual(kept: Kept, terms: EffectTerms, by_kept: Tensor, view: View, kind: str) -> Tensor:
    """The same, (n, 3, u), by usual sizes."""
    usual = dict(zip(MOUNT_NAMES, [MOUNT_USUAL] * 3, strict=True))
    usual |= dict(zip(FRAME_NAMES, [SHIFT_USUAL] * 3 + [TURN_USUAL] * 3, strict=True))
    for effect, _ in terms:
        usual |= dict(zip(_own_names(effect, view.joints, kind), usual_values(effect, view).tolist(), strict=True))
    return by_kept * torch.tensor([usual.get(name, 0.0) for name in kept.names], dtype=torch.float64)


def _by_unnamed(unnamed: Unnamed, at: Linearised, view: View) -> list[Tensor]:
    """How the tool goes with sizes of the drawing that a model does not have, (n, 3, p) each by usual sizes."""
    return [
        signature(at.chain, effect, {}) * usual_values(effect, view)[: linear_size(effect, view.joints)]
        for effect in unnamed.effects
    ]


def unvisited(terms: EffectTerms, view: View, jacobian: Tensor) -> Tensor:
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
