"""How far the tool may be from where an explanation puts it, though the readings would hardly change."""

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_metrology
from ptt.diagnosis.evidence.probability import near_sets
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.telling.absent import absent_effects
from ptt.fitting.factor import RANK_TOLERANCE


def tool_doubt(scorer: Scorer, state: State) -> float:
    """Root mean square doubt in the tool's position that held-out readings cannot show, mm.

    Sets that score nearly as well, and values of one set that fit as well, may share an error between machine and
    tracker differently; commands are right for only one of them. The doubt is for the machine as the run left it, with
    sudden effects acting. Rigid motions do not count, nor does the part of the posterior covariance that held-out
    readings would show. Effects of the tracker that are not named count as far as the machine's values would shift
    beside them.

    Args:
        scorer: that has scored the sets.
        state: the reported set.
    """
    system = scorer.system
    sets = [(1.0, state), *near_sets(scorer, state)]
    columns = np.unique(np.concatenate([one.columns[_machine(scorer, one)] for _, one in sets])).astype(int)
    frame = system.frame
    gram = system.gram_after(np.concatenate([frame, columns]).astype(int))
    beside = gram[len(frame) :, : len(frame)]
    inverse = np.linalg.pinv(gram[: len(frame), : len(frame)], rcond=RANK_TOLERANCE, hermitian=True)
    seen = (
        gram[len(frame) :, len(frame) :] - beside @ inverse @ beside.T
    )  # Gram matrix of tool motions beside the frame
    told, squares = _values(state, _machine(scorer, state), columns), list[float]()
    for _, one in sets:
        own = _machine(scorer, one)
        place, apart = np.searchsorted(columns, one.columns[own]), _values(one, own, columns) - told
        open_ = float((seen[np.ix_(place, place)] * one.covariance[np.ix_(own, own)]).sum())
        squares.append(float(apart @ seen @ apart) + max(open_ - one.effective_parameters * one.posterior.phi, 0.0))
    odds, own = [odds for odds, _ in sets], _machine(scorer, state)
    place = np.searchsorted(columns, state.columns[own])
    for absent in absent_effects(scorer, state):
        if is_metrology(system.atoms[absent.key]):
            odds.append(absent.odds)
            squares.append(squares[0] + float((seen[np.ix_(place, place)] * absent.moved[np.ix_(own, own)]).sum()))
    square = float(np.average(squares, weights=odds))
    return float(np.sqrt(max(square, 0.0) / system.count * np.trace(system.noise.covariance)))


def _machine(scorer: Scorer, state: State) -> np.ndarray:
    """Indices among a set's columns of those that move the tool: of machine effects, and of blocks at joints."""
    places = [state.of(key) for key in state.keys if _moves_tool(scorer.system.atoms[key])]
    return np.concatenate([*places, np.zeros(0)]).astype(int)


def _moves_tool(atom: Atom) -> bool:
    if atom.block is not None:
        return atom.block.place.joint is not None
    return not is_metrology(atom)


def _values(state: State, own: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Values of some columns of a set placed among more columns, zero for the others."""
    values = np.zeros(len(columns))
    values[np.searchsorted(columns, state.columns[own])] = state.posterior.values[own]
    return values
