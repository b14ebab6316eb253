"""The causal chain of a model, joint command -> tracker reading, and its derivatives by all effect parameters.

q' = q + drive(q), p = f(q', geometry(q')), p' = p + structure(q', p), reading = p' + metrology(q', p'). f is the
forward kinematics; each stage adds up the shifts of its effects, all evaluated at the stage's input.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ptt.effects import Effect
from ptt.effects.layout import linear_size, shape_of, weigh
from ptt.mechanisms.derivatives import by_input
from ptt.mechanisms.sensitivity import sensitivity
from ptt.run.view import View

EffectTerms = Sequence[tuple[Effect, Tensor]]  # effects with the flat vector of their parameter values


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
    """The causal chain at a model's present parameters: what a small further shift in one of its stages does.

    The derivatives are those of the forward kinematics alone; that structure and metrology effects respond to a moved
    joint or tool is left out of them, a thousandth of the whole.

    Attributes:
        at_drive: the rows at the input of the drive stage, q the joint commands.
        at_joints: the rows at the input of the geometry stage, q the actual joint values.
        at_tool: the rows at the input of the metrology stage, p the actual tool position.
        by_joint: d reading / d joint shift, (n, 3, k) mm per mm or rad.
        by_slot: d reading / d geometry slot, (n, 3, G) mm per mm or rad.
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
        jacobian: d reading / d theta, (n, 3, P), effects in the given order.
        by_mount: d reading / d reflector offset from the tool point, in the tool's own axes, (n, 3, 3).
        chain: the same chain, for the signatures of effects that are not in the model.
    """

    prediction: Prediction
    jacobian: Tensor
    by_mount: Tensor
    chain: Chain


def predict(terms: EffectTerms, view: View) -> Prediction:
    """Follow the causal chain: drive, geometry, forward kinematics, structure, metrology.

    Args:
        terms: effects with their flat parameters.
        view: n rows.

    Returns:
        The prediction in the base frame: the rigid motion of the tracker frame is not part of it.
    """
    q = view.q + _total(terms, "drive", view, view.q)
    at_joints = view.at(q=q)
    geometry = _total(terms, "geometry", at_joints, view.q.new_zeros(1, len(view.mechanism.slots)))
    p = view.mechanism.forward(q, view.mounted(geometry))
    at_tool = at_joints.at(p=p)
    p = p + _total(terms, "structure", at_tool, p)
    reading = p + _total(terms, "metrology", at_tool.at(p=p), p)
    return Prediction(q, geometry, p, reading)


def read_base(terms: EffectTerms, view: View) -> Tensor:
    """Predict readings of reflectors fixed to the base, which metrology effects alone move.

    Args:
        terms: effects with their flat parameters.
        view: one row for each of m visits, p the reflector's drawn position.

    Returns:
        (m, 3) mm.
    """
    return view.p + _total(terms, "metrology", view, view.p)


def linearise_base(terms: EffectTerms, view: View) -> tuple[Tensor, Tensor]:
    """Predict what `read_base` does, with the Jacobian by all parameters.

    Args:
        terms: effects with their flat parameters.
        view: as for `read_base`.

    Returns:
        The readings (m, 3) mm, and d reading / d theta, (m, 3, P), zero for effects of the machine.
    """
    told, columns = view.p, [view.p.new_zeros(view.rows, 3, 0)]
    for effect, theta in terms:
        here = effect.stage == "metrology"
        shift, slope = differentiate(effect, theta, view) if here else (0.0, told.new_zeros(1, 1, len(theta)))
        told = told + shift
        columns.append(slope.expand(view.rows, 3, -1))
    return told, torch.cat(columns, dim=-1)


def linearise(terms: EffectTerms, view: View, *, crossed: bool = True) -> Linearised:
    """Predict, with the exact Jacobian by all parameters (chain rule over the stages).

    Each effect is differentiated by its own parameters (its basis, or autograd where it is not linear); its columns
    then pass through the later stages by the row-wise derivative of each stage by its input.

    Args:
        terms: effects with their flat parameters.
        view: n rows.
        crossed: also include how the shift of one stage changes the shifts of later ones, a thousandth of the whole;
            a search that only compares models leaves these cross terms out.

    Returns:
        The prediction and d reading / d theta.
    """
    crossing = terms if crossed else ()
    shift, drive = _differentiate_stage(terms, "drive", view, view.q)
    q = view.q + shift
    at_joints = view.at(q=q)
    nominal = view.q.new_zeros(1, len(view.mechanism.slots))
    geometry, shaped = _differentiate_stage(terms, "geometry", at_joints, nominal)
    p, joint, by_slot = sensitivity(view.mechanism, q, view.mounted(geometry))
    slots_by_joint = _by_input(crossing, "geometry", q, lambda x: view.at(q=x))
    by_joint = joint if slots_by_joint is None else joint + by_slot @ slots_by_joint
    at_structure = at_joints.at(p=p)
    shift, carried = _differentiate_stage(terms, "structure", at_structure, p)
    bent_by_tool = _by_input(crossing, "structure", p, lambda x: at_joints.at(p=x))
    bent_by_joint = _by_input(crossing, "structure", q, lambda x: at_structure.at(q=x))
    actual = p + shift
    at_tool = at_joints.at(p=actual)
    shift, read = _differentiate_stage(terms, "metrology", at_tool, p)
    read_by_tool = _by_input(crossing, "metrology", actual, lambda x: at_joints.at(p=x))
    reading = actual + shift
    # Jacobian columns by the effect's place in `terms`; each later stage maps those of the stages before it.
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
    chain = Chain(view, at_joints, at_tool, joint, by_slot, reading)
    return Linearised(Prediction(q, geometry, actual, reading), jacobian, by_mount, chain)


def trace(terms: EffectTerms, view: View) -> Chain:
    """Follow the chain and keep the rows at each stage's input, with the derivatives of the forward kinematics.

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
    """Signature of an effect that is not in the model yet: reading shift per unit of each of its linear parameters.

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
    """Shift of one effect and its derivative by its own parameters, at the stage's output.

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


def _differentiate_stage(terms: EffectTerms, stage: str, view: View, like: Tensor) -> tuple[Tensor, dict[int, Tensor]]:
    """Total shift of a stage, (n, out), and by place in `terms` each of its effects' own derivative, (n, out, P)."""
    here = {i: differentiate(e, theta, view) for i, (e, theta) in enumerate(terms) if e.stage == stage}
    total = sum((shift for shift, _ in here.values()), torch.zeros_like(like))
    return total, {place: slope for place, (_, slope) in here.items()}


def _through(by_slot: Tensor, basis: Tensor) -> Tensor:
    """Chain rule d reading/d slot @ basis, (n, 3, P); a basis expanded from one row needs only one matrix product."""
    if basis.stride(0) == 0 and len(basis):
        return (by_slot.reshape(-1, by_slot.shape[-1]) @ basis[0]).view(*by_slot.shape[:2], -1)
    return by_slot @ basis


def _total(terms: EffectTerms, stage: str, view: View, like: Tensor) -> Tensor:
    """Sum of the shifts of a stage's effects, (n, out); zeros shaped as `like` where it has none."""
    shifts = [effect.shift(theta, view) for effect, theta in terms if effect.stage == stage]
    return sum(shifts, torch.zeros_like(like))


def _by_input(terms: EffectTerms, stage: str, x: Tensor, see: Callable[[Tensor], View]) -> Tensor | None:
    """Derivative of a stage's total shift by its input, row by row, (n, out, m); None where the stage is empty."""
    here = [(effect, theta) for effect, theta in terms if effect.stage == stage]
    if not here or all(not bool(theta.any()) for _, theta in here):
        return None

    def total(value: Tensor) -> Tensor:
        return torch.stack([effect.differentiable_shift(theta, see(value)) for effect, theta in here]).sum(dim=0)

    return by_input(total, x)
