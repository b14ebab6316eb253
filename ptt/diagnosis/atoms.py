"""Atoms: everything that may be part of an explanation, each with its columns and its price."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from torch import Tensor

from ptt.diagnosis.blocks import Block
from ptt.effects import Effect
from ptt.effects.base import shape_of
from ptt.effects.sudden import Sudden
from ptt.fitting.linear import Linear
from ptt.fitting.result import FitResult
from ptt.run.problem import Problem

EFFECT_ODDS, BLOCK_ODDS, MEMORY_ODDS = 7.0, 9.0, 3.0  # nats against one more effect, block, or memory of the noise
LARGEST_BLOCK = 1e4  # variance: 2 mm, more than a machine that runs is off by
LARGEST_EFFECT = 1e5  # three hundred usual sizes: drawings are off by that much
LARGEST_HELD = 1e2  # ten usual sizes: no encoder or gear is off by more, and larger waves could imitate whole links
LEGS = 3  # joints up to which the odds against some of them eat what leaving the sound ones out gains
SHAPE_POWER = 0.75  # neighbouring shapes of a search are nearly one test


@dataclass(frozen=True)
class Turn:
    """How the values of an effect or a block follow from those of the fewer columns that its rows tell apart.

    Attributes:
        ways: (w, r) orthonormal columns.
        group: which learned variance each value has, (w,).
        scale: (w,) size of a unit of each value.
    """

    ways: np.ndarray
    group: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True)
class Atom:
    """A named effect in one shape, or a block of unknown physics.

    Attributes:
        key: its own among all atoms.
        name: what is reported: the effect's key or the block's name.
        columns: indices of its columns in the system.
        group: which learned variance each of them has, (m,) int from 0; effects have one for each parameter kind.
        most: largest variance of each group, (g,).
        odds: nats of prior odds against it.
        bounded: columns whose value cannot be negative, (m,) bool.
        effect: the effect; None for a block.
        shape: its searched and given parameters; None where the effect is in the model.
        block: the block; None for an effect.
        within: values below which the cause would be another, and above which much speaks for another, (m, 2) in units
            of its columns; None where any may be.
        largest: values beyond which no cause is what it is called, in this shape, (m,) in units of its columns; None
            where any may be.
        turn: from its columns to its values; None where each column is one.
        joint: whose value each column is, (m,) int; None where not all are of one joint each with one variance for all,
            and where joints are few.
        fine: which variances are those of detail that can imitate other things, (g,) bool; None for none.
        tested: whether the readings hold what tells it from an offset: play that no reversal shows is never plainest.
        since: by the clock, from when on a sudden effect of the model is there; None of all others.
        reach: how many times its first value a joint's second may well be, in their units; None where it may be any.
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
    turn: Turn | None = None
    joint: np.ndarray | None = None
    fine: np.ndarray | None = None
    tested: bool = True
    since: float | None = None
    reach: float | None = None
    within: np.ndarray | None = None
    largest: np.ndarray | None = None

    @property
    def moment(self) -> float | None:
        """By the clock, from when on something sudden is there; None of what is not."""
        return self.since if self.shape is None or not is_sudden(self) else float(self.shape["after"])

    @property
    def groups(self) -> int:
        """Number of learned variances."""
        return len(self.most)

    def amplitudes(self, values: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Its linear values in their units from those of its columns, (w,).

        Args:
            values: of its columns.
            scale: (P,) of all columns of the system.
        """
        return self.sizes(scale) * (values if self.turn is None else self.turn.ways @ values)

    def sizes(self, scale: np.ndarray) -> np.ndarray:
        """Units of its linear values, (w,); `scale` as in `amplitudes`."""
        return scale[self.columns] if self.turn is None else self.turn.scale


def is_effect(atom: Atom) -> bool:
    """Whether an atom is a named effect."""
    return atom.effect is not None


def is_block(atom: Atom) -> bool:
    """Whether an atom is a block of unknown physics."""
    return atom.block is not None


def is_any(atom: Atom) -> bool:
    """Whether an atom is one at all: where all of them may be taken."""
    return True


def is_sudden(atom: Atom) -> bool:
    """Whether an atom is an effect that comes at a moment, and stays."""
    return isinstance(atom.effect, Sudden)


def is_metrology(atom: Atom) -> bool:
    """Whether an atom is an effect that leaves the machine as it is: the tracker alone says otherwise."""
    return atom.effect is not None and atom.effect.stage == "metrology"


def causes(effect: Effect) -> int:
    """How many commoner causes an effect looks like together; one where it looks like itself alone."""
    return max(len(effect.stands_for), 1)


def odds_of_effect(effect: Effect, effects: int, shapes: int) -> float:
    """Nats against one effect out of those that the data can test, in one of its shapes."""
    each = EFFECT_ODDS + float(np.log(max(effects, 1)))
    return causes(effect) * each + SHAPE_POWER * float(np.log(max(shapes, 1))) + effect.odds_of_kind


def odds_of_block(blocks: int) -> float:
    """Nats against one block out of those that the run can show."""
    return BLOCK_ODDS + float(np.log(max(blocks, 1)))


def atoms_of(linear: Linear, fitted: FitResult, problem: Problem, candidates: Sequence[Effect]) -> dict[str, Atom]:
    """Atoms of the effects in a model and of the candidates beside it.

    Args:
        linear: their columns.
        fitted: the model.
        problem: n rows.
        candidates: effects that may be added.

    Returns:
        The atoms by key; those of candidates are numbered by shape.
    """
    sided = bool(problem.two_sided.any())
    names = {effect.name for effect in candidates} | {term.effect.name for term in fitted.model.terms}
    atoms: dict[str, Atom] = {}
    for term, free in zip(fitted.layout.terms, fitted.layout.free, strict=True):
        key, columns = term.effect.key, linear.present[term.effect.key]
        if not len(columns):
            continue
        shapes = len(tuple(term.effect.search(problem.view)))
        odds = odds_of_effect(term.effect, len(names), shapes)
        own = next(item for item in fitted.model.terms if item.effect.key == key)
        atom = effect_atom(key, columns, own.effect, problem, odds, None, free)
        atom = _in_shape(atom, shape_of(own.effect, own.theta, problem.view.joints), problem, free)
        since = float(own.theta[-1]) if is_sudden(atom) else None
        atoms[key] = replace(atom, since=since, tested=sided or not _has_sides(atom))
    like: dict[str, Atom] = {}  # of each effect its first shape
    for number, trial in enumerate(linear.trials):
        key, name = f"{trial.effect.key}#{number}", trial.effect.key
        if name not in like:
            odds = odds_of_effect(trial.effect, len(names), trial.trials)
            first = effect_atom(key, trial.columns, trial.effect, problem, odds, trial.shape)
            like[name] = replace(first, tested=sided or not _has_sides(first))
        atom = replace(like[name], key=key, columns=trial.columns, shape=trial.shape)
        atoms[key] = _in_shape(atom, trial.shape, problem, slice(0, len(trial.columns)))
    return atoms


def _in_shape(atom: Atom, shape: Mapping[str, Tensor], problem: Problem, chosen: np.ndarray | slice) -> Atom:
    """The same with the largest values that its cause can have in this shape."""
    assert atom.effect is not None
    largest = atom.effect.largest(shape)
    if not largest:
        return atom
    kind, joints = problem.file.machine.kind, problem.view.joints
    each = [(p.size(joints), largest.get(p.stem, np.inf) / p.on(kind).usual) for p in atom.effect.parameters]
    return replace(atom, largest=np.concatenate([np.full(size, most) for size, most in each])[chosen])


def _has_sides(atom: Atom) -> bool:
    """Whether an atom is an effect that the way a joint came tells."""
    return atom.effect is not None and "direction" in atom.effect.requires


def atoms_of_blocks(blocks: Sequence[Block], place: int, odds: float) -> dict[str, Atom]:
    """Atoms of blocks whose columns stand one behind the other.

    Args:
        blocks: the blocks.
        place: of the first column.
        odds: nats against one of them.

    Returns:
        The atoms by name.
    """
    atoms = {}
    for block in blocks:
        width = block.width
        columns, group = np.arange(place, place + width), np.zeros(width, dtype=int)
        atoms[block.name] = Atom(
            block.name,
            block.name,
            columns,
            group,
            np.array([LARGEST_BLOCK]),
            odds,
            np.zeros(width, dtype=bool),
            block=block,
        )
        place += width
    return atoms


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
        key: its own among all atoms.
        columns: indices of its columns, one for each linear value, or for each that is free.
        effect: the effect.
        problem: n rows.
        odds: nats of prior odds against it.
        shape: its searched and given parameters; None where it is in the model.
        free: of all its values those that have a column, bool; None for as many of the first as there are columns.
    """
    chosen = slice(0, len(columns)) if free is None else free
    group, bounded, held, joint, detail, within = _kinds_of_values(effect, problem, chosen)
    group = np.unique(group, return_inverse=True)[1].reshape(-1)
    most = np.full(int(group.max(initial=-1)) + 1, LARGEST_EFFECT)
    most[group[held]] = LARGEST_HELD
    alike = len(most) == 1 and (joint >= 0).all() and joint.max(initial=0) >= LEGS
    fine = np.isin(np.arange(len(most)), group[detail])
    return Atom(
        key, effect.key, columns, group, most, odds, bounded, effect, shape,
        joint=joint if alike else None, fine=fine if fine.any() else None, reach=effect.reach(problem.view),
        within=within if np.isfinite(within).any() else None,
    )  # fmt: skip


def _kinds_of_values(effect: Effect, problem: Problem, chosen: np.ndarray | slice) -> tuple[np.ndarray, ...]:
    """Of each value: variance, whether it cannot be negative, is near zero by definition, whose, if detail, how large.

    Linear values share one variance, but curves have one a joint, because one joint alone may have a curve: many
    superfluous values beside the few that matter would cost an effect its evidence. Curves of one joint share theirs,
    and so does their straight part. Fine detail has one for all joints, which are of one make and equally rough: a spot
    or a step of one of them is none. What is kept near zero has one a joint altogether: where zero lies divides cosines
    from sines, which nature does not; waves have one for each band of how often they come.
    """
    joints, first, curves = problem.view.joints, 1, 0
    bands = 1 + max((number for parameter in effect.parameters for number in parameter.bands), default=0)
    group, bounded, held, joint, detail, within = list[np.ndarray](), [], [], [], [], []
    for parameter in effect.parameters:
        size = parameter.size(joints)
        if parameter.role == "linear" and parameter.per_joint and parameter.count > 1 and not parameter.fine:
            curves = curves or first
            band = np.array(parameter.bands or (0,) * parameter.count)
            group.append((curves + bands * np.arange(joints)[:, None] + band).reshape(-1))
            first += bands * joints
        else:
            own = parameter.held or parameter.fine or parameter.role != "linear"
            group.append(np.full(size, first if own else 0))
            first += 1
        bounded.append(np.full(size, parameter.lower >= 0.0))
        held.append(np.full(size, parameter.held and not parameter.lent))
        joint.append(np.arange(joints) if parameter.per_joint and size == joints else np.full(size, -1))
        detail.append(np.full(size, parameter.fine))
        within.append(np.tile(parameter.within or (-np.inf, np.inf), (size, 1)))
    return tuple(np.concatenate(each)[chosen] for each in (group, bounded, held, joint, detail, within))


def straight_sizes(effect: Effect, problem: Problem) -> np.ndarray:
    """How many usual sizes the straight part of a curve is beside the curve, for each of an effect's values.

    A curve has no straight part over its whole travel. The share f of the travel that was visited sees one: a curve
    whose slope wanders at random has a level of 1/f - 1 times its bow there, and about as much slope.

    Args:
        effect: the effect.
        problem: n rows.

    Returns:
        (w,) of all its parameters in their order; one for all but what others lend their cause to.
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
