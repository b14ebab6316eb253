"""Found: an explanation of a run, and the model moved to what it says."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.candidates import first_of
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.search.moves import LEAST_NATS
from ptt.diagnosis.search.shapes import shape_key, with_shapes
from ptt.diagnosis.unknown.blocks import Period
from ptt.effects.screw import OncePerRev
from ptt.fitting.linear import Shape
from ptt.fitting.result import FitResult
from ptt.fitting.search import opened_at
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem

UNUSUAL_MEANING_NATS = 5.0  # nats by which another meaning of a shape has to beat the usual one


@dataclass(frozen=True)
class Found:
    """The best explanation of a run.

    Attributes:
        fitted: the model with the named effects, at which the system was linearised; residuals hold the blocks' share.
        scorer: of the system that was linearised there, with all that was scored.
        state: the best set.
        noise: the noise floor as it ended.
        carried: what the blocks put into the readings, (n, 3) mm.
        gross: rows left out as gross errors, (n,) bool.
        untestable: effect -> what the data lack.
        periods: joint (None: time) and length of those that were seen in what was left.
        seen: harmonics of a turn that were.
        sample: stretches of the run that stand for it where a system keeps only sums.
        opening: rows left out because they tell from where the joints came to the run, (n,) bool; None for none.
    """

    fitted: FitResult
    scorer: Scorer
    state: State
    noise: Noise
    carried: np.ndarray
    gross: np.ndarray
    untestable: dict[str, str]
    periods: Sequence[Period] = ()
    sample: Problem | None = None
    opening: np.ndarray | None = None
    seen: tuple[OncePerRev, ...] = ()

    @property
    def system(self) -> System:
        """The linearised problem."""
        return self.scorer.system


def parts_of(state: State, system: System) -> dict[str, np.ndarray]:
    """What each block of a state puts into the readings, (n, 3) mm."""
    blocks = {key: system.atoms[key] for key in state.keys if system.atoms[key].block is not None}
    return {
        key: atom.block.features @ atom.amplitudes(state.posterior.values[state.of(key)], system.scale)
        for key, atom in blocks.items()
        if atom.block is not None
    }


def carried_by(state: State, system: System, problem: Problem) -> np.ndarray:
    """What the blocks of a state put into the readings, (n, 3) mm."""
    return sum(parts_of(state, system).values(), np.zeros((problem.table.rows, 3)))


def settled(state: State, system: System) -> bool:
    """Whether the search named just what the system was linearised at.

    Args:
        state: the best set.
        system: the linearised problem.

    Returns:
        Whether it did.
    """
    named = {key for key in state.keys if system.atoms[key].effect is not None}
    return named == {key for key, atom in system.atoms.items() if atom.effect is not None and atom.shape is None}


def is_better(one: Found, other: Found) -> bool:
    """Whether one explanation of the same rows says clearly more than another.

    Args:
        one: an explanation.
        other: another; a search on other rows or with another noise is not comparable.

    Returns:
        Whether the one does.
    """
    same = np.array_equal(one.system.rows, other.system.rows) and one.noise is other.noise
    return same and one.state.total > other.state.total + LEAST_NATS


def says_more(one: Found, other: Found, least: float = LEAST_NATS) -> bool:
    """The same as `is_better`, also with another noise and other rows: by the density of the readings in 1/mm.

    A gross error may lie anywhere within a mm or so, so a row that is left out has a density of one.
    """
    return _density(one) > _density(other) + least


def _density(found: Found) -> float:
    return found.state.total + found.noise.log_density(len(found.system.rows))


def moved(found: Found, model: Model, problem: Problem, *, refine: bool = True) -> Model:
    """The model as given with the named effects at the state's values.

    Args:
        found: the best explanation.
        model: as given.
        problem: the rows that it was found on.
        refine: look for finer shapes of new effects.

    Returns:
        The model.
    """
    current = model
    for key in found.state.keys:
        atom = found.system.atoms[key]
        if atom.effect is None or atom.name in current.keys:
            continue
        base = first_of(atom.name, {found.system.atoms[key].name for key in found.state.keys})
        if base in current.keys:
            continue
        if atom.shape is None:
            term = next(term for term in found.fitted.model.terms if term.effect.key == atom.name)
        else:
            shape = _finest(found, atom, problem) if refine else atom.shape
            term = Term(atom.effect, opened_at(atom.effect, shape, _amounts(found, atom), problem))
        if base != atom.name:
            term = replace(term, effect=replace(term.effect, label=base.partition("[")[2].removesuffix("]")))
        current = current + term
    return current


def _amounts(found: Found, atom: Atom) -> Tensor:
    """What a state says of the linear values of an effect, (w,)."""
    return torch.as_tensor(atom.amplitudes(found.state.posterior.values[found.state.of(atom.key)], found.system.scale))


def _finest(found: Found, atom: Atom, problem: Problem) -> Shape:
    """The shape near the chosen one that scores best in its place; of what it may stand for, what the rows say."""
    assert atom.effect is not None and atom.shape is not None
    finer = atom.effect.refine(problem.view, atom.shape)
    meant = () if len(finer) > 1 else atom.effect.meant_by(problem.view, atom.shape, _amounts(found, atom))
    shapes = meant or finer
    if len(shapes) < 2:
        return atom.shape
    state = found.state
    scorer = with_shapes(Scorer(rows_of(found.system).only(state.keys), found.scorer.given), {atom.name: shapes})
    rest = scorer.score(without(state, atom.key), state.memory, state.variances)
    nats = {gain.key: gain.nats for gain in scorer.all_gains(rest, lambda other: other.name == atom.name)}
    gains = np.array([nats.get(shape_key(atom.name, shape), -np.inf) for shape in shapes])
    if meant:
        gains[1:] -= UNUSUAL_MEANING_NATS
    return shapes[int(np.argmax(gains))] if nats else atom.shape
