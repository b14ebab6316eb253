"""Score of a set of atoms: log evidence at the learned variances, and log prior odds."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from itertools import combinations

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_any, is_field
from ptt.diagnosis.evidence.hidden_trial import HiddenMemo
from ptt.diagnosis.evidence.idle import idle_joints
from ptt.diagnosis.evidence.memories import best_memory, prior_of
from ptt.diagnosis.evidence.possible import is_impossible, nats_of_form
from ptt.diagnosis.evidence.screen import Basis, Begun, Gain, Screen
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.swap import replacements
from ptt.diagnosis.evidence.system import System
from ptt.diagnosis.noise.memory import Hidden, Memory, MemorySums
from ptt.effects.sudden import EDGE
from ptt.fitting.evidence import LOG_SIZE_STD, maximise
from ptt.fitting.posterior import Posterior
from ptt.model.model import rival

# Share of the squares of one event's shift that may remain where another event counts as taking it back
UNDONE_SHARE = 0.25
# Numbers of Cholesky factors that are kept, a third of a gigabyte: more than runs of a tripod need
MOST_FACTOR_NUMBERS = 40_000_000
LEARNING_TOLERANCE = 0.05  # nats at which learning of variances may end while sets are only compared


class Scorer:
    """Scores sets of atoms of one system and remembers them."""

    def __init__(
        self, system: System, given: Sequence[str] = (), steps: int = 12, barred: Set[str] = frozenset(), *,
        fields: bool = True,
    ) -> None:  # fmt: skip
        """Start with nothing scored.

        Args:
            system: the linearised problem.
            given: atoms of the model as given, which are part of every set and cost nothing.
            steps: how many effects may be added to them.
            barred: names of atoms that may not: an exact fit does without them, or sizes of the drawing say as much.
            fields: whether unknowns that vary with the place alone may, and errors that each pose has to itself.
        """
        self.system, self.given = system, tuple(key for key in given if key in system.atoms)
        self.steps, self.barred, self.fields = steps, barred, fields
        self.screened: dict[tuple[tuple[str, ...], Memory], Screen] = {}
        self.scored: dict[tuple[tuple[str, ...], Memory], State] = {}
        self.whole: deque[State] = deque()
        self.begun: Begun = {}
        self.known: dict[tuple[tuple[str, ...], Memory], dict[str, Gain]] = {}
        self.suiting: dict[tuple[tuple[str, ...], Memory], tuple[Memory, float]] = {}
        self.hidden_memo = HiddenMemo()

    def widened(self, system: System) -> "Scorer":
        """The same for a system with atoms beside those that it has: what was scored and screened stays known to both.

        What the wider one learns it keeps to itself, for this one would not know the atoms of its sets.
        """
        wider = Scorer(system, self.given, self.steps, self.barred, fields=self.fields)
        wider.scored, wider.whole = dict(self.scored), deque(self.whole)
        wider.begun, wider.suiting = dict(self.begun), dict(self.suiting)
        wider.known = self.known | {where: screen.gains for where, screen in self.screened.items()}
        return wider

    @property
    def looked_at(self) -> int:
        """Number of sets that were screened."""
        return len(self.known.keys() | self.screened.keys())

    def score(
        self, keys: Sequence[str], memory: Memory, start: Mapping[str, np.ndarray] | None = None, least: float = -np.inf
    ) -> State:
        """The joint maximum over all variances of a set of atoms.

        Args:
            keys: of the atoms.
            memory: of the noise.
            start: variances to start from, by key.
            least: total below which nobody wants to know it: it may then be somewhere short of the maximum.

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

    def _keep(self, state: State) -> None:
        """Keep a set, and of those of long ago only what they said, where their factors would fill gigabytes."""
        self.scored[state.keys, state.memory] = state
        self.whole.append(state)
        while len(self.whole) > max(MOST_FACTOR_NUMBERS // max(state.posterior.cholesky.size, 1), 1):
            where = self.whole[0].keys, self.whole[0].memory
            first = self.whole.popleft()
            if self.scored[where] is first:
                self.scored[where] = first.without_factor()
            if where in self.screened:
                self.known[where] = self.screened.pop(where).gains

    def _score(self, keys: tuple[str, ...], memory: Memory, start: Mapping[str, np.ndarray], least: float) -> State:
        system, atoms = self.system, [self.system.atoms[key] for key in keys]
        columns = np.concatenate([system.frame, *(atom.columns for atom in atoms)]).astype(int)
        frame = np.full(len(system.frame), -1)
        owner = np.concatenate([frame, *(np.full(len(a.columns), i) for i, a in enumerate(atoms))])
        begin = np.concatenate([np.zeros(0), *(start.get(a.key, np.ones(a.groups)) for a in atoms)])
        first = np.cumsum([0, *(atom.groups for atom in atoms)])
        sums = system.sums_of(columns, memory)
        odds = sum(atom.odds for atom in atoms if atom.key not in self.given)
        beside = prior_of(memory, system) - odds - sums.log_noise
        posterior = self._learned(atoms, sums, system.spare, begin, least - beside)
        gained = self._at_few_joints(atoms, posterior, owner, first)
        if posterior.stopped_early and posterior.total + gained > least - beside:
            posterior = self._learned(atoms, sums, system.spare, posterior.group_variances)
            gained = self._at_few_joints(atoms, posterior, owner, first)
        total = posterior.total + gained + beside
        variances = {atom.key: posterior.group_variances[first[i] : first[i + 1]] for i, atom in enumerate(atoms)}
        state = State(keys, memory, total, posterior, columns, owner.astype(int), variances)
        new = [atom for atom in atoms if atom.key not in self.given]
        if is_impossible(state, atoms, new) or self._is_at_an_end(new) or self._undoes(state):
            return replace(state, total=-np.inf)
        forms = {atom.key: nats_of_form(state, atom, system.scale, new=atom.key not in self.given) for atom in atoms}
        return replace(state, total=total + sum(forms.values()), forms=forms)

    def _at_few_joints(
        self, atoms: Sequence[Atom], posterior: Posterior, owner: np.ndarray, first: np.ndarray
    ) -> float:
        """Nats that a set gains with each effect at no more joints than show it, less the odds of just these.

        One width for all joints makes a fault of one joint alone pay for every sound one, while an unknown is of one
        joint from the start. So does a curve of one joint, by the prior of the widths of all others, which is given
        back: at the most, for where they are learned to be is no longer asked. Values and errors stay those of all
        joints: that the others are sound is no reading.

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
        """Variances and values of the frame and some atoms, from sums of their columns."""
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
        self, state: State, hidden: Iterable[Hidden], among: Sequence[int] | None = None
    ) -> Iterator[Posterior]:
        """What a state would be had some rows never been read: how wide its columns are is learned anew as well.

        Args:
            state: of white noise.
            hidden: some rows, and some others.
            among: places of its columns among those of the hidden sums; None where these are of the same.

        Yields:
            The posterior of its columns without each of them.
        """
        sums, atoms = self.system.sums_of(state.columns, state.memory), [self.system.atoms[key] for key in state.keys]
        place = np.arange(len(state.columns)) if among is None else np.asarray(among, dtype=int)
        for part in hidden:
            gram, side = sums.gram - part.gram[np.ix_(place, place)], sums.side - part.side[place]
            less, count = MemorySums(gram, side, sums.square - part.energy, 0.0), self.system.spare - 3.0 * part.rows
            yield self._learned(atoms, less, max(count, 1.0), state.posterior.group_variances)

    def screen(self, state: State, allowed: Callable[[Atom], bool] = lambda atom: True) -> list[Gain]:
        """What every atom would add to a state, the best shape of each name; best first."""
        apart = self._is_apart(state)
        return self._screen(state).best(lambda atom: allowed(atom) and apart(atom))

    def all_gains(self, state: State, allowed: Callable[[Atom], bool]) -> list[Gain]:
        """The same of every shape, in no order."""
        apart = self._is_apart(state)
        return [gain for _, gain in self._screen(state).each(lambda atom: allowed(atom) and apart(atom))]

    def replacements(
        self, state: State, keys: Sequence[str], allowed: Callable[[Atom], bool], near: float
    ) -> dict[str, set[str]]:
        """As `ptt.diagnosis.evidence.swap.replacements`."""
        return replacements(self, state, keys, allowed, near)

    def _screen(self, state: State) -> Screen:
        where = state.keys, state.memory
        if where not in self.screened:
            basis = Basis(state.columns, state.posterior, state.memory)
            self.screened[where] = Screen(self.system, basis, self.opens(state.keys), self.begun)
            self.screened[where].gains |= self.known.get(where, {})
        return self.screened[where]

    def opens(self, keys: Sequence[str]) -> Callable[[Atom], bool]:
        """Whether an atom may be added to a set."""
        atoms = [self.system.atoms[key] for key in keys]
        names, effects = {atom.name for atom in atoms} | self.barred, [atom.name for atom in atoms if atom.effect]
        full = len(effects) - len(self.given) >= self.steps

        def opens(atom: Atom) -> bool:
            shut = atom.name in names or (atom.effect and full) or (is_field(atom) and not self.fields)
            return not shut and not _excluded(atom, effects)

        return opens

    def _is_at_an_end(self, new: Sequence[Atom]) -> bool:
        """Whether too few readings tell what was before or after a moment, once those that are gross are left out."""
        time = self.system.clock.time
        before = [int((time <= atom.moment).sum()) for atom in new if atom.moment is not None]
        return any(min(count, len(time) - count) < EDGE for count in before)

    def _undoes(self, state: State) -> bool:
        """Whether something takes back, within a few readings, what something of another kind did: they are gross."""
        atoms, time = [self.system.atoms[key] for key in state.keys], self.system.clock.in_order
        dated = [(float(atom.moment), atom) for atom in atoms if atom.moment is not None]
        for (moment, one), (other, two) in combinations(dated, 2):
            if one.shape is two.shape is None:  # what the model has it may keep
                continue
            if 0 < abs(int(np.searchsorted(time, moment, "right") - np.searchsorted(time, other, "right"))) < EDGE:
                after, both = self.system.clock.time > max(moment, other), (*state.of(one.key), *state.of(two.key))
                first = state.of(one.key if moment < other else two.key)
                left, lost = (self._told(state, np.array(own))[after] for own in (both, first))
                if np.square(left).sum() < UNDONE_SHARE * np.square(lost).sum():
                    return True
        return False

    def _told(self, state: State, own: np.ndarray) -> np.ndarray:
        """What some of a state's values put into the readings, (m, 3) whitened."""
        nothing = self.system.left(state.columns[:0], state.posterior.values[:0])
        return nothing - self.system.left(state.columns[own], state.posterior.values[own])

    def _is_apart(self, state: State) -> Callable[[Atom], bool]:
        """Whether an atom happens as far from what happened alike in a set as from the ends of a run, or just then.

        What came and went within a few readings is a gross error of theirs. What the model has may come back to it.
        """
        time, atoms = self.system.clock.in_order, [self.system.atoms[key] for key in state.keys]
        happened = [(type(atom.effect), atom.moment) for atom in atoms if atom.moment is not None]

        def is_apart(atom: Atom) -> bool:
            if atom.moment is None or atom.shape is None:
                return True
            alike = [moment for kind, moment in happened if kind is type(atom.effect)]
            between = np.searchsorted(time, alike, side="right") - np.searchsorted(time, atom.moment, side="right")
            return not ((between != 0) & (np.abs(between) < EDGE)).any()

        return is_apart if happened else is_any

    def best_memory(self, state: State) -> tuple[Memory, float]:
        """The memory of the noise that suits a state's atoms at their variances, and what it adds to the total."""
        where = state.keys, state.memory
        if where not in self.suiting:
            self.suiting[where] = best_memory(self.system, state, poses=self.fields)
        return self.suiting[where]


def _excluded(atom: Atom, effects: Sequence[str]) -> bool:
    """Whether an effect is in part the same thing as one that is there."""
    return atom.effect is not None and rival(atom.effect, effects) is not None
