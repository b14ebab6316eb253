"""How far the tool may be from where an explanation has it, though the readings would hardly change."""

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_metrology
from ptt.diagnosis.evidence.probability import near_sets
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.telling.absent import absent_effects
from ptt.fitting.factor import RANK_TOLERANCE


def tool_doubt(scorer: Scorer, state: State) -> float:
    """Root mean square by which the machine may move the tool otherwise than a set of atoms says, mm.

    Held-out rows only show what readings do. Whether the machine or the tracker is off they leave open where sets that
    do as well, or values of one set that fit as well, share it out otherwise; commands are right for one of them. They
    are of the machine as the run has left it: what slipped late, and few rows saw, is all along from then on. What a
    rigid motion takes does not count, and neither does what readings of the held-out rows would show. What the tracker
    may have done, though no reading asks for it, counts as far as the machine's values would make good for it.

    Args:
        scorer: that has scored the sets.
        state: the one that is told.
    """
    system = scorer.system
    sets = [(1.0, state), *near_sets(scorer, state)]
    columns = np.unique(np.concatenate([one.columns[_machine(scorer, one)] for _, one in sets])).astype(int)
    frame = system.frame
    gram = system.gram_after(np.concatenate([frame, columns]).astype(int))
    beside = gram[len(frame) :, : len(frame)]
    spread = np.linalg.pinv(gram[: len(frame), : len(frame)], rcond=RANK_TOLERANCE, hermitian=True)
    seen = gram[len(frame) :, len(frame) :] - beside @ spread @ beside.T  # of the tool, frames taken off
    told, squares = _values(state, _machine(scorer, state), columns), list[float]()
    for _, one in sets:
        own = _machine(scorer, one)
        place, apart = np.searchsorted(columns, one.columns[own]), _values(one, own, columns) - told
        loose = float((seen[np.ix_(place, place)] * one.covariance[np.ix_(own, own)]).sum())
        squares.append(float(apart @ seen @ apart) + max(loose - one.effective_parameters * one.posterior.phi, 0.0))
    odds, own = [odds for odds, _ in sets], _machine(scorer, state)
    place = np.searchsorted(columns, state.columns[own])
    for absent in absent_effects(scorer, state):
        if is_metrology(system.atoms[absent.key]):
            odds.append(absent.odds)
            squares.append(squares[0] + float((seen[np.ix_(place, place)] * absent.moved[np.ix_(own, own)]).sum()))
    square = float(np.average(squares, weights=odds))
    return float(np.sqrt(max(square, 0.0) / system.count * np.trace(system.noise.covariance)))


def _machine(scorer: Scorer, state: State) -> np.ndarray:
    """Places of a set's columns that move the tool: of effects but the metrology's, of unknowns of joints and rails."""
    places = [state.of(key) for key in state.keys if _moves_tool(scorer.system.atoms[key])]
    return np.concatenate([*places, np.zeros(0)]).astype(int)


def _moves_tool(atom: Atom) -> bool:
    if atom.block is not None:
        return atom.block.place.joint is not None
    return not is_metrology(atom)


def _values(state: State, own: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Values of some columns of a set among others."""
    values = np.zeros(len(columns))
    values[np.searchsorted(columns, state.columns[own])] = state.posterior.values[own]
    return values
