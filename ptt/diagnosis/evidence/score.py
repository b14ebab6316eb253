"""Score of a set of atoms: log evidence at the learned prior variances, plus log prior odds."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_any, is_drawn, is_effect, is_field
from ptt.diagnosis.evidence.cancelled import nats_of_cancelling
from ptt.diagnosis.evidence.events import apart_from, is_at_an_end, undoes
from ptt.diagnosis.evidence.held_out_trial import HeldOutMemo
from ptt.diagnosis.evidence.idle import idle_joints
from ptt.diagnosis.evidence.memories import best_memory, prior_of
from ptt.diagnosis.evidence.possible import is_impossible, nats_of_form
from ptt.diagnosis.evidence.screen import Basis, Gain, LastVariances, Screen
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.memory import HeldOutBlock, Memory, MemorySums
from ptt.fitting.evidence import LOG_SIZE_STD, maximise
from ptt.fitting.posterior import Posterior
from ptt.model.model import rival

# Numbers of Cholesky factors that are kept, a third of a gigabyte: more than runs of a tripod need
MOST_FACTOR_NUMBERS = 40_000_000
LEARNING_TOLERANCE = 0.05  # nats at which learning of variances may end while sets are only compared


class Scorer:
    """Scores sets of atoms of one system and remembers them.

    Attributes:
        system: the linearised problem.
        given: keys of the model's own effects, which are part of every set.
        steps: how many effects may be added to them.
        barred: names of atoms that may not be added.
        fields: whether unknowns of position alone, and errors of each pose, may be.
        screened: (keys, memory) of a set -> its screen.
        scored: (keys, memory) of a set -> the set.
        with_factor: the scored sets whose Cholesky factors are kept, the oldest first.
        last_variances: where screens start to learn the variances of atoms with several.
        known_gains: (keys, memory) of sets whose screen was let go -> its gains.
        best_memories: (keys, memory) of a set -> the memory of the noise that suits it, and the nats that it gains.
        held_out_memo: results on held-out blocks.
    """

    def __init__(
        self, system: System, given: Sequence[str] = (), steps: int = 12, barred: Set[str] = frozenset(), *,
        fields: bool = True,
    ) -> None:  # fmt: skip
        """Start with nothing scored.

        Args:
            system: the linearised problem.
            given: atoms of the model as given, which are part of every set and cost nothing.
            steps: how many effects may be added to them.
            barred: names of atoms that may not be added: an exact fit does without them, sizes of the drawing explain
                as much, or no machine has their values.
            fields: whether unknowns of position alone may be added, and errors that each pose has to itself.
        """
        self.system, self.given = system, tuple(key for key in given if key in system.atoms)
        self.steps, self.barred, self.fields = steps, barred, fields
        self.screened: dict[tuple[tuple[str, ...], Memory], Screen] = {}
        self.scored: dict[tuple[tuple[str, ...], Memory], State] = {}
        self.with_factor: deque[State] = deque()
        self.last_variances: LastVariances = {}
        self.known_gains: dict[tuple[tuple[str, ...], Memory], dict[str, Gain]] = {}
        self.best_memories: dict[tuple[tuple[str, ...], Memory], tuple[Memory, float]] = {}
        self.held_out_memo = HeldOutMemo()

    def widened(self, system: System) -> "Scorer":
        """A scorer for a system with further atoms, which knows all that was scored and screened so far.

        What it learns stays its own, since this one does not have the new atoms.
        """
        wider = Scorer(system, self.given, self.steps, self.barred, fields=self.fields)
        wider.scored, wider.with_factor = dict(self.scored), deque(self.with_factor)
        wider.last_variances, wider.best_memories = dict(self.last_variances), dict(self.best_memories)
        wider.known_gains = self.known_gains | {where: screen.gains for where, screen in self.screened.items()}
        return wider

    @property
    def screened_count(self) -> int:
        """Number of sets that were screened so far."""
        return len(self.known_gains.keys() | self.screened.keys())

    def score(
        self, keys: Sequence[str], memory: Memory, start: Mapping[str, np.ndarray] | None = None, least: float = -np.inf
    ) -> State:
        """The joint maximum over all variances of a set of atoms.

        Args:
            keys: of the atoms.
            memory: of the noise.
            start: variances to start from, by key.
            least: total below which the set is of no interest: its score may then be short of the maximum.

        Returns:
            The set.
        """
        order = tuple(sorted({*keys, *self.given}))
        seen = self.scored.get((order, memory))
        if (
            seen is None
            or not (seen.is_whole or seen.total < least)
            or (seen.posterior.stopped_early and seen.total >= least)
        ):
            seen = self._score(order, memory, (start or {}) if seen is None else seen.variances, least)
            self._keep(seen)
        return seen

    def less(self, state: State, *keys: str, least: float = -np.inf) -> State:
        """The set less some of its atoms, scored from its variances; `least` as in `score`."""
        return self.score(without(state, *keys), state.memory, state.variances, least)

    def _keep(self, state: State) -> None:
        """Keep a set; of the oldest ones drop the factors, which would fill gigabytes, but no scores and gains."""
        self.scored[state.keys, state.memory] = state
        self.with_factor.append(state)
        while len(self.with_factor) > max(MOST_FACTOR_NUMBERS // max(state.posterior.cholesky.size, 1), 1):
            where = self.with_factor[0].keys, self.with_factor[0].memory
            first = self.with_factor.popleft()
            if self.scored[where] is first:
                self.scored[where] = first.without_factor()
            if where in self.screened:
                self.known_gains[where] = self.screened.pop(where).gains

    def _score(self, keys: tuple[str, ...], memory: Memory, start: Mapping[str, np.ndarray], least: float) -> State:
        system, atoms = self.system, [self.system.atoms[key] for key in keys]
        columns = np.concatenate([system.frame, *(atom.columns for atom in atoms)]).astype(int)
        frame = np.full(len(system.frame), -1)
        owner = np.concatenate([frame, *(np.full(len(a.columns), i) for i, a in enumerate(atoms))])
        begin = np.concatenate([np.zeros(0), *(start.get(a.key, a.first_variances) for a in atoms)])
        first = np.cumsum([0, *(atom.groups for atom in atoms)])
        sums = system.sums_of(columns, memory)
        odds = sum(atom.odds for atom in atoms if atom.key not in self.given)
        beside = prior_of(memory, system) - odds - sums.log_noise
        posterior = self._learned(atoms, sums, system.restricted_count, begin, least - beside)
        gained = self._at_few_joints(atoms, posterior, owner, first)
        if posterior.stopped_early and posterior.total + gained > least - beside:
            posterior = self._learned(atoms, sums, system.restricted_count, posterior.group_variances)
            gained = self._at_few_joints(atoms, posterior, owner, first)
        total = posterior.total + gained + beside
        variances = {atom.key: posterior.group_variances[first[i] : first[i + 1]] for i, atom in enumerate(atoms)}
        state = State(keys, memory, total, posterior, columns, owner.astype(int), variances)
        new = [atom for atom in atoms if atom.key not in self.given]
        if is_impossible(state, atoms, new) or is_at_an_end(system, new) or undoes(system, state):
            return replace(state, total=-np.inf)
        forms = {atom.key: nats_of_form(state, atom, system.scale, new=atom.key not in self.given) for atom in atoms}
        effects = [atom for atom in atoms if is_effect(atom)]
        known = [atom for atom in effects if atom.key in self.given or is_drawn(atom)]
        causes = [atom for atom in effects if not (atom.key in self.given or is_drawn(atom))]
        total -= nats_of_cancelling(state, sums, known, causes)
        return replace(state, total=total + sum(forms.values()), forms=forms)

    def _at_few_joints(
        self, atoms: Sequence[Atom], posterior: Posterior, owner: np.ndarray, first: np.ndarray
    ) -> float:
        """Nats that a set gains by restricting each effect to the joints that show it, less the odds of that choice.

        With one prior variance for all joints, a fault of one joint pays for every sound one, while an unknown block is
        of one joint from the start. Where each joint has a variance of its own (curves), the log-normal prior of those
        of sound joints costs as well; it is given back in full, though their variances are not learned anew. Values
        and standard errors stay those with all joints, for no reading says that the others are sound.

        Source: Dickey, The weighted likelihood ratio, Annals of Mathematical Statistics 42 (1971), at held widths.
        """
        off, odds, most = list[int](), 0.0, 0.0
        for index, atom in enumerate(atoms):
            joint = atom.joint if atom.leg is None else atom.leg[atom.group]
            if joint is None or atom.key in self.given:
                continue
            own, back = np.flatnonzero(owner == index), None
            if atom.leg is not None:
                widths = posterior.group_variances[first[index] : first[index + 1]]
                back = (np.square(0.5 * np.log(widths) / LOG_SIZE_STD) / 2.0 / np.bincount(atom.group))[atom.group]
            inverse, prior = posterior.inverse_of(own), posterior.prior_variance[own]
            idle = idle_joints(joint, posterior.values[own], inverse, prior, posterior.phi, back)
            if idle is not None:
                most, odds = max(most, idle.nats), odds + idle.odds
                off += own[idle.columns].tolist()
        return max(posterior.savage_dickey(np.array(off)) - odds, most) if off else 0.0

    def _learned(
        self, atoms: Sequence[Atom], sums: MemorySums, count: float, begin: np.ndarray, least: float = -np.inf
    ) -> Posterior:
        """Posterior of the frame and some atoms, their prior variances learned, from normal sums of their columns."""
        first = np.cumsum([0, *(atom.groups for atom in atoms)])
        frame = np.full(len(self.system.frame), -1)
        group = np.concatenate([frame, *(a.group + first[i] for i, a in enumerate(atoms))])
        log_std = [np.full(atom.groups, LOG_SIZE_STD if atom.effect else np.inf) for atom in atoms]
        ceiling = np.concatenate([np.zeros(0), *(a.most for a in atoms)])
        return maximise(
            sums.gram, sums.side, sums.square, count, group.astype(int),
            freedom=self.system.freedom, start=begin, log_size_std=np.concatenate([np.zeros(0), *log_std]),
            ceiling=ceiling, tolerance=LEARNING_TOLERANCE, least_total=least, least_phi=self.system.least_phi,
        )  # fmt: skip

    def without_rows(
        self, state: State, held_out: Iterable[HeldOutBlock], among: Sequence[int] | None = None
    ) -> Iterator[Posterior]:
        """Posteriors of a set without some rows, the prior variances learned without them too.

        Args:
            state: a set under white noise.
            held_out: the rows to leave out, block by block.
            among: places of the set's columns among those of the blocks; None where these are the same.

        Yields:
            The posterior without each block.
        """
        sums, atoms = self.system.sums_of(state.columns, state.memory), [self.system.atoms[key] for key in state.keys]
        place = np.arange(len(state.columns)) if among is None else np.asarray(among, dtype=int)
        for block in held_out:
            gram, side = sums.gram - block.gram[np.ix_(place, place)], sums.side - block.side[place]
            less = MemorySums(gram, side, sums.square - block.energy, 0.0)
            count = self.system.restricted_count - 3.0 * block.rows
            yield self._learned(atoms, less, max(count, 1.0), state.posterior.group_variances)

    def screen(self, state: State, allowed: Callable[[Atom], bool] = is_any) -> list[Gain]:
        """What every allowed atom would add to a set, only the best shape of each name; best first."""
        apart = apart_from(self.system, state)
        return self._screen(state).best(lambda atom: allowed(atom) and apart(atom))

    def all_gains(self, state: State, allowed: Callable[[Atom], bool]) -> list[Gain]:
        """What every allowed atom would add to a set, in every shape and in no order."""
        apart = apart_from(self.system, state)
        return [gain for _, gain in self._screen(state).each(lambda atom: allowed(atom) and apart(atom))]

    def _screen(self, state: State) -> Screen:
        where = state.keys, state.memory
        if where not in self.screened:
            basis = Basis(state.columns, state.posterior, state.memory)
            self.screened[where] = Screen(self.system, basis, self.opens(state.keys), self.last_variances)
            self.screened[where].gains |= self.known_gains.get(where, {})
        return self.screened[where]

    def opens(self, keys: Sequence[str]) -> Callable[[Atom], bool]:
        """A predicate: whether an atom may be added to the set of these keys."""
        atoms = [self.system.atoms[key] for key in keys]
        names, effects = {atom.name for atom in atoms} | self.barred, [atom.name for atom in atoms if atom.effect]
        full = len(effects) - len(self.given) >= self.steps

        def opens(atom: Atom) -> bool:
            shut = atom.name in names or (atom.effect and full) or (is_field(atom) and not self.fields)
            return not shut and not _excluded(atom, effects)

        return opens

    def best_memory(self, state: State) -> tuple[Memory, float]:
        """The best memory of the noise for a set, its variances held, and the nats that it adds to the total."""
        where = state.keys, state.memory
        if where not in self.best_memories:
            self.best_memories[where] = best_memory(self.system, state, poses=self.fields)
        return self.best_memories[where]


def _excluded(atom: Atom, effects: Sequence[str]) -> bool:
    """Whether an effect is in part the same thing as one of the named effects."""
    return atom.effect is not None and rival(atom.effect, effects) is not None
