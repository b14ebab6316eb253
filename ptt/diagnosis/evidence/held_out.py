"""Leave-one-block-out cross-validation: what an explanation predicts of blocks of travel that it was not fitted to."""

from collections.abc import Sequence

import numpy as np

from ptt.diagnosis.evidence.held_out_trial import HeldOutTrial
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.memory import WHITE, HeldOutBlock
from ptt.fitting.posterior import Posterior

RAISED = 1.5  # ratio of held-out errors after a name and before it, above which it is no help to those before it


def cross_validate(scorer: Scorer, keys: Sequence[str], key: str) -> HeldOutTrial:
    """Hold out each block of travel in turn, and predict it by a set of atoms with and without one of them.

    Args:
        scorer: of the system.
        keys: of the set's atoms.
        key: of the atom that is tried.

    Returns:
        The trial, under white noise.
    """
    whole = scorer.score(keys, WHITE)
    memo, where = scorer.held_out_memo, (whole.keys, key)
    if where not in memo.trials:
        memo.trials[where] = _compare(scorer, whole, scorer.score(without(whole, key), WHITE))
    return memo.trials[where]


def _compare(scorer: Scorer, whole: State, fewer: State) -> HeldOutTrial:
    """A set against the same set less an atom."""
    place = {column: number for number, column in enumerate(whole.columns)}
    among = [place[column] for column in fewer.columns]
    fitted_without = np.zeros(len(whole.columns))
    fitted_without[among] = fewer.posterior.values
    distances, plain_gain, fitted_gain, count = list[np.ndarray](), list[float](), list[float](), 0
    blocks = _predicted(scorer, whole)
    lesser = scorer.without_rows(fewer, [block for block, _ in blocks], among)
    for (block, predicted), less in zip(blocks, lesser, strict=True):
        values = np.zeros(len(whole.columns))
        values[among] = less.values
        solutions = np.stack([predicted.values, values, whole.posterior.values, fitted_without], axis=1)
        distances.append(block.predictive_squares(solutions, predicted.precision))
        plain_gain.append(block.residual_square(values) - block.residual_square(predicted.values))
        fitted_gain.append(block.residual_square(fitted_without) - block.residual_square(whole.posterior.values))
        count += 3 * block.rows
    phi = whole.posterior.phi
    squares = np.array(distances).reshape(-1, 4) / phi
    all_fitted = sum(fitted_gain)
    base_gain = _base_gain(scorer, whole, fewer, all_fitted)
    return HeldOutTrial(
        squares[:, 0], squares[:, 1], all_fitted / phi, base_gain / phi, count, np.array(plain_gain) / phi,
        needed=bool(np.isfinite(whole.total) and not np.isfinite(fewer.total)),
        predicted_gain=float((squares[:, 3] - squares[:, 2]).sum()),
        spread_gain=(all_fitted - max(fitted_gain, default=0.0)) / phi,
    )  # fmt: skip


def _base_gain(scorer: Scorer, whole: State, fewer: State, fitted_gain: float) -> np.ndarray:
    """By how much less the whole set leaves of each reading of base reflectors, (b,), or of all of them, (1,)."""
    one, other = (scorer.system.base_squares(state.columns, state.posterior.values) for state in (fewer, whole))
    if one is None or other is None:
        return np.array([residual_square(scorer, fewer) - residual_square(scorer, whole) - fitted_gain])
    return one - other


def _predicted(scorer: Scorer, state: State) -> list[tuple[HeldOutBlock, Posterior]]:
    """Each held-out block, and the set's posterior from all other rows; kept for the last set, which is asked again."""
    memo = scorer.held_out_memo
    if state.keys not in memo.predicted:
        blocks = list(scorer.system.held_out_blocks(state.columns))
        memo.predicted = {state.keys: list(zip(blocks, scorer.without_rows(state, blocks), strict=True))}
    return memo.predicted[state.keys]


def residual_square(scorer: Scorer, state: State) -> float:
    """Sum of squares that a set leaves of all readings, base reflectors included, in units of noise."""
    sums, values = scorer.system.sums_of(state.columns, WHITE), state.posterior.values
    return sums.square - float(values @ (2.0 * sums.side - sums.gram @ values))


def held_out_rms(scorer: Scorer, keys: tuple[str, ...]) -> float:
    """Error on held-out blocks of travel when the given effects and some more are fitted to the other rows, mm.

    The prior variances are learned without the held-out rows too: a curve that bends to a dent would otherwise predict
    the dent exactly where only those rows saw it.

    Args:
        scorer: of the system.
        keys: of atoms.

    Returns:
        Root mean square of the error's length.
    """
    squares, rows = held_out_squares(scorer, keys)
    return float(np.sqrt(squares.sum() / max(rows.sum(), 1)))


def held_out_squares(scorer: Scorer, keys: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Sums of squares of the error on each held-out block, (k,) mm^2, and numbers of rows, (k,)."""
    state, memo = scorer.score(keys, WHITE), scorer.held_out_memo
    if state.keys not in memo.squares:
        blocks = _predicted(scorer, state)
        squares = np.array([block.square(predicted.values) for block, predicted in blocks])
        memo.squares[state.keys] = squares, np.array([block.rows for block, _ in blocks], dtype=int)
    return memo.squares[state.keys]


def lowers_held_out_error(scorer: Scorer, keys: tuple[str, ...], doubt: float = 0.0) -> bool:
    """Whether effects lower the error on held-out blocks, even without the block on which they raise it most.

    Of a block at an end of the travel the others may tell nothing; what a curve does there is no harm elsewhere.

    Args:
        scorer: of the system.
        keys: of the effects.
        doubt: how far the tool may be from where they have it while the readings stay, mm, which counts as error.
    """
    (before, rows), (after, _) = held_out_squares(scorer, ()), held_out_squares(scorer, keys)
    gained = before - after - rows * doubt**2
    return bool(gained.sum() - gained.min(initial=0.0) > 0.0)


def raises_held_out_error(scorer: Scorer, keys: tuple[str, ...]) -> bool:
    """Whether the last of some effects raises the error on held-out blocks by more than a factor of `RAISED`.

    The block on which it raises it most does not count, as in `lowers_held_out_error`.

    Args:
        scorer: of the system.
        keys: of the effects, at least one.
    """
    (before, _), (after, _) = held_out_squares(scorer, keys[:-1]), held_out_squares(scorer, keys)
    others = np.arange(len(before)) != np.argmax(after - before)
    return bool(after[others].sum() > RAISED**2 * before[others].sum())
