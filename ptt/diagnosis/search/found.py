"""An explanation of a run, comparisons of explanations, and the model moved to one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.candidates import first_of
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.search.moves import LEAST_NATS
from ptt.diagnosis.search.shapes import shape_key, with_shapes
from ptt.diagnosis.unknown.block import Period
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
        fitted: fit of the model at which the system was linearised; its residuals do not contain `carried`.
        scorer: of that system, with all sets that were scored.
        state: the best set.
        noise: the noise floor that whitened the system.
        carried: contribution of the blocks to the readings, which the fit took off, (n, 3) mm.
        gross: rows left out as gross errors, (n,) bool.
        untestable: effect -> what the data lack to test it.
        periods: joint (None: time) and length of waves that residual spectra showed.
        sample: stretches of a long run that stand for it where the system keeps only sums; None otherwise.
        opening: rows left out because they depend on how the run was entered, (n,) bool; None for none.
        seen: harmonics of a turn that residual spectra showed.
        too_large: names of effects that were left out because only values that no machine has would do.
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
    too_large: tuple[str, ...] = ()

    @property
    def system(self) -> System:
        """The linearised problem."""
        return self.scorer.system


def parts_of(state: State, system: System) -> dict[str, np.ndarray]:
    """Key of a block of a set -> its contribution to the readings, (n, 3) mm."""
    blocks = {key: system.atoms[key] for key in state.keys if system.atoms[key].block is not None}
    return {
        key: atom.block.features @ atom.amplitudes(state.posterior.values[state.of(key)], system.scale)
        for key, atom in blocks.items()
        if atom.block is not None
    }


def carried_by(state: State, system: System, problem: Problem) -> np.ndarray:
    """Contribution of all blocks of a set to the readings, (n, 3) mm."""
    return sum(parts_of(state, system).values(), np.zeros((problem.table.rows, 3)))


def settled(state: State, system: System) -> bool:
    """Whether a set's effects are exactly those of the model at which the system was linearised."""
    named = {key for key in state.keys if system.atoms[key].effect is not None}
    return named == {key for key, atom in system.atoms.items() if atom.effect is not None and atom.shape is None}


def is_better(one: Found, other: Found) -> bool:
    """Whether one explanation scores higher than another by `LEAST_NATS`; not so if rows or noise differ."""
    same = np.array_equal(one.system.rows, other.system.rows) and one.noise is other.noise
    return same and one.state.total > other.state.total + LEAST_NATS


def is_denser(one: Found, other: Found, least: float = LEAST_NATS) -> bool:
    """Whether one explanation has a higher posterior density of the readings (in 1/mm) than another, by `least` nats.

    Unlike scores, these are comparable between different noises and rows. A gross error may lie anywhere within a mm or
    so, so a row that is left out has a density of one.
    """
    return _density(one) > _density(other) + least


def _density(found: Found) -> float:
    return found.state.total + found.noise.log_density(len(found.system.rows))


def moved(found: Found, model: Model, problem: Problem, *, refine: bool = True) -> Model:
    """The model as given with the explanation's effects added, new ones at the set's values.

    Args:
        found: the best explanation.
        model: as given.
        problem: the rows that it was found on.
        refine: whether to refine the shapes of new effects.

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
            term = Term(atom.effect, opened_at(atom.effect, shape, _linear_values(found, atom), problem))
        if base != atom.name:
            term = replace(term, effect=replace(term.effect, label=base.partition("[")[2].removesuffix("]")))
        current = current + term
    return current


def _linear_values(found: Found, atom: Atom) -> Tensor:
    """Linear values of an effect in the best set, (w,)."""
    return torch.as_tensor(atom.amplitudes(found.state.posterior.values[found.state.of(atom.key)], found.system.scale))


def _finest(found: Found, atom: Atom, problem: Problem) -> Shape:
    """The best-scoring refinement of the chosen shape, or the best meaning of a shape that has several."""
    assert atom.effect is not None and atom.shape is not None
    finer = atom.effect.refine(problem.view, atom.shape)
    meant = () if len(finer) > 1 else atom.effect.meant_by(problem.view, atom.shape, _linear_values(found, atom))
    shapes = meant or finer
    if len(shapes) < 2:
        return atom.shape
    state = found.state
    scorer = with_shapes(Scorer(rows_of(found.system).only(state.keys), found.scorer.given), {atom.name: shapes})
    rest = scorer.less(state, atom.key)
    nats = {gain.key: gain.nats for gain in scorer.all_gains(rest, lambda other: other.name == atom.name)}
    gains = np.array([nats.get(shape_key(atom.name, shape), -np.inf) for shape in shapes])
    if meant:
        gains[1:] -= UNUSUAL_MEANING_NATS
    return shapes[int(np.argmax(gains))] if nats else atom.shape
