"""Events of an explanation: moments too near an end of the readings, or that take back what another did."""

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_any
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.effects.sudden import EDGE

# Share of the squares of one event's shift that may remain where another event counts as taking it back
UNDONE_SHARE = 0.25


def is_at_an_end(system: System, atoms: Sequence[Atom]) -> bool:
    """Whether an event has too few readings before or after its moment, gross errors left out."""
    time = system.clock.time
    before = [int((time <= atom.moment).sum()) for atom in atoms if atom.moment is not None]
    return any(min(count, len(time) - count) < EDGE for count in before)


def undoes(system: System, state: State) -> bool:
    """Whether one event takes back, within a few readings, what another did: those readings are gross errors."""
    atoms, time = [system.atoms[key] for key in state.keys], system.clock.time
    dated = [(float(atom.moment), atom) for atom in atoms if atom.moment is not None]
    for (moment, one), (other, two) in combinations(dated, 2):
        if one.shape is two.shape is None:  # both are in the model already
            continue
        if 0 < abs(int(np.searchsorted(time, moment, "right") - np.searchsorted(time, other, "right"))) < EDGE:
            after, both = time > max(moment, other), (*state.of(one.key), *state.of(two.key))
            first = state.of(one.key if moment < other else two.key)
            remains, done = (_contribution(system, state, np.array(own))[after] for own in (both, first))
            if np.square(remains).sum() < UNDONE_SHARE * np.square(done).sum():
                return True
    return False


def _contribution(system: System, state: State, own: np.ndarray) -> np.ndarray:
    """What some of a set's values contribute to the readings, (m, 3) whitened."""
    nothing = system.residual(state.columns[:0], state.posterior.values[:0])
    return nothing - system.residual(state.columns[own], state.posterior.values[own])


def apart_from(system: System, state: State) -> Callable[[Atom], bool]:
    """A predicate: whether an event is at the same moment as those of its kind in a set, or `EDGE` readings apart.

    What came and went within a few readings is a gross error of those. Events of the model may be added again.
    """
    time, atoms = system.clock.time, [system.atoms[key] for key in state.keys]
    happened = [(type(atom.effect), atom.moment) for atom in atoms if atom.moment is not None]

    def is_apart(atom: Atom) -> bool:
        if atom.moment is None or atom.shape is None:
            return True
        alike = [moment for kind, moment in happened if kind is type(atom.effect)]
        between = np.searchsorted(time, alike, side="right") - np.searchsorted(time, atom.moment, side="right")
        return not ((between != 0) & (np.abs(between) < EDGE)).any()

    return is_apart if happened else is_any
