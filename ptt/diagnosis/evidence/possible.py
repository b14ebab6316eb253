"""Plausibility of an effect's fitted values: what physics excludes, and what unusual values or patterns cost."""

from collections.abc import Mapping, Sequence

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, causes, is_metrology
from ptt.diagnosis.evidence.product import nats_of_none, nats_of_product
from ptt.diagnosis.evidence.state import State
from ptt.effects.phrases import ABSURD

CLEARLY_BEYOND = 3.0  # standard errors beyond a physical bound at which a value speaks against its effect
UNUSUAL_NATS = 25.0  # nats against a value larger than its cause has ever been seen to make


def is_impossible(state: State, atoms: Sequence[Atom], new: Sequence[Atom]) -> bool:
    """Whether a fitted value is clearly below its physical lower bound.

    Args:
        state: a set.
        atoms: of the set.
        new: those of them that are not in the model as given, whose lower bound of `Atom.within` applies too.
    """
    return any(
        (_values(state, atom)[atom.bounded] < -CLEARLY_BEYOND * _errors(state, atom)[atom.bounded]).any()
        for atom in atoms
        if atom.bounded.any()
    ) or any(
        (_values(state, atom) < atom.within[:, 0] - CLEARLY_BEYOND * _errors(state, atom)).any()
        for atom in new
        if atom.within is not None
    )


def beyond_machines(state: State, atoms: Mapping[str, Atom], scale: np.ndarray) -> tuple[str, ...]:
    """Keys of a machine's effects with values that no machine has, or that their cause cannot make.

    A drawing may be off by as much. But a model moved that far has another tangent than the one at which other effects
    were compared, and one of these may explain the same with usual values.

    Args:
        state: a set.
        atoms: of the system, by key.
        scale: (P,) of all columns of the system.
    """
    away = []
    for key in state.keys:
        atom = atoms[key]
        if atom.effect is None or is_metrology(atom):  # readings may stand in any frame
            continue
        usual = atom.amplitudes(state.posterior.values[state.of(key)], scale) / atom.sizes(scale)
        away += [key] if np.abs(usual).max(initial=0.0) > ABSURD or _is_too_large(state, atom) else []
    return tuple(away)


def nats_of_form(state: State, atom: Atom, scale: np.ndarray, *, new: bool) -> float:
    """Nats for or against the pattern of an effect's values, beyond what their normal prior says.

    Args:
        state: a set.
        atom: of it.
        scale: (P,) of all columns of the system.
        new: whether it is not in the model as given.
    """
    nats = _nats_of_product(state, atom)
    if not new:
        return nats
    unusual = UNUSUAL_NATS if is_oversized(state, atom) else 0.0
    return nats + _nats_beyond_reach(state, atom, scale) - unusual


def _nats_of_product(state: State, atom: Atom) -> float:
    """Nats of a prior under which an effect's further values are zero, or else products with its first one."""
    if atom.effect is None or not atom.effect.product or atom.key not in state.variances or len(atom.columns) < 2:
        return 0.0
    own, posterior = state.of(atom.key), state.posterior
    prior_variance = posterior.phi * float(state.variances[atom.key][0])
    values, covariance = posterior.values[own], state.covariance[np.ix_(own, own)]
    more = (atom.effect.stands_for_away / causes(atom.effect) - 1.0) * atom.odds
    product = nats_of_product(values, covariance, prior_variance) - more
    return float(np.logaddexp(product, nats_of_none(values, covariance, prior_variance)) - np.log(2.0))


def _nats_beyond_reach(state: State, atom: Atom, scale: np.ndarray) -> float:
    """Nats against second values of joints that are larger than `Atom.reach` times their first values.

    A joint within its reach gains nothing: the odds count already which joints have values at all.
    """
    if atom.reach is None or atom.key not in state.variances:
        return 0.0
    (values, covariance), size = state.amounts([atom], scale), atom.sizes(scale)
    widest, nats = state.posterior.phi * float(state.variances[atom.key][atom.group[0]]), 0.0
    linear = np.flatnonzero(atom.group == atom.group[0])  # without those of the shape
    for own in linear.reshape(2, -1).T:  # both values of each joint, in usual sizes of the second
        unit = np.array([atom.reach, 1.0]) / size[own[1]]
        both = unit[:, None] * covariance[np.ix_(own, own)] * unit
        nats += min(nats_of_product(unit * values[own], both, widest), 0.0)
    return nats


def is_oversized(state: State, atom: Atom) -> bool:
    """Whether a value is clearly larger than its cause has been seen to make, or than it can make in this shape."""
    if _is_too_large(state, atom):
        return True
    if atom.within is None:
        return False
    return bool((_values(state, atom) > atom.within[:, 1] + CLEARLY_BEYOND * _errors(state, atom)).any())


def _is_too_large(state: State, atom: Atom) -> bool:
    """Whether a value is clearly larger than its cause can make in this shape."""
    if atom.largest is None:
        return False
    return bool((np.abs(_values(state, atom)) > atom.largest + CLEARLY_BEYOND * _errors(state, atom)).any())


def _values(state: State, atom: Atom) -> np.ndarray:
    return state.posterior.values[state.of(atom.key)]


def _errors(state: State, atom: Atom) -> np.ndarray:
    return state.std[state.of(atom.key)]
