"""Effects as atoms: which values share a prior variance, how large they may be, and the prior odds of a name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from torch import Tensor

from ptt.diagnosis.evidence.atoms import EFFECT_ODDS, SHAPE_POWER, Atom, causes, is_sudden
from ptt.effects import Effect
from ptt.effects.layout import shape_of
from ptt.effects.parameter import Parameter
from ptt.fitting.linear import Linear
from ptt.fitting.result import FitResult
from ptt.run.problem import Problem

# Prior variance in usual sizes squared: three hundred usual sizes, as drawings are off by that much
MOST_EFFECT_VARIANCE = 1e5
# The same of a searched value about zero: one usual size. Its column is the derivative of the effect, and with a large
# value would be as much as the effect itself.
MOST_RESTING_VARIANCE = 1.0
MOST_HELD_VARIANCE = 1e2  # the same of values kept near zero: ten usual sizes; larger waves could imitate whole links
FEW_JOINTS = 3  # joints up to which the odds of choosing some of them cost what leaving the sound ones out gains


def odds_of_effect(effect: Effect, effects: int, shapes: int) -> float:
    """Prior odds in nats against an effect, given the number of testable effects and of shapes tried."""
    each = EFFECT_ODDS + float(np.log(max(effects, 1)))
    own = type(effect).odds_of_shape is not Effect.odds_of_shape  # odds of its own cover the choice among its shapes
    chosen = 0.0 if own else SHAPE_POWER * float(np.log(max(shapes, 1)))
    return causes(effect) * each + chosen + effect.odds_of_kind


def atoms_of(linear: Linear, fitted: FitResult, problem: Problem, candidates: Sequence[Effect]) -> dict[str, Atom]:
    """Atoms of the effects in a model and of candidates in all their shapes.

    Args:
        linear: their columns.
        fitted: the model.
        problem: n rows.
        candidates: effects that may be added.

    Returns:
        The atoms by key; a candidate's key is its name and the number of the trial.
    """
    names = {effect.name for effect in candidates} | {term.effect.name for term in fitted.model.terms}
    atoms: dict[str, Atom] = {}
    for term, free in zip(fitted.layout.terms, fitted.layout.free, strict=True):
        key, columns = term.effect.key, linear.present[term.effect.key]
        if not len(columns):
            continue
        shapes = len(tuple(term.effect.search(problem.view)))
        odds = odds_of_effect(term.effect, len(names), shapes)
        own = next(item for item in fitted.model.terms if item.effect.key == key)
        shape = shape_of(own.effect, own.theta, problem.view.joints)
        odds += own.effect.odds_of_shape(shape)
        atom = _in_shape(effect_atom(key, columns, own.effect, problem, odds, None, free), shape, problem, free)
        since = float(own.theta[-1]) if is_sudden(atom) else None
        values = fitted.unknowns[columns] * fitted.layout.scale[columns] / linear.scale[columns]
        begin = _fitted_variances(atom, values)
        atoms[key] = replace(atom, since=since, tested=_is_tested(atom, problem), begin=begin)
    like: dict[str, Atom] = {}  # key of an effect -> atom of its first shape
    for number, trial in enumerate(linear.trials):
        key, name = f"{trial.effect.key}#{number}", trial.effect.key
        if name not in like:
            odds = odds_of_effect(trial.effect, len(names), trial.trials)
            first = effect_atom(key, trial.columns, trial.effect, problem, odds, trial.shape)
            like[name] = replace(first, tested=_is_tested(first, problem))
        odds = like[name].odds + trial.effect.odds_of_shape(trial.shape)
        atom = replace(like[name], key=key, columns=trial.columns, shape=trial.shape, odds=odds)
        atoms[key] = _in_shape(atom, trial.shape, problem, slice(0, len(trial.columns)))
    return atoms


def reshaped(atom: Atom, key: str, shape: Mapping[str, Tensor], present: Mapping[str, Tensor] | None = None) -> Atom:
    """The atom of an effect in another shape, at the odds of that.

    Args:
        atom: the effect in one shape.
        key: of the new atom.
        shape: its shape.
        present: shape of the effect in the model, where the atom is that; None for the atom's own.
    """
    assert atom.effect is not None
    own = atom.shape if present is None else present
    more = atom.effect.odds_of_shape(shape) - (atom.effect.odds_of_shape(own) if own is not None else 0.0)
    return replace(atom, key=key, shape=dict(shape), odds=atom.odds + more)


def _fitted_variances(atom: Atom, values: np.ndarray) -> np.ndarray:
    """Mean squares of the fitted values that share a prior variance, those of the usual sizes at least, (g,).

    Learned from usual sizes on, the variance of values hundreds of times as large may stay small, the noise large: the
    evidence has a maximum there too.
    """
    squares = np.bincount(atom.group, np.square(values), atom.groups) / np.bincount(atom.group, minlength=atom.groups)
    return np.clip(squares, 1.0, atom.most)


def _in_shape(atom: Atom, shape: Mapping[str, Tensor], problem: Problem, chosen: np.ndarray | slice) -> Atom:
    """The atom with the largest values that its cause can make in this shape."""
    assert atom.effect is not None
    largest = atom.effect.largest(shape)
    if not largest:
        return atom
    kind, joints = problem.file.machine.kind, problem.view.joints
    each = [
        np.broadcast_to(np.asarray(largest.get(p.stem, np.inf)) / p.on(kind).usual, p.size(joints))
        for p in atom.effect.parameters
    ]
    return replace(atom, largest=np.concatenate(each)[chosen])


def _is_tested(atom: Atom, problem: Problem) -> bool:
    """Whether the run varies what tells an effect from a size of the drawing: both directions of arrival, two loads."""
    effect, view = atom.effect, problem.view
    if effect is not None and "direction" in effect.requires:
        return bool(problem.two_sided.any())
    return effect is None or effect.told_by in ("", *view.varies) or view.torque is not None


def effect_atom(
    key: str,
    columns: np.ndarray,
    effect: Effect,
    problem: Problem,
    odds: float,
    shape: Mapping[str, Tensor] | None,
    free: np.ndarray | None = None,
) -> Atom:
    """An effect as an atom.

    Args:
        key: unique among all atoms.
        columns: indices of its columns, one for each linear value, or for each that is free.
        effect: the effect.
        problem: n rows.
        odds: nats of prior odds against it.
        shape: its searched and given parameters; None where it is in the model.
        free: which of all its values have a column, bool; None for the first ones, as many as there are columns.
    """
    chosen = slice(0, len(columns)) if free is None else free
    kinds = _kinds_of_values(effect, problem.view.joints, chosen)
    joint, within = kinds.joint, kinds.within
    group = np.unique(kinds.group, return_inverse=True)[1].reshape(-1)
    most = np.full(int(group.max(initial=-1)) + 1, MOST_EFFECT_VARIANCE)
    most[group[kinds.near_zero]] = MOST_HELD_VARIANCE
    most[group[kinds.resting]] = MOST_RESTING_VARIANCE
    # Only for effects of one kind of value: a link off in all of its lengths and angles is no plainer than several
    # links off in one.
    one_kind = len({parameter.unit for parameter in effect.parameters if parameter.role == "linear"}) == 1
    legs = _legs(group, joint)
    alike = one_kind and legs is None and (joint >= 0).all() and joint.max(initial=0) >= FEW_JOINTS
    fine = np.isin(np.arange(len(most)), group[kinds.fine])
    return Atom(
        key, effect.key, columns, group, most, odds, kinds.non_negative, effect, shape,
        joint=joint if alike else None, leg=legs, fine=fine if fine.any() else None,
        reach=effect.ratio_limit(problem.view), within=within if np.isfinite(within).any() else None,
    )  # fmt: skip


@dataclass(frozen=True)
class ValueKinds:
    """Kinds of the w values of an effect.

    Attributes:
        group: values of one number share a prior variance, (w,) int.
        non_negative: whether a value cannot be negative, (w,) bool.
        near_zero: whether a value is kept near zero by the definition of the effect, (w,) bool.
        resting: whether a value is searched and about zero, (w,) bool.
        joint: joint of each value, -1 for none, (w,) int.
        fine: whether a value is fine detail of a curve, (w,) bool.
        within: lowest and highest size that the cause can have, (w, 2) in usual sizes.
    """

    group: np.ndarray
    non_negative: np.ndarray
    near_zero: np.ndarray
    resting: np.ndarray
    joint: np.ndarray
    fine: np.ndarray
    within: np.ndarray


def _kinds_of_values(effect: Effect, joints: int, chosen: np.ndarray | slice) -> ValueKinds:
    """Kinds of the chosen values of an effect on a mechanism with k joints."""
    each = effect.parameters
    sizes = [parameter.size(joints) for parameter in each]
    return ValueKinds(
        group=_groups(effect, joints)[chosen],
        non_negative=np.repeat([parameter.lower >= 0.0 for parameter in each], sizes)[chosen],
        near_zero=np.repeat([parameter.held and not parameter.lent for parameter in each], sizes)[chosen],
        resting=np.repeat([parameter.held and parameter.role == "searched" for parameter in each], sizes)[chosen],
        joint=np.concatenate([_joint_of(parameter, joints) for parameter in each])[chosen],
        fine=np.repeat([parameter.fine for parameter in each], sizes)[chosen],
        within=np.repeat([parameter.within or (-np.inf, np.inf) for parameter in each], sizes, axis=0)[chosen],
    )


def _groups(effect: Effect, joints: int) -> np.ndarray:
    """Number of each value's prior variance, (w,).

    Linear values share one variance. Curves have one for each joint, since one joint alone may have a curve, and many
    superfluous values beside the few that matter would cost the effect its evidence. Curves of the same joint share
    theirs. Fine detail has one for each joint as well, as one screw alone may be rough. Waves have one for each band of
    frequencies, and cosines and sines share it, since the phase depends on where zero happens to lie. A parameter that
    is kept near zero or is not linear has a variance of its own.
    """
    group, first, curves = list[np.ndarray](), 1, 0
    bands = 1 + max((number for parameter in effect.parameters for number in parameter.bands), default=0)
    for parameter in effect.parameters:
        if parameter.role == "linear" and parameter.per_joint and parameter.count > 1 and not parameter.fine:
            curves = curves or first
            band = np.array(parameter.bands or (0,) * parameter.count)
            group.append((curves + bands * np.arange(joints)[:, None] + band).reshape(-1))
            first += bands * joints
        elif parameter.fine:
            group.append(np.repeat(first + np.arange(joints), parameter.count))
            first += joints
        else:
            own = parameter.held or parameter.role != "linear"
            group.append(np.full(parameter.size(joints), first if own else 0))
            first += 1
    return np.concatenate(group)


def _joint_of(parameter: Parameter, joints: int) -> np.ndarray:
    """Joint of each value of a parameter; -1 for none."""
    size = parameter.size(joints)
    own = parameter.per_joint and size == joints * parameter.count
    return np.repeat(np.arange(joints), parameter.count) if own else np.full(size, -1)


def _legs(group: np.ndarray, joint: np.ndarray) -> np.ndarray | None:
    """Joint of each prior variance; None where one belongs to several joints, and where joints are few."""
    legs = [np.unique(joint[group == number]) for number in range(int(group.max(initial=-1)) + 1)]
    few = joint.max(initial=0) < FEW_JOINTS or len(legs) < 2
    return None if few or any(len(each) > 1 or each[0] < 0 for each in legs) else np.concatenate(legs)


def straight_sizes(effect: Effect, problem: Problem) -> np.ndarray:
    """Factor on the usual size of each value: above one for the straight part of a curve seen over part of its travel.

    A curve has no straight part over its whole travel, but over the visited share f of it it has one: a curve whose
    slope is a random walk has a level of 1/f - 1 times its bow there, and about as much slope.

    Args:
        effect: the effect.
        problem: n rows.

    Returns:
        (w,) of all its parameters in their order; one for all that is not the straight part of a curve.
    """
    low, high = problem.view.covered
    ends = problem.view.travel_limits
    share = ((high - low) / (ends[:, 1] - ends[:, 0])).clamp(1e-3, 1.0).numpy()
    sizes, curve = [], 1.0
    for parameter in (each.on(problem.file.machine.kind) for each in effect.parameters):
        more = np.maximum((1.0 / share - 1.0) * curve / parameter.usual, 1.0) if parameter.lent else np.ones(len(share))
        sizes.append(np.repeat(more, parameter.count) if parameter.lent else np.ones(parameter.size(len(share))))
        curve = parameter.usual
    return np.concatenate(sizes)
