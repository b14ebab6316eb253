"""Changes of a machine as hypotheses: of each value alone, of a curve, of all values of an effect in proportion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.again.atoms import side_by_side
from ptt.again.prior import Prior
from ptt.diagnosis.evidence.atoms import Atom
from ptt.effects import Effect
from ptt.model.model import parameter_names

# Markov's inequality: on an unchanged machine a Bayes factor of 100 against it has a chance of at most 1 in 100.
CHANGE_ODDS = float(np.log(100.0))
CURVE = 3  # values of a parameter for one joint, from which they are a curve and change together
CHANGED_PREFIX = "changed: "


@dataclass(frozen=True)
class Change:
    """A hypothetical change of m values of one effect.

    Attributes:
        key: of its atom.
        effect: whose values change.
        places: index of each value in `Prior.values`, (m,).
        names: of each value, as in 'gap_mm 2'.
        parameters: name of the parameter of each value.
        joints: number of the joint of each value, from 1; 0 where it belongs to none.
        units: of each value.
        at: index of each value in the effect's flat parameters, (m,).
        ways: derivative of the values by the d unknowns of the change, (m, d) in usual sizes.
        whole: whether all values of the effect change in proportion, as when it is cured, or grows.
    """

    key: str
    effect: Effect
    places: np.ndarray
    names: tuple[str, ...]
    parameters: tuple[str, ...]
    joints: tuple[int, ...]
    units: tuple[str, ...]
    at: np.ndarray
    ways: np.ndarray
    whole: bool = False


def changes_of(prior: Prior, joints: int) -> tuple[Change, ...]:
    """All hypothetical changes of a model.

    Args:
        prior: the solved model.
        joints: number of joints k.

    Returns:
        The changes, of linear values only: searched ones (a time constant) and those held near zero have none.
    """
    kind, found, first = prior.model.file.machine.kind, list[Change](), 0
    wholes = list[Change]()
    for term, free in zip(prior.layout.terms, prior.layout.free, strict=True):
        names = parameter_names(term.effect, kind, joints)
        place = first + np.cumsum(free) - 1
        start, mine = 0, len(found)
        for parameter in (declared.on(kind) for declared in term.effect.parameters):
            size = parameter.size(joints)
            own = np.arange(start, start + size)
            start += size
            if parameter.role != "linear" or parameter.held or term.effect.key in prior.blind:
                continue
            apart = parameter.count if parameter.per_joint and parameter.count >= CURVE else 1
            for part in own.reshape(-1, apart):
                each = ((part - own[0]) // parameter.count + 1).tolist() if parameter.per_joint else [0] * len(part)
                label = names[part[0]] if apart == 1 else f"{parameter.name} {each[0]}"
                key = f"{CHANGED_PREFIX}{term.effect.key} {label}"
                found.append(
                    Change(
                        key, term.effect, place[part], tuple(names[at] for at in part), (parameter.name,) * apart,
                        tuple(each), (parameter.unit,) * apart, part, np.eye(apart),
                    )
                )  # fmt: skip
        wholes += _whole(found[mine:], prior)
        if term.effect.key in prior.cured:  # what is left of a cured effect is a share of all its values
            del found[mine:]
        first += int(free.sum())
    return (*found, *wholes)


def _whole(parts: Sequence[Change], prior: Prior) -> list[Change]:
    """The change of all values of an effect in proportion; none for a single value, or where all are zero."""
    if sum(len(part.places) for part in parts) < 2:
        return []
    places = np.concatenate([part.places for part in parts])
    ways = prior.values[places][:, None]
    if not ways.any():
        return []
    effect = parts[0].effect
    names, parameters, joints, units = (
        tuple(one for part in parts for one in getattr(part, field))
        for field in ("names", "parameters", "joints", "units")
    )
    at = np.concatenate([part.at for part in parts])
    key = f"{CHANGED_PREFIX}{effect.key} as a whole"
    return [Change(key, effect, places, names, parameters, joints, units, at, ways, True)]


def atoms_of_changes(changes: Sequence[Change], first: int) -> dict[str, Atom]:
    """Atoms of changes, all equally likely.

    Args:
        changes: the hypothetical changes.
        first: index of the first column in the linear problem.

    Returns:
        The atoms by key.
    """
    return side_by_side(
        [(change.key, change.effect, change.ways.shape[1]) for change in changes], CHANGE_ODDS, len(changes), first
    )
