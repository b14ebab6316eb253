"""Weigh what may have happened to a machine since its model: the same, some values changed, something new."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ptt.again.before import Before
from ptt.again.changes import PREFIX, Change, changes_of
from ptt.again.own_frame import OwnFrame, own_frame_of
from ptt.again.supposed import At, Supposed, stand_at, suppose
from ptt.again.then import THEN, Then
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
STEPS = 12  # changes and new effects that may be named
SETTLED = 0.05  # usual sizes by which a value may still move when it is linearised for the last time
KNOWN_REST = 0.5  # share of the noise of then from which what a model left unexplained is known to be there


@dataclass(frozen=True)
class Weighed:
    """The best explanation of a run by a solved model.

    Attributes:
        before: the solved model.
        at: where it was linearised last.
        supposed: the linear problem there.
        scorer: with all that was scored there.
        state: the best set.
        changes: what may have changed.
        noise: the noise floor as it ended.
        gross: rows left out as gross errors, (n,) bool.
        untestable: effect -> what the run lacks.
        alike: effect that is gone -> other effects of the model that may be it as well.
    """

    before: Before
    at: At
    supposed: Supposed
    scorer: Scorer
    state: State
    changes: tuple[Change, ...]
    noise: Noise
    gross: np.ndarray
    untestable: dict[str, str]
    alike: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def system(self) -> RowSystem:
        """What the sets were scored on."""
        return self.supposed.system

    @property
    def changed(self) -> tuple[Change, ...]:
        """What has changed."""
        return tuple(c for c in self.changes if c.key in self.state.keys or c.effect.key in self.before.cured)

    @property
    def new(self) -> tuple[str, ...]:
        """Keys of effects and unknown physics of the machine that the model does not have."""
        atoms = self.system.atoms
        return tuple(key for key in self._unknown if not _of_set_up(atoms[key].effect))

    @property
    def then(self) -> tuple[Then, ...]:
        """Effects that the model's own run had as well, though the model does not have them."""
        return tuple(room for room in self.before.rooms.each if room.key in self.state.keys)

    @property
    def set_up(self) -> tuple[str, ...]:
        """Keys of what happened to the set-up during the run, which is no change of the machine."""
        atoms = self.system.atoms
        return tuple(key for key in self._unknown if _of_set_up(atoms[key].effect))

    @property
    def _unknown(self) -> list[str]:
        """Keys that neither a value of the model nor its own run's rooms have."""
        return [key for key in self.state.keys if not key.startswith((PREFIX, THEN))]

    @property
    def frame(self) -> np.ndarray:
        """Columns of the run's own frames and mounts in the system."""
        unsure = self.before.root.shape[1] + self.supposed.beyond.shape[2]
        return self.system.frame[: len(self.system.frame) - unsure]

    @property
    def goes_on(self) -> np.ndarray:
        """What the model's curves seem to do where they were not seen, (m, 3) whitened."""
        own, beyond = np.flatnonzero(self.state.owner < 0), self.supposed.beyond
        return np.asarray(beyond @ self.state.posterior.values[own[len(own) - beyond.shape[2] :]])

    @cached_property
    def own_frame(self) -> OwnFrame:
        """What the run's own frames and mounts take of what is said of its readings."""
        return own_frame_of(self.system, self.at.fitted, self.frame, len(self.supposed.on_base))

    def work_of(self, keys: Sequence[str]) -> np.ndarray:
        """What some of the set do to the readings in the run's own frame, (3 m,) whitened."""
        state, system, count = self.state, self.system, len(self.supposed.on_base)
        places = np.concatenate([np.zeros(0, dtype=int), *(state.of(key) for key in keys)])
        columns, values = state.columns[places], state.posterior.values[places]
        on_rows, on_base = (each[:, :, columns] @ values for each in (system.columns, system.base_columns[:count]))
        return self.own_frame.without(on_rows.ravel(), on_base.ravel())

    def columns_of(self, change: Change) -> np.ndarray:
        """Places of a change's columns in the system."""
        return self.system.atoms[change.key].columns


def weigh(before: Before, problem: Problem, known: Library, tell: Tell, beside: Weighed | None = None) -> Weighed:
    """Find the best explanation of a run by a solved model.

    Args:
        before: the solved model.
        problem: the run.
        known: effects by name.
        tell: told what is being done.
        beside: another explanation to compare with, whose noise and rows are kept; None finds them.

    Returns:
        What was found.
    """
    noise, freedom = starting_noise(problem)
    if beside is not None:
        noise = beside.noise
    changes = changes_of(before, problem.view.joints)
    moved, gross = np.zeros(before.width), np.zeros(problem.table.rows, dtype=bool)
    kept: tuple[str, ...] | None = None
    moments: tuple[Shape, ...] = ()
    memory = WHITE
    for turn in range(TURNS):
        tell(f"weigh {turn + 1}")
        at = stand_at(before, moved, problem.masked(gross), noise)
        candidates, untestable = present_candidates(at.fitted, problem, known)
        if turn == 0:
            gross = _sift(at, problem, candidates, noise) if beside is None else beside.gross
        rows = problem.used & ~gross & np.isfinite(at.fitted.residual).all(axis=1)
        shapes = {effect.key: shapes_of(effect, problem.view, moments) for effect in candidates}
        supposed = suppose(before, at, problem, changes, candidates, noise, freedom, rows, shapes)
        system = supposed.system
        system.atoms = _priced(system, before)
        scorer = Scorer(system, (), STEPS, {change.key for change in changes if change.effect.key in before.cured})
        if kept is None:
            state = search(scorer)
        else:
            state = improve(scorer, scorer.score([key for key in kept if key in system.atoms], memory))
        state = _fewest(scorer, _unfolded(scorer, _known_first(scorer, state), changes), changes)
        found = Weighed(
            before=before, at=at, supposed=supposed, scorer=scorer, state=state, changes=changes, noise=noise,
            gross=gross, untestable=untestable,
        )  # fmt: skip
        if turn == TURNS - 1:
            break
        if beside is None:
            gross = gross_beside(system, state, gross)
        there = moved_by(found)
        still = np.abs(there - at.moved).max(initial=0.0) < SETTLED and (gross == found.gross).all()
        if turn > 0 and still and _same_names(kept, state):
            break
        new = [key for key in state.keys if not key.startswith((PREFIX, THEN))]
        moments = best_moments(scorer, state, new, candidates)
        if beside is None:
            noise = noise_again(problem, system, state)
        moved, kept, memory = there, state.keys, state.memory
    return found


def moved_by(found: Weighed) -> np.ndarray:
    """How far the changes that are named move the values of the model, (w,) in usual sizes, from where they started."""
    moved = np.zeros(found.before.width)
    for room in found.then:
        moved -= room.absorbed @ found.state.posterior.values[found.state.of(room.key)]
    moved[found.before.gone] = 0.0
    for change in [change for change in found.changed if change.key in found.state.keys]:
        moved[change.places] += change.ways @ found.state.posterior.values[found.state.of(change.key)]
    return moved


def _known_first(scorer: Scorer, state: State) -> State:
    """The best set without anything new, unless the one with it is worth clearly more.

    What is known of the machine is itself only approximate: what the rest of it leaves must not be called new. A name
    that takes the place of changes is no rest of them: it only says more than they do.
    """
    atoms = scorer.system.atoms

    def known(key: str) -> bool:
        return key.startswith(PREFIX) or _of_set_up(atoms[key].effect)

    if all(known(key) for key in state.keys):
        return state
    start = scorer.score([key for key in state.keys if known(key)], state.memory)
    ends = [improve(scorer, one, lambda atom: known(atom.key)) for one in (start, scorer.score((), WHITE))]
    best = max(ends, key=lambda other: other.total)
    named = all(atoms[key].effect for key in state.keys)
    instead = named and sum(map(_is_change_key, state.keys)) < sum(map(_is_change_key, best.keys))
    return best if state.total < best.total + (PLAIN_NATS if instead else BESIDE_NATS) else state


def _fewest(scorer: Scorer, state: State, changes: Sequence[Change]) -> State:
    """The same with one value in the place of a whole effect that does no better: a tie goes to the fewer values."""
    for whole in [change for change in changes if change.whole and change.key in state.keys]:
        rest, own = without(state, whole.key), [c for c in changes if c.effect.key == whole.effect.key and not c.whole]
        singles = [scorer.score((*rest, one.key), state.memory) for one in own if one.key not in rest]
        best = max(singles, key=lambda other: other.total, default=state)
        state = best if best.total > state.total - PLAIN_NATS else state
    return state


def _unfolded(scorer: Scorer, state: State, changes: Sequence[Change]) -> State:
    """The same with the values of an effect that moves as a whole told one by one, where that does better.

    Where a fit could not part an effect from others, a cured one does not go back by what the fit says of it.
    """
    whole = {change.effect.key for change in changes if change.whole and change.key in state.keys}
    for key in sorted(whole):
        own = [change for change in changes if change.effect.key == key]
        singles = [change.key for change in own if not change.whole]
        # Changes of other effects may only have made up for what the whole did not explain.
        rest = [other for other in state.keys if not other.startswith(PREFIX)]
        alone = improve(scorer, scorer.score((*rest, *singles), state.memory), _is_change)
        mixed = any(name in state.keys for name in singles)  # one value would be told twice, each time in part
        state = alone if mixed else max(state, alone, key=lambda one: one.total)
    return state


def _is_change_key(key: str) -> bool:
    return key.startswith(PREFIX)


def _is_change(atom: Atom) -> bool:
    return _is_change_key(atom.key)


def _of_set_up(effect: Effect | None) -> bool:
    return effect is not None and effect.of_run


def _same_names(kept: Sequence[str] | None, state: State) -> bool:
    return kept is not None and set(kept) == set(state.keys)


def _priced(system: RowSystem, before: Before) -> dict[str, Atom]:
    """Unknown physics costs no more than the choice among its kinds where the model is known to leave some."""
    if before.last is None or before.left < KNOWN_REST * float(before.last.noise_um["total"]):
        return system.atoms
    kinds = sum(atom.effect is None for atom in system.atoms.values())
    odds = float(np.log(max(kinds, 1)))
    return {key: atom if atom.effect else replace(atom, odds=odds) for key, atom in system.atoms.items()}


def _sift(at: At, problem: Problem, candidates: Sequence[Effect], noise: Noise) -> np.ndarray:
    """Lone rows that neither the model with all its values free nor all effects together can explain, (n,) bool."""
    linear = linear_columns(at.fitted, problem, candidates, noise)
    saturated = few_shapes(linear.trials, linear.simple)
    return gross_errors(linear.columns, linear.residual, linear.rows, linear.simple, saturated, places_of(problem))
