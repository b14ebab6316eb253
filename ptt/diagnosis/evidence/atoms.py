"""Atoms: everything that may be part of an explanation, each with its columns and its prior odds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from torch import Tensor

from ptt.diagnosis.unknown.block import Block
from ptt.effects import Effect
from ptt.effects.sudden import Sudden
from ptt.run.axes import AXES

# Prior odds in nats against one more effect, unknown block, or memory of the noise
EFFECT_ODDS, BLOCK_ODDS, MEMORY_ODDS = 7.0, 9.0, 3.0
# Variance of a block, in units of its features: 2 mm at the tool, more than a running machine is off by
MOST_BLOCK_VARIANCE = 1e4
SHAPE_POWER = 0.75  # exponent of the number of shapes tried: neighbouring shapes are nearly one test, so fewer count

PLAIN_COLUMNS = 14  # columns up to which an effect is a plain one and no curve: two values of each of seven joints


@dataclass(frozen=True)
class Reduction:
    """An orthonormal basis of the directions of an atom's values that the rows show: values = basis @ reduced values.

    Attributes:
        basis: (w, r) orthonormal columns.
        group: number of the learned variance of each value, (w,) int.
        scale: (w,) size of a unit of each value.
    """

    basis: np.ndarray
    group: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True)
class Atom:
    """A named effect in one shape, or a block of unknown physics.

    Attributes:
        key: unique among all atoms; shapes of one effect have different keys.
        name: what is reported: the effect's key or the block's name.
        columns: indices of its m columns in the system.
        group: number of the learned prior variance of each column, (m,) int from 0; an effect has one for each kind of
            parameter.
        most: upper bound of each prior variance, (g,).
        odds: nats of prior odds against it.
        bounded: columns whose value cannot be negative, (m,) bool.
        effect: the effect; None for a block.
        shape: the effect's searched and given parameters; None where the effect is in the model.
        block: the block; None for an effect.
        reduction: how its values follow from its columns; None where each column is a value.
        joint: joint (from 0) whose value each column is, (m,) int; None where not every column is of one joint, where
            values have several units, or where there are few joints.
        leg: joint whose values each prior variance is of, (g,) int; None where joints share variances.
        fine: which variances are those of fine detail, which can imitate other effects, (g,) bool; None for none.
        tested: whether the run varies what tells it from an offset. Play in a run without reversals, or a spring under
            a single load, is not tested, and is never preferred as the plainest explanation.
        since: time from which a sudden effect that is in the model acts, s; None for all others.
        reach: largest plausible ratio of a joint's second value to its first, in their units, as of a length to a
            height; None for any.
        within: (m, 2) bounds of its values, in units of its columns: below the first the cause must be another one,
            above the second it probably is. None for no bounds.
        largest: (m,) largest possible values in this shape, in units of its columns; None for no limit.
        begin: prior variances from which the learning starts, (g,); None for those of the usual sizes.
    """

    key: str
    name: str
    columns: np.ndarray
    group: np.ndarray
    most: np.ndarray
    odds: float
    bounded: np.ndarray
    effect: Effect | None = None
    shape: Mapping[str, Tensor] | None = None
    block: Block | None = None
    reduction: Reduction | None = None
    joint: np.ndarray | None = None
    leg: np.ndarray | None = None
    fine: np.ndarray | None = None
    tested: bool = True
    since: float | None = None
    reach: float | None = None
    within: np.ndarray | None = None
    largest: np.ndarray | None = None
    begin: np.ndarray | None = None

    @property
    def moment(self) -> float | None:
        """Time from which a sudden effect acts, s by the clock; None for effects that are not sudden."""
        return self.since if self.shape is None or not is_sudden(self) else float(self.shape["after"])

    @property
    def groups(self) -> int:
        """Number of learned variances."""
        return len(self.most)

    @property
    def first_variances(self) -> np.ndarray:
        """Prior variances from which the learning starts, (g,)."""
        return np.ones(self.groups) if self.begin is None else self.begin

    def amplitudes(self, values: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """The atom's linear values in their units, (w,), from the values of its columns.

        Args:
            values: of its columns.
            scale: (P,) of all columns of the system.
        """
        return self.sizes(scale) * (values if self.reduction is None else self.reduction.basis @ values)

    def sizes(self, scale: np.ndarray) -> np.ndarray:
        """Size of a unit of each linear value, (w,); `scale` as in `amplitudes`."""
        return scale[self.columns] if self.reduction is None else self.reduction.scale


def is_effect(atom: Atom) -> bool:
    """Whether an atom is a named effect."""
    return atom.effect is not None


def is_block(atom: Atom) -> bool:
    """Whether an atom is a block of unknown physics."""
    return atom.block is not None


def is_any(atom: Atom) -> bool:
    """True of every atom: the predicate that allows all."""
    return True


def is_bent(atom: Atom) -> bool:
    """Whether an atom is a flexible curve, or a field: of more values than a plain effect has."""
    return len(atom.columns) > PLAIN_COLUMNS


def is_plain(atom: Atom) -> bool:
    """Whether an atom is an effect of few values, no flexible curve."""
    return atom.effect is not None and not is_bent(atom)


def is_field(atom: Atom) -> bool:
    """Whether an atom is an unknown that depends on position alone."""
    return atom.block is not None and set(atom.block.on) <= set(AXES)


def holds_sizes(atom: Atom) -> bool:
    """Whether an atom is a curve over a joint's travel whose level and slope are sizes of the drawing."""
    return atom.effect is not None and any(parameter.lent for parameter in atom.effect.parameters)


def is_drawn(atom: Atom) -> bool:
    """Whether an atom is an effect that corrects a size of the drawing."""
    return atom.effect is not None and atom.effect.of_drawing


def is_sudden(atom: Atom) -> bool:
    """Whether an atom is an effect that begins at one moment and stays."""
    return isinstance(atom.effect, Sudden)


def is_over_time(atom: Atom) -> bool:
    """Whether an atom is a block over time."""
    return atom.block is not None and "time" in atom.block.on


def is_timely(atom: Atom) -> bool:
    """Whether an atom is sudden, or an effect or a block over time."""
    return is_sudden(atom) or is_over_time(atom) or (atom.effect is not None and "time" in atom.effect.requires)


def is_metrology(atom: Atom) -> bool:
    """Whether an atom is an effect of the metrology: it changes the readings, not the machine."""
    return atom.effect is not None and atom.effect.stage == "metrology"


def causes(effect: Effect) -> int:
    """Number of commoner causes that together look like an effect; one where none do."""
    return max(len(effect.stands_for), 1)


def odds_of_block(blocks: int) -> float:
    """Prior odds in nats against one block, given how many the run can show."""
    return BLOCK_ODDS + float(np.log(max(blocks, 1)))


def atoms_of_blocks(blocks: Sequence[Block], place: int, odds: float) -> dict[str, Atom]:
    """Atoms of blocks whose columns are consecutive.

    Args:
        blocks: the blocks.
        place: index of the first column.
        odds: nats against one of them.

    Returns:
        The atoms by key.
    """
    atoms = {}
    for block in blocks:
        width = block.width
        columns, group = np.arange(place, place + width), np.zeros(width, dtype=int)
        atoms[block.key] = Atom(
            block.key,
            block.name,
            columns,
            group,
            np.array([MOST_BLOCK_VARIANCE]),
            odds,
            np.zeros(width, dtype=bool),
            block=block,
        )
        place += width
    return atoms
