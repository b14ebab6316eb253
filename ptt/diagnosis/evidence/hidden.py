"""Hidden: what an explanation says of blocks of travel that it was not shown."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.hidden_trial import HiddenTrial
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.memory import WHITE, Hidden
from ptt.fitting.posterior import Posterior


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
    memo, where = scorer.hidden_memo, (whole.keys, key)
    if where not in memo.trials:
        memo.trials[where] = _hold_back(scorer, whole, scorer.score(without(whole, key), WHITE))
    return memo.trials[where]


def _hold_back(scorer: Scorer, whole: State, fewer: State) -> HiddenTrial:
    """A set against the same less an atom."""
    place = {column: number for number, column in enumerate(whole.columns)}
    among = [place[column] for column in fewer.columns]
    plain = np.zeros(len(whole.columns))
    plain[among] = fewer.posterior.values
    four, plainly, shown, count = list[np.ndarray](), list[float](), list[float](), 0
    blocks = _predicted(scorer, whole)
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


def _predicted(scorer: Scorer, state: State) -> list[tuple[Hidden, Posterior]]:
    """Each block of travel, and what a set would be without it; those of the last set, which is asked for again."""
    memo = scorer.hidden_memo
    if state.keys not in memo.predicted:
        blocks = list(scorer.system.hidden(state.columns))
        memo.predicted = {state.keys: list(zip(blocks, scorer.without_rows(state, blocks), strict=True))}
    return memo.predicted[state.keys]


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
        bends to a dent that few rows saw would predict it where they are.
    """
    squares, rows = hidden_squares(scorer, keys)
    return float(np.sqrt(squares.sum() / max(rows.sum(), 1)))


def hidden_squares(scorer: Scorer, keys: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The same block by block: sums of squares, (k,) mm^2, and numbers of rows, (k,)."""
    state, memo = scorer.score(keys, WHITE), scorer.hidden_memo
    if state.keys not in memo.squares:
        blocks = _predicted(scorer, state)
        squares = np.array([hidden.square(told.values) for hidden, told in blocks])
        memo.squares[state.keys] = squares, np.array([hidden.rows for hidden, _ in blocks], dtype=int)
    return memo.squares[state.keys]


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
