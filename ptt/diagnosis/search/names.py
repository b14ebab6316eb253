"""Named effects alone: what they explain without any unknown, the model moved to them until they stay the same."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ptt.diagnosis.evidence.atoms import is_effect, is_plain
from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import Allowed
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.asked import Asked, open_turn
from ptt.diagnosis.search.first import dated, sift, sift_again
from ptt.diagnosis.search.fits import fit_less
from ptt.diagnosis.search.found import Found, moved
from ptt.diagnosis.search.harmonics import with_harmonics
from ptt.diagnosis.search.improve import climb
from ptt.diagnosis.search.lost import lost_by_one
from ptt.diagnosis.search.turn import Turn, hidden_moments, moments_of, unlike
from ptt.effects import Effect
from ptt.fitting.linear import linear_columns
from ptt.fitting.opening import untold_rows, without_opening
from ptt.fitting.result import FitResult
from ptt.fitting.solve import with_rounds_beside
from ptt.run.problem import Problem

NAME_ROUNDS = 3  # rounds of linearising with named effects alone; what these leave, turns beside unknowns may explain


@dataclass(frozen=True)
class _Round:
    """A turn linearised with all effects and no blocks, nothing scored yet."""

    turn: Turn
    fitted: FitResult
    candidates: list[Effect]
    untestable: dict[str, str]
    scorer: Scorer


def names_alone(asked: Asked, first: Turn) -> tuple[Turn, Turn]:
    """Move the model to what named effects explain without any unknown.

    Where the drawing is far off, the linearisation there is wrong, and unknowns would take the difference and stay. So
    effects move the model first; what unknowns then add is their own.

    Args:
        asked: what is to be explained.
        first: the first turn.

    Returns:
        The first turn without gross errors, for a search from nothing; and the turn at the named effects, at which
        unknowns are to be tried.
    """
    turn = replace(first, kept=())
    for number in range(NAME_ROUNDS):
        problem = with_rounds_beside(turn.model, without_opening(asked.problem, turn.opening))
        opened = _opened(asked, turn, problem, sifted=number == 0)
        found, curves = _named(opened, problem, plain_first=number == 0)
        current, moments = moved(found, asked.model, problem), opened.turn.moments
        if set(current.keys) != set(turn.kept or ()):
            current = lost_by_one(current, asked.model, found, problem)
        moments += hidden_moments(found.scorer, found.state, opened.candidates)
        stays = curves and set(current.keys) == set(turn.kept or ())
        turn = replace(
            opened.turn, model=current, kept=current.keys, memory=found.state.memory, seen=found.seen,
            moments=unlike([*moments, *moments_of(current)]),
            opening=turn.opening | untold_rows(current.terms, problem, turn.noise),
        )  # fmt: skip
        if stays:
            break
    return replace(first, gross=turn.gross), turn


def _opened(asked: Asked, turn: Turn, problem: Problem, *, sifted: bool) -> _Round:
    """Linearise a turn with all effects; the first time set isolated rows aside that no effect explains."""
    fitted = fit_less(turn.model, problem, turn.carried, turn.gross, turn.noise)
    candidates, untestable = present_candidates(fitted, problem, asked.known, turn.seen)
    linear, gross = None, turn.gross
    if sifted:
        linear = linear_columns(fitted, problem, candidates, turn.noise)
        gross = sift(linear, problem)
    scorer = open_turn(asked, turn, problem, fitted, candidates, gross, linear, unknown=False)
    if sifted and not np.array_equal(more := sift_again(scorer, candidates, gross), gross):
        gross = more
        scorer = open_turn(asked, turn, problem, fitted, candidates, gross, linear, unknown=False)
    return _Round(replace(turn, gross=gross), fitted, candidates, untestable, scorer)


def _named(opened: _Round, problem: Problem, *, plain_first: bool) -> tuple[Found, bool]:
    """The best set of named effects, and whether curves were among the candidates.

    Curves wait until the model has been moved to the plain effects: with few rows they fit any waves, and the residual
    of a slip and a knock that were found in each other's place.
    """
    turn, scorer = opened.turn, opened.scorer
    start = scorer.score([key for key in turn.kept or () if key in scorer.system.atoms], WHITE)
    scorer, plain, waves = with_harmonics(scorer, climb(scorer, start, is_plain), problem, turn.seen)
    curves = not plain_first or plain.keys == start.keys
    allowed, starts = (is_effect, [plain, start]) if curves else (is_plain, [plain])
    state = _best(scorer, starts, allowed)
    scorer, lasting = dated(scorer, state, opened.candidates)
    if lasting is not None:
        state = _best(scorer, [scorer.score(keys, WHITE) for keys in (lasting, state.keys)], allowed)
    return Found(
        opened.fitted, scorer, state, turn.noise, turn.carried, turn.gross, opened.untestable, turn.periods,
        opening=turn.opening, seen=(*turn.seen, *waves),
    ), curves  # fmt: skip


def _best(scorer: Scorer, starts: Sequence[State], allowed: Allowed) -> State:
    """The best local maximum from some starts."""
    return max((climb(scorer, start, allowed) for start in starts), key=lambda end: end.total)
