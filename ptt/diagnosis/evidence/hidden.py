"""Hidden: what an explanation says of blocks of travel that it was not shown."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.memory import WHITE, Hidden
from ptt.fitting.posterior import Posterior

FAITHFUL = 2.0  # times the variance that a set claims for hidden rows, within which it foretells them
HARDLY = 0.25  # of what all rows show of an atom: where other blocks tell less of it, each shows a part of its own
ELSEWHERE = 5.0  # nats below which readings along the travel ask for nothing, and beyond which base reflectors do


@dataclass(frozen=True)
class HiddenTrial:
    """How atoms do on hidden blocks of travel with one of them and without it.

    Each way that the readings may go is counted as far as the shown rows tell it.

    Attributes:
        with_it: sum of squares of each block, over the variance that the atoms claim, (k,).
        without: of the same, the atom gone.
        shown: what is left of all blocks without it less what is left with it, when nothing is hidden.
        elsewhere: the same of each reading of base reflectors, (b,); of all together where rows are summed up.
        count: coordinates of all blocks.
        plainly: what the atom takes off each block where every way counts alike, (k,).
        needed: whether the others alone would have values that physics does not let them have.
        told: by how much the values of all rows fit all blocks better than without it, each way counted as far as the
            other rows tell it.
        spread: what is left of `shown` without the block that shows most.
    """

    with_it: np.ndarray
    without: np.ndarray
    shown: float
    elsewhere: np.ndarray
    count: int
    plainly: np.ndarray
    needed: bool = False
    told: float = np.inf
    spread: float = np.inf

    @property
    def faithful(self) -> bool:
        """Whether the atoms foretell hidden rows about as well as they claim to."""
        return bool(self.with_it.sum() <= FAITHFUL * max(self.count, 1))

    def speaks(self, nats: float = 0.0, share: float = 0.0) -> bool:
        """Whether hidden rows speak for the atom, and go on to do so without the block that does most.

        What only one part of the run bears out may be that part's own. Of what base reflectors show, more than one of
        their readings, and no reading along the travel asks for, these have nothing to say; nor of what only keeps
        others from what cannot be.

        Args:
            nats: that they have to gain; plain squares may tell as well, where no share is asked for.
            share: of what they leave without it that has to go.
        """
        least = 2.0 * ELSEWHERE
        if self.needed or (self.shown < least and _at_base(self.elsewhere, least)):
            return True
        as_known = self.without - self.with_it
        if share:
            return _gains(as_known, max(2.0 * nats, share * float(self.without.sum())))
        return _gains(as_known, 2.0 * nats) or _gains(self.plainly, 2.0 * nats)

    @property
    def is_silent(self) -> bool:
        """Whether the others say little of what hidden rows show of the atom, so that these can hardly speak for it.

        What one block alone shows is that one's own.
        """
        return self.told < HARDLY * self.shown and self.spread > 2.0 * ELSEWHERE


def _at_base(gained: np.ndarray, least: float) -> bool:
    """Whether base reflectors ask for an atom, and not one of their readings alone."""
    return bool(gained.sum() > least) if len(gained) < 2 else _gains(gained, least)


def _gains(gained: np.ndarray, least: float) -> bool:
    others = gained.sum() - gained.max(initial=0.0)
    return bool(others > 0.0 and gained.sum() > least)


def hold_back(scorer: Scorer, keys: Sequence[str], key: str) -> HiddenTrial:
    """Hide each block of travel in turn from atoms with and without one of them.

    Args:
        scorer: of the system.
        keys: of the atoms.
        key: the one that is tried.

    Returns:
        The trial.
    """
    whole = scorer.score(keys, WHITE)
    where = whole.keys, key
    if where not in scorer.trials:
        scorer.trials[where] = _hold_back(scorer, whole, scorer.score(without(whole, key), WHITE))
    return scorer.trials[where]


def _hold_back(scorer: Scorer, whole: State, fewer: State) -> HiddenTrial:
    """A set against the same less an atom."""
    place = {column: number for number, column in enumerate(whole.columns)}
    among = [place[column] for column in fewer.columns]
    plain = np.zeros(len(whole.columns))
    plain[among] = fewer.posterior.values
    four, plainly, shown, count = list[np.ndarray](), list[float](), list[float](), 0
    blocks = _foretold(scorer, whole)
    lesser = scorer.without_rows(fewer, [hidden for hidden, _ in blocks], among)
    for (hidden, told), less in zip(blocks, lesser, strict=True):
        values = np.zeros(len(whole.columns))
        values[among] = less.values
        solutions = np.stack([told.values, values, whole.posterior.values, plain], axis=1)
        four.append(hidden.misfits(solutions, told.precision))
        plainly.append(hidden.left(values) - hidden.left(told.values))
        shown.append(hidden.left(plain) - hidden.left(whole.posterior.values))
        count += 3 * hidden.rows
    phi = whole.posterior.phi
    squares = np.array(four).reshape(-1, 4) / phi
    all_shown = sum(shown)
    elsewhere = _elsewhere(scorer, whole, fewer, all_shown)
    return HiddenTrial(
        squares[:, 0], squares[:, 1], all_shown / phi, elsewhere / phi, count, np.array(plainly) / phi,
        needed=bool(np.isfinite(whole.total) and not np.isfinite(fewer.total)),
        told=float((squares[:, 3] - squares[:, 2]).sum()),
        spread=(all_shown - max(shown, default=0.0)) / phi,
    )  # fmt: skip


def _elsewhere(scorer: Scorer, whole: State, fewer: State, shown: float) -> np.ndarray:
    """What a set takes off each reading of base reflectors beyond another, or off all together."""
    one, other = (scorer.system.base_squares(state.columns, state.posterior.values) for state in (fewer, whole))
    if one is None or other is None:
        return np.array([left_of(scorer, fewer) - left_of(scorer, whole) - shown])
    return one - other


def _foretold(scorer: Scorer, state: State) -> list[tuple[Hidden, Posterior]]:
    """Each block of travel, and what a set would be without it; those of the last set, which is asked for again."""
    if state.keys not in scorer.foretold:
        blocks = list(scorer.system.hidden(state.columns))
        scorer.foretold = {state.keys: list(zip(blocks, scorer.without_rows(state, blocks), strict=True))}
    return scorer.foretold[state.keys]


def left_of(scorer: Scorer, state: State) -> float:
    """Sum of squares that a state leaves, base reflectors included, in units of noise."""
    sums, values = scorer.system.sums_of(state.columns, WHITE), state.posterior.values
    return sums.square - float(values @ (2.0 * sums.side - sums.gram @ values))


def held_out(scorer: Scorer, keys: tuple[str, ...]) -> float:
    """Error on hidden blocks of travel when the given effects and some more are fitted to the others, mm in total.

    Args:
        scorer: of the system.
        keys: of atoms.

    Returns:
        Root mean square of the error's length. Hidden rows tell nothing, not even how large a curve may be: one that
        bends to a dent that few rows saw would foretell it where they are.
    """
    squares, rows = hidden_squares(scorer, keys)
    return float(np.sqrt(squares.sum() / max(rows.sum(), 1)))


def hidden_squares(scorer: Scorer, keys: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The same block by block: sums of squares, (k,) mm^2, and numbers of rows, (k,)."""
    state = scorer.score(keys, WHITE)
    if state.keys not in scorer.held_out:
        blocks = _foretold(scorer, state)
        squares = np.array([hidden.square(told.values) for hidden, told in blocks])
        scorer.held_out[state.keys] = squares, np.array([hidden.rows for hidden, _ in blocks], dtype=int)
    return scorer.held_out[state.keys]


def lowers(scorer: Scorer, keys: tuple[str, ...], doubt: float = 0.0) -> bool:
    """Whether effects lower the error of hidden blocks of travel, of all but one of them at the least.

    Of a block at an end of the travel the others may tell nothing; what a curve does there is no harm elsewhere.

    Args:
        scorer: of the system.
        keys: of the effects.
        doubt: how far the tool may be from where they have it while the readings stay, mm, which counts as error.
    """
    (before, rows), (after, _) = hidden_squares(scorer, ()), hidden_squares(scorer, keys)
    gained = before - after - rows * doubt**2
    return bool(gained.sum() - gained.min(initial=0.0) > 0.0)
