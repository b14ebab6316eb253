"""What may have changed: every value by itself, a curve as a whole; each a hypothesis with its prior odds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.again.atoms import side_by_side
from ptt.again.before import Before
from ptt.diagnosis.evidence.atoms import Atom
from ptt.effects import Effect
from ptt.model.model import parameter_names

# Markov's inequality: a Bayes factor of a hundred for anything at all comes by chance in one sound run of a hundred.
CHANGE_ODDS = float(np.log(100.0))
CURVE = 3  # values of one joint's parameter from which they are one curve
PREFIX = "changed: "


@dataclass(frozen=True)
class Change:
    """One thing that may be otherwise than it was.

    Attributes:
        key: its own among all atoms.
        effect: that it is a value of.
        places: (m,) of its values among those of `Before`.
        names: of each value, as in 'gap_mm 2'.
        parameters: name of the parameter of each value.
        joints: number of the joint of each value, from 1; 0 where it belongs to none.
        units: of each value.
        at: (m,) place of each value in the effect's own flat parameters.
        ways: (m, d) how the values move with what is looked for, in usual sizes.
        whole: whether all values of an effect move in proportion, as when it is cured, or grows.
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


def changes_of(before: Before, joints: int) -> tuple[Change, ...]:
    """Everything in a model that may have changed.

    Args:
        before: the solved model.
        joints: k.

    Returns:
        The changes; searched values (a length, a time constant) and those held near zero only follow the others.
    """
    kind, found, first = before.model.file.machine.kind, list[Change](), 0
    wholes = list[Change]()
    for term, free in zip(before.layout.terms, before.layout.free, strict=True):
        names = parameter_names(term.effect, kind, joints)
        place = first + np.cumsum(free) - 1
        start, mine = 0, len(found)
        for parameter in (declared.on(kind) for declared in term.effect.parameters):
            size = parameter.size(joints)
            own = np.arange(start, start + size)
            start += size
            if parameter.role != "linear" or parameter.held or term.effect.key in before.blind:
                continue
            apart = parameter.count if parameter.per_joint and parameter.count >= CURVE else 1
            for part in own.reshape(-1, apart):
                each = ((part - own[0]) // parameter.count + 1).tolist() if parameter.per_joint else [0] * len(part)
                label = names[part[0]] if apart == 1 else f"{parameter.name} {each[0]}"
                key = f"{PREFIX}{term.effect.key} {label}"
                found.append(
                    Change(
                        key, term.effect, place[part], tuple(names[at] for at in part), (parameter.name,) * apart,
                        tuple(each), (parameter.unit,) * apart, part, np.eye(apart),
                    )
                )  # fmt: skip
        wholes += _whole(found[mine:], before)
        if term.effect.key in before.cured:  # of what is gone only a share of the whole may be left
            del found[mine:]
        first += int(free.sum())
    return (*found, *wholes)


def _whole(parts: Sequence[Change], before: Before) -> list[Change]:
    """All values of an effect at once, in the proportion that they have."""
    if sum(len(part.places) for part in parts) < 2:
        return []
    places = np.concatenate([part.places for part in parts])
    ways = before.values[places][:, None]
    if not ways.any():
        return []
    effect = parts[0].effect
    names, parameters, joints, units = (
        tuple(one for part in parts for one in getattr(part, field))
        for field in ("names", "parameters", "joints", "units")
    )
    at = np.concatenate([part.at for part in parts])
    key = f"{PREFIX}{effect.key} as a whole"
    return [Change(key, effect, places, names, parameters, joints, units, at, ways, True)]


def atoms_of_changes(changes: Sequence[Change], first: int) -> dict[str, Atom]:
    """Changes as hypotheses beside others, all equally likely; columns stand one behind the other.

    Args:
        changes: what may have changed.
        first: place of the first column.

    Returns:
        The atoms by key.
    """
    return side_by_side(
        [(change.key, change.effect, change.ways.shape[1]) for change in changes], CHANGE_ODDS, len(changes), first
    )
