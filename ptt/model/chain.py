"""The causal chain: drive, geometry, structure and metrology effects one after the other, and its derivatives."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ptt.effects import Effect
from ptt.effects.layout import linear_size, shape_of, weigh
from ptt.mechanisms.derivatives import by_input
from ptt.mechanisms.sensitivity import sensitivity
from ptt.run.view import View

Shifts = Sequence[tuple[Effect, Tensor]]  # effects with their flat parameters


@dataclass(frozen=True)
class Prediction:
    """What the model says of n rows, stage by stage.

    Attributes:
        q: actual joint values, (n, k) mm or rad.
        geometry: shift of the mechanism's slots, (n, G) or (1, G); zeros where no effect moves them.
        p: actual tool position in the base frame, structure included, (n, 3) mm.
        reading: what a tracker in the base frame would read, (n, 3) mm.
    """

    q: Tensor
    geometry: Tensor
    p: Tensor
    reading: Tensor


@dataclass(frozen=True)
class Chain:
    """The causal chain at a model's present parameters: where a small further shift of each stage would lead.

    Attributes:
        at_drive: the rows as drive effects see them.
        at_joints: as geometry effects see them.
        at_tool: as metrology effects see them, what structure effects do included.
        by_joint: d reading / d joint shift, (n, 3, k).
        by_slot: d reading / d geometry slot, (n, 3, G).
        reading: (n, 3) mm.
    """

    at_drive: View
    at_joints: View
    at_tool: View
    by_joint: Tensor
    by_slot: Tensor
    reading: Tensor


@dataclass(frozen=True)
class Linearised:
    """A prediction with its derivatives by all parameters.

    Attributes:
        prediction: the prediction.
        jacobian: d reading / d theta, (n, 3, P), terms in the given order.
        by_mount: d reading / d place of the reflector beside the tool point, (n, 3, 3).
        chain: where further shifts of each stage would lead, one stage at a time.
    """

    prediction: Prediction
    jacobian: Tensor
    by_mount: Tensor
    chain: Chain


def predict(terms: Shifts, view: View) -> Prediction:
    """Follow the causal chain: drive, geometry, forward kinematics, structure, metrology.

    Args:
        terms: effects with their flat parameters.
        view: n rows.

    Returns:
        The prediction, tracker frame left aside.
    """
    q = view.q + _total(terms, "drive", view, view.q)
    at_joints = view.at(q=q)
    geometry = _total(terms, "geometry", at_joints, view.q.new_zeros(1, len(view.mechanism.slots)))
    p = view.mechanism.forward(q, view.mounted(geometry))
    at_tool = at_joints.at(p=p)
    p = p + _total(terms, "structure", at_tool, p)
    reading = p + _total(terms, "metrology", at_tool.at(p=p), p)
    return Prediction(q, geometry, p, reading)


def read_base(terms: Shifts, view: View) -> Tensor:
    """What a tracker in the base frame would read of reflectors fixed to the base: only its own effects move them.

    Args:
        terms: effects with their flat parameters.
        view: of visits to the reflectors, m of them.

    Returns:
        (m, 3) mm.
    """
    return view.p + _total(terms, "metrology", view, view.p)


def linearise(terms: Shifts, view: View, *, crossed: bool = True) -> Linearised:
    """Predict, with exact derivatives along the chain.

    Each effect is differentiated by its own parameters (its basis, or by torch where it is not linear); what comes
    before reaches what comes after through the row-wise derivative of each stage by its input.

    Args:
        terms: effects with their flat parameters.
        view: n rows.
        crossed: also follow how a shift of one stage changes the shifts of the next, a thousandth of the whole; a
            search that only compares models goes without.

    Returns:
        The prediction and d reading / d theta.
    """
    links = terms if crossed else ()
    shift, drive = _differentiate_stage(terms, "drive", view, view.q)
    q = view.q + shift
    at_joints = view.at(q=q)
    nominal = view.q.new_zeros(1, len(view.mechanism.slots))
    geometry, shaped = _differentiate_stage(terms, "geometry", at_joints, nominal)
    p, joint, by_slot = sensitivity(view.mechanism, q, view.mounted(geometry))
    slots_by_joint = _by_input(links, "geometry", q, lambda x: view.at(q=x))
    by_joint = joint if slots_by_joint is None else joint + by_slot @ slots_by_joint
    at_tool = at_joints.at(p=p)
    shift, carried = _differentiate_stage(terms, "structure", at_tool, p)
    bent_by_tool = _by_input(links, "structure", p, lambda x: at_joints.at(p=x))
    bent_by_joint = _by_input(links, "structure", q, lambda x: at_tool.at(q=x))
    actual = p + shift
    at_target = at_joints.at(p=actual)
    shift, read = _differentiate_stage(terms, "metrology", at_target, p)
    read_by_tool = _by_input(links, "metrology", actual, lambda x: at_joints.at(p=x))
    reading = actual + shift
    # Columns of each stage join those of the stages before, which it carries on.
    blocks = {place: by_joint @ slope for place, slope in drive.items()}
    blocks |= {place: _through(by_slot, slope) for place, slope in shaped.items()}
    by_mount = by_slot[..., -3:]
    if bent_by_tool is not None:
        blocks = {place: block + bent_by_tool @ block for place, block in blocks.items()}
        by_mount = by_mount + bent_by_tool @ by_mount
    if bent_by_joint is not None:
        blocks |= {place: blocks[place] + bent_by_joint @ slope for place, slope in drive.items()}
    blocks |= carried
    if read_by_tool is not None:
        blocks = {place: block + read_by_tool @ block for place, block in blocks.items()}
        by_mount = by_mount + read_by_tool @ by_mount
    blocks |= read
    columns = [blocks[place] for place in range(len(terms))]
    jacobian = torch.cat(columns, dim=-1) if columns else reading.new_zeros(view.rows, 3, 0)
    chain = Chain(view, at_joints, at_target, joint, by_slot, reading)
    return Linearised(Prediction(q, geometry, actual, reading), jacobian, by_mount, chain)


def trace(terms: Shifts, view: View) -> Chain:
    """Follow the chain and keep what each stage sees.

    Args:
        terms: effects with their flat parameters.
        view: n rows.

    Returns:
        The chain.
    """
    at = predict(terms, view)
    at_joints = view.at(q=at.q)
    _, by_joint, by_slot = sensitivity(view.mechanism, at.q, view.mounted(at.geometry))
    return Chain(view, at_joints, at_joints.at(p=at.p), by_joint, by_slot, at.reading)


def signature(chain: Chain, effect: Effect, shape: Mapping[str, Tensor]) -> Tensor:
    """Reading shift per unit of each linear parameter of an effect that is not in the model yet.

    Args:
        chain: the present model's chain.
        effect: the candidate.
        shape: its searched and given parameters.

    Returns:
        (n, 3, P) mm per unit.
    """
    if effect.stage == "drive":
        return chain.by_joint @ effect.basis(chain.at_drive, shape)
    if effect.stage == "geometry":
        return _through(chain.by_slot, effect.basis(chain.at_joints, shape))
    return effect.basis(chain.at_tool, shape)


def differentiate(effect: Effect, theta: Tensor, view: View) -> tuple[Tensor, Tensor]:
    """Shift of one effect and its derivative by its own parameters.

    Args:
        effect: the effect.
        theta: all its parameters, flat, (P,).
        view: n rows at the stage's input.

    Returns:
        Shift (n, out) and derivative (n, out, P); zero columns for 'given' parameters.
    """
    if type(effect).shift is not Effect.shift:
        return effect.shift(theta, view), effect.slope(theta, view)
    linear = linear_size(effect, view.joints)
    shape = shape_of(effect, theta, view.joints)
    basis = effect.basis(view, shape)
    columns = [basis]
    for parameter in effect.parameters:
        if parameter.role == "linear":
            continue
        size = parameter.size(view.joints)
        if parameter.role == "given":
            columns.append(basis.new_zeros(*basis.shape[:2], size))
            continue
        columns.append(effect.slope_by(parameter.stem, theta[:linear], view, shape))
    return weigh(basis, theta[:linear]), columns[0] if len(columns) == 1 else torch.cat(columns, dim=-1)


def _differentiate_stage(terms: Shifts, stage: str, view: View, like: Tensor) -> tuple[Tensor, dict[int, Tensor]]:
    """Total shift of a stage, (n, out); of each of its effects, by place among all, the own derivative (n, out, P)."""
    here = {i: differentiate(e, theta, view) for i, (e, theta) in enumerate(terms) if e.stage == stage}
    total = sum((shift for shift, _ in here.values()), torch.zeros_like(like))
    return total, {place: slope for place, (_, slope) in here.items()}


def _through(by_slot: Tensor, basis: Tensor) -> Tensor:
    """Derivative by the slots times a basis, (n, 3, P); where the basis is the same for all rows, one product."""
    if basis.stride(0) == 0 and len(basis):
        return (by_slot.reshape(-1, by_slot.shape[-1]) @ basis[0]).view(*by_slot.shape[:2], -1)
    return by_slot @ basis


def _total(terms: Shifts, stage: str, view: View, like: Tensor) -> Tensor:
    shifts = [effect.shift(theta, view) for effect, theta in terms if effect.stage == stage]
    return sum(shifts, torch.zeros_like(like))


def _by_input(terms: Shifts, stage: str, x: Tensor, see: Callable[[Tensor], View]) -> Tensor | None:
    """Derivative of a stage's total shift by its input, row by row, (n, out, m); None where the stage is empty."""
    here = [(effect, theta) for effect, theta in terms if effect.stage == stage]
    if not here or all(not bool(theta.any()) for _, theta in here):
        return None

    def total(value: Tensor) -> Tensor:
        return torch.stack([effect.summed(theta, see(value)) for effect, theta in here]).sum(dim=0)

    return by_input(total, x)
