"""Search for the best explanation of a run by a solved model: unchanged, some values changed, something new."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ptt.again.changes import CHANGED_PREFIX, Change, changes_of
from ptt.again.linear_problem import ExpansionPoint, LinearProblem, build_linear_problem, expansion_point
from ptt.again.masked_effects import MASKED_PREFIX, MaskedEffect
from ptt.again.own_frame import OwnFrame, own_frame_of
from ptt.again.prior import Prior
from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.noise_level import noise_again, starting_noise
from ptt.diagnosis.evidence.row_system import RowSystem
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.gross import gross_errors, places_of
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.improve import improve
from ptt.diagnosis.search.plainest import PLAIN_NATS
from ptt.diagnosis.search.search import search
from ptt.diagnosis.search.turn import best_moments, gross_beside, shapes_of
from ptt.diagnosis.telling.steps import BESIDE_NATS
from ptt.effects import Effect, Library
from ptt.fitting.linear import Shape, few_shapes, linear_columns
from ptt.progress import Tell
from ptt.run.noise import Noise
from ptt.run.problem import Problem

TURNS = 4  # of linearising and searching
STEPS = 12  # changes and new effects in one explanation, at most
SETTLED = 0.05  # usual sizes: the iteration ends where no value has moved further since its linearisation
# Unexplained error of the model's own run over the noise of that run, from which unknown physics is taken as known.
KNOWN_REST = 0.5


@dataclass(frozen=True)
class Explanation:
    """The best explanation of a run by a solved model.

    Attributes:
        prior: the solved model.
        at: where it was linearised last.
        linear_problem: the linear problem there.
        scorer: of its sets of hypotheses, with a memo of the scores.
        state: the best set.
        changes: all hypothetical changes.
        noise: the noise floor, last estimate.
        gross: rows left out as gross errors, (n,) bool.
        alike: key of a cured effect -> other effects whose cure explains the run as well.
    """

    prior: Prior
    at: ExpansionPoint
    linear_problem: LinearProblem
    scorer: Scorer
    state: State
    changes: tuple[Change, ...]
    noise: Noise
    gross: np.ndarray
    alike: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def system(self) -> RowSystem:
        """Rows and columns on which the sets are scored."""
        return self.linear_problem.system

    @property
    def changed(self) -> tuple[Change, ...]:
        """The changes in the best set, and those of cured effects."""
        return tuple(c for c in self.changes if c.key in self.state.keys or c.effect.key in self.prior.cured)

    @property
    def new(self) -> tuple[str, ...]:
        """Keys of effects and unknown physics of the machine that the model does not have."""
        atoms = self.system.atoms
        return tuple(key for key in self._not_in_model if not _of_set_up(atoms[key].effect))

    @property
    def masked(self) -> tuple[MaskedEffect, ...]:
        """Masked effects in the best set: present in both runs, though the model does not have them."""
        return tuple(masked for masked in self.prior.masked_effects.each if masked.key in self.state.keys)

    @property
    def set_up(self) -> tuple[str, ...]:
        """Keys of movements of the set-up during the run, which are no change of the machine."""
        atoms = self.system.atoms
        return tuple(key for key in self._not_in_model if _of_set_up(atoms[key].effect))

    @property
    def _not_in_model(self) -> list[str]:
        """Keys of the best set that are neither changes nor masked effects."""
        return [key for key in self.state.keys if not key.startswith((CHANGED_PREFIX, MASKED_PREFIX))]

    @property
    def frame(self) -> np.ndarray:
        """Indices of the columns of the run's own frames and mounts."""
        uncertain = self.prior.root.shape[1] + self.linear_problem.extrapolation.shape[2]
        return self.system.frame[: len(self.system.frame) - uncertain]

    @property
    def extrapolated(self) -> np.ndarray:
        """Shift of the readings by the estimated extrapolation of the model's curves, (m, 3) whitened."""
        own, beyond = np.flatnonzero(self.state.owner < 0), self.linear_problem.extrapolation
        return np.asarray(beyond @ self.state.posterior.values[own[len(own) - beyond.shape[2] :]])

    @cached_property
    def own_frame(self) -> OwnFrame:
        """The run's own frames and mounts at the last linearisation."""
        return own_frame_of(self.system, self.at.fitted, self.frame, len(self.linear_problem.on_base))

    def shift_of(self, keys: Sequence[str]) -> np.ndarray:
        """Shift of the readings by some atoms of the best set, in the run's own frame, (3 m,) whitened."""
        state, system, count = self.state, self.system, len(self.linear_problem.on_base)
        places = np.concatenate([np.zeros(0, dtype=int), *(state.of(key) for key in keys)])
        columns, values = state.columns[places], state.posterior.values[places]
        on_rows, on_base = (each[:, :, columns] @ values for each in (system.columns, system.base_columns[:count]))
        return self.own_frame.without(on_rows.ravel(), on_base.ravel())

    def columns_of(self, change: Change) -> np.ndarray:
        """Indices of a change's columns."""
        return self.system.atoms[change.key].columns


def find_explanation(
    prior: Prior, problem: Problem, known: Library, tell: Tell, beside: Explanation | None = None
) -> Explanation:
    """Find the best explanation of a run by a solved model.

    Args:
        prior: the solved model.
        problem: the run.
        known: effects by name.
        tell: told what is being done.
        beside: an explanation to compare scores with, whose noise and rows are kept; None estimates them.

    Returns:
        The explanation.
    """
    noise, freedom = starting_noise(problem)
    if beside is not None:
        noise = beside.noise
    changes = changes_of(prior, problem.view.joints)
    moved, gross = np.zeros(prior.width), np.zeros(problem.table.rows, dtype=bool)
    kept: tuple[str, ...] | None = None
    moments: tuple[Shape, ...] = ()
    memory = WHITE
    for turn in range(TURNS):
        tell(f"weigh {turn + 1}")
        at = expansion_point(prior, moved, problem.masked(gross), noise)
        candidates, _ = present_candidates(at.fitted, problem, known)
        if turn == 0:
            gross = _find_gross(at, problem, candidates, noise) if beside is None else beside.gross
        rows = problem.used & ~gross & np.isfinite(at.fitted.residual).all(axis=1)
        shapes = {effect.key: shapes_of(effect, problem.view, moments) for effect in candidates}
        linear_problem = build_linear_problem(prior, at, problem, changes, candidates, noise, freedom, rows, shapes)
        system = linear_problem.system
        system.atoms = _with_cheap_unknowns(system, prior)
        scorer = Scorer(system, (), STEPS, {change.key for change in changes if change.effect.key in prior.cured})
        if kept is None:
            state = search(scorer)
        else:
            state = improve(scorer, scorer.score([key for key in kept if key in system.atoms], memory))
        state = _prefer_single_values(scorer, _value_by_value(scorer, _prefer_known(scorer, state), changes), changes)
        found = Explanation(
            prior=prior, at=at, linear_problem=linear_problem, scorer=scorer, state=state, changes=changes, noise=noise,
            gross=gross,
        )  # fmt: skip
        if turn == TURNS - 1:
            break
        if beside is None:
            gross = gross_beside(system, state, gross)
        there = displacement_of(found)
        still = np.abs(there - at.moved).max(initial=0.0) < SETTLED and (gross == found.gross).all()
        if turn > 0 and still and _same_names(kept, state):
            break
        new = [key for key in state.keys if not key.startswith((CHANGED_PREFIX, MASKED_PREFIX))]
        moments = best_moments(scorer, state, new, candidates)
        if beside is None:
            noise = noise_again(problem, system, state)
        moved, kept, memory = there, state.keys, state.memory
    return found


def displacement_of(found: Explanation) -> np.ndarray:
    """Displacement of the model's values from `Prior.start` by changes and masked effects, (w,) in usual sizes."""
    moved = np.zeros(found.prior.width)
    for masked in found.masked:
        moved -= masked.absorbed @ found.state.posterior.values[found.state.of(masked.key)]
    moved[found.prior.gone] = 0.0
    for change in [change for change in found.changed if change.key in found.state.keys]:
        moved[change.places] += change.ways @ found.state.posterior.values[found.state.of(change.key)]
    return moved


def _prefer_known(scorer: Scorer, state: State) -> State:
    """The best set without anything new, unless the set with it scores clearly higher.

    The model is itself approximate, and what it leaves over must not be called new: hence the larger margin. The
    smaller one suffices where a named effect replaces changes, since it then is no remainder of these.
    """
    atoms = scorer.system.atoms

    def known(key: str) -> bool:
        return _is_change(key) or _of_set_up(atoms[key].effect)

    if all(known(key) for key in state.keys):
        return state
    start = scorer.score([key for key in state.keys if known(key)], state.memory)
    ends = [improve(scorer, one, lambda atom: known(atom.key)) for one in (start, scorer.score((), WHITE))]
    best = max(ends, key=lambda other: other.total)
    named = all(atoms[key].effect for key in state.keys)
    instead = named and sum(map(_is_change, state.keys)) < sum(map(_is_change, best.keys))
    return best if state.total < best.total + (PLAIN_NATS if instead else BESIDE_NATS) else state


def _prefer_single_values(scorer: Scorer, state: State, changes: Sequence[Change]) -> State:
    """Replace the change of a whole effect by that of one of its values where the score is no worse than a tie."""
    for whole in [change for change in changes if change.whole and change.key in state.keys]:
        rest, own = without(state, whole.key), [c for c in changes if c.effect.key == whole.effect.key and not c.whole]
        singles = [scorer.score((*rest, one.key), state.memory) for one in own if one.key not in rest]
        best = max(singles, key=lambda other: other.total, default=state)
        state = best if best.total > state.total - PLAIN_NATS else state
    return state


def _value_by_value(scorer: Scorer, state: State, changes: Sequence[Change]) -> State:
    """Replace the change of a whole effect by changes of its single values, where that scores higher.

    Where the model's fit could not separate an effect from others, a cure does not move its values in proportion.
    """
    whole = {change.effect.key for change in changes if change.whole and change.key in state.keys}
    for key in sorted(whole):
        own = [change for change in changes if change.effect.key == key]
        singles = [change.key for change in own if not change.whole]
        # Without the changes of other effects: they may only compensate for what the whole does not explain.
        rest = [other for other in state.keys if not _is_change(other)]
        alone = improve(scorer, scorer.score((*rest, *singles), state.memory), lambda atom: _is_change(atom.key))
        mixed = any(name in state.keys for name in singles)  # then a value changes twice, each time in part
        state = alone if mixed else max(state, alone, key=lambda one: one.total)
    return state


def _is_change(key: str) -> bool:
    return key.startswith(CHANGED_PREFIX)


def _of_set_up(effect: Effect | None) -> bool:
    return effect is not None and effect.of_run


def _same_names(kept: Sequence[str] | None, state: State) -> bool:
    return kept is not None and set(kept) == set(state.keys)


def _with_cheap_unknowns(system: RowSystem, prior: Prior) -> dict[str, Atom]:
    """Atoms with lower prior odds against unknown physics, the choice among its kinds, where the model left some."""
    if prior.last is None or prior.left < KNOWN_REST * float(prior.last.noise_um["total"]):
        return system.atoms
    kinds = sum(atom.effect is None for atom in system.atoms.values())
    odds = float(np.log(max(kinds, 1)))
    return {key: atom if atom.effect else replace(atom, odds=odds) for key, atom in system.atoms.items()}


def _find_gross(at: ExpansionPoint, problem: Problem, candidates: Sequence[Effect], noise: Noise) -> np.ndarray:
    """Single rows that neither the model with all values free nor the saturated model explains, (n,) bool."""
    linear = linear_columns(at.fitted, problem, candidates, noise)
    saturated = few_shapes(linear.trials, linear.simple)
    return gross_errors(linear.columns, linear.residual, linear.rows, linear.simple, saturated, places_of(problem))
