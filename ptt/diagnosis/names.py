"""Names alone: what effects explain without any unknown, the model moved to them until they stay."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.asked import Asked, open_turn
from ptt.diagnosis.atoms import is_effect
from ptt.diagnosis.candidates import present_candidates
from ptt.diagnosis.first import dated, sift, sift_again
from ptt.diagnosis.found import Found, fit_less, moved
from ptt.diagnosis.harmonics import with_harmonics
from ptt.diagnosis.memory import WHITE
from ptt.diagnosis.opening import without_opening
from ptt.diagnosis.row_system import RowSystem
from ptt.diagnosis.score import Scorer
from ptt.diagnosis.screen import Allowed
from ptt.diagnosis.search import climb, is_plain
from ptt.diagnosis.state import State
from ptt.diagnosis.turn import Turn, moments_of, unlike
from ptt.fitting.linear import linear_columns

ROUNDS = 3  # of linearising with names alone: what these do not say, turns beside unknowns may


def names_alone(asked: Asked, first: Turn) -> tuple[Turn, Turn]:
    """Move the model to what names explain without any unknown, as far as they stay.

    Where the drawing is far off, unknowns take at its tangent what names do once the model has come nearer, and stay.
    Here names come nearer first; what unknowns then add is theirs.

    Args:
        asked: what is to be explained.
        first: the first turn.

    Returns:
        The first turn less rows that are gross errors, for a search from nothing; and the one that asks for unknowns
        beside names.
    """
    turn = first
    problem = without_opening(asked.problem, turn.opening)
    kept: tuple[str, ...] = ()
    for number in range(ROUNDS):
        fitted = fit_less(turn.model, problem, turn.carried, turn.gross, turn.noise)
        candidates, untestable = present_candidates(fitted, problem, asked.known, turn.seen)
        linear = None
        if number == 0:
            linear = linear_columns(fitted, problem, candidates, turn.noise)
            turn = replace(turn, gross=sift(linear, problem))
        scorer = open_turn(asked, turn, problem, fitted, candidates, turn.gross, linear, unknown=False)
        if number == 0:
            lone = sift_again(scorer, candidates, turn.gross)
            if not np.array_equal(lone, turn.gross):
                turn = replace(turn, gross=lone)
                scorer = open_turn(asked, turn, problem, fitted, candidates, lone, linear, unknown=False)
        start = scorer.score([key for key in kept if key in scorer.system.atoms], WHITE)
        scorer, plain, waves = with_harmonics(scorer, climb(scorer, start, is_plain), problem, turn.seen)
        turn = replace(turn, seen=(*turn.seen, *waves))
        # Curves wait until the model stands at what plain ones say: of few rows they bend to whatever waves there are,
        # and beside a slip and a knock that stand in each other's place to what that leaves.
        allowed, starts = (
            (is_plain, [plain]) if number == 0 and plain.keys != start.keys else (is_effect, [plain, start])
        )
        state = _best(scorer, starts, allowed)
        scorer, _, lasting = dated(scorer, state, candidates)
        if lasting is not None:
            state = _best(scorer, [scorer.score(keys, WHITE) for keys in (lasting, state.keys)], allowed)
        assert isinstance(scorer.system, RowSystem)
        found = Found(
            fitted, scorer.system, scorer, state, turn.noise, turn.carried, turn.gross, untestable, turn.periods,
            asked.span, opening=turn.opening, seen=turn.seen,
        )  # fmt: skip
        current = moved(found, asked.model, problem)
        moments = unlike([*turn.moments, *moments_of(current)])
        stays = set(current.keys) == set(kept) and allowed is is_effect
        turn = replace(turn, model=current, kept=current.keys, memory=state.memory, moments=moments)
        if stays:
            break
        kept = current.keys
    return replace(first, gross=turn.gross), turn


def _best(scorer: Scorer, starts: Sequence[State], allowed: Allowed) -> State:
    """The best set that adding and dropping lead to."""
    return max((climb(scorer, start, allowed) for start in starts), key=lambda end: end.total)
