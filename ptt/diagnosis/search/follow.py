"""Turns of a search: linearise, search, move the model to what was found, until the explanation stays the same."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.detail import follows_travel, with_detail
from ptt.diagnosis.evidence.noise_level import noise_again
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.asked import Asked, open_turn
from ptt.diagnosis.search.cycles import cycle_of, line_left
from ptt.diagnosis.search.drawing import by_drawing
from ptt.diagnosis.search.exact import without_needless
from ptt.diagnosis.search.first import beside_names, names_suffice, search_first
from ptt.diagnosis.search.fits import fit_less
from ptt.diagnosis.search.found import Found, carried_by, is_better, moved, settled
from ptt.diagnosis.search.harmonics import with_harmonics
from ptt.diagnosis.search.improve import improve
from ptt.diagnosis.search.instead import refilled
from ptt.diagnosis.search.moves import droppable
from ptt.diagnosis.search.plainest import plainest
from ptt.diagnosis.search.shapes import best_meanings, with_moments, with_other_meanings
from ptt.diagnosis.search.turn import Turn, best_moments, gross_beside, moments_of, still_missed, unlike
from ptt.effects import Effect
from ptt.fitting.opening import untold_rows, without_opening
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem

MOST_TURNS = 5  # turns of linearising and searching
# Ratio of the noise left to the noise assumed, below which the search is repeated with the smaller one
NARROWER_NOISE = 0.8


def follow(asked: Asked, turn: Turn, *, alone: bool = True) -> tuple[Found, Problem]:
    """Repeat turns until the explanation is linearised at itself.

    Args:
        asked: what is to be explained.
        turn: the first turn.
        alone: whether to stop after a first turn from named effects that shows that they do not suffice.

    Returns:
        The explanation, and the readings without the rows that open a run.
    """
    while True:
        problem = without_opening(asked.problem, turn.opening)
        found, candidates = _searched(asked, turn, problem)
        if turn.before is not None and is_better(turn.before, found):  # other curves had taken over their work
            return turn.before, problem
        named = alone and turn.number == 0 and turn.kept is not None
        if named and not names_suffice(found.scorer, found.state, problem):
            return found, problem
        found, following = _turned(asked, turn, found, problem, candidates)
        if following is None:
            return found, problem
        turn = following


def _searched(asked: Asked, turn: Turn, problem: Problem) -> tuple[Found, list[Effect]]:
    """One turn: linearise and search. Returns the explanation and the candidates."""
    asked.tell(f"linearise {turn.number + 1}")
    gross, noise = turn.gross, turn.noise
    fitted = fit_less(turn.model, problem, turn.carried, gross, noise)
    candidates, untestable = present_candidates(fitted, problem, asked.known, turn.seen)
    if turn.number > 0 and turn.before is None:  # `before` is only comparable on the same rows
        gross = still_missed(fitted, problem, noise, gross)
    scorer = open_turn(asked, turn, problem, fitted, candidates, gross)
    asked.tell(f"search {turn.number + 1}")
    if turn.kept is None:
        scorer, state = search_first(scorer, candidates)
    else:
        state = scorer.score([key for key in turn.kept if key in scorer.system.atoms], turn.memory)
        if follows_travel(state, scorer.system, problem):
            scorer = with_detail(scorer, problem)
        scorer = with_other_meanings(scorer, fitted, problem)
        state = best_meanings(scorer, state)
        if turn.number == 0:
            state = beside_names(scorer, state, problem)
        elif turn.number < MOST_TURNS - 1:  # the last turn keeps what it is linearised at
            state = refilled(scorer, _improved(scorer, state))
    scorer, state = by_drawing(scorer, state)
    return Found(
        fitted, scorer, plainest(scorer, state), noise, turn.carried, gross, untestable, turn.periods,
        opening=turn.opening, seen=turn.seen,
    ), candidates  # fmt: skip


def _improved(scorer: Scorer, state: State) -> State:
    """The best set that moves lead to; where the wander is more than a tracker's, also from white noise."""
    starts = [state]
    if scorer.system.clock.is_fault(state.memory.wander):  # it may be the machine's errors
        starts.append(scorer.score(state.keys, WHITE, state.variances))
    return max((improve(scorer, each) for each in starts), key=lambda end: end.total)


def _turned(
    asked: Asked, turn: Turn, found: Found, problem: Problem, candidates: Sequence[Effect]
) -> tuple[Found, Turn | None]:
    """The explanation, and the next turn; None where it is linearised at itself."""
    if turn.number == MOST_TURNS - 1:
        return found, None
    scorer, state, waves = with_harmonics(found.scorer, found.state, problem, turn.seen)
    system = rows_of(scorer.system)
    found = replace(found, scorer=scorer, state=state, seen=(*turn.seen, *waves))
    line = line_left(scorer, state, problem, turn.periods, waves)
    gross = gross_beside(system, state, found.gross)
    stays = settled(state, system) and set(_blocks(found)) == set(turn.held)
    beside = None if line is None else cycle_of(line, problem, system)
    noise = noise_again(problem, system, state, settled=turn.number > 0 and stays, beside=beside)
    steady = False
    if line is None and stays:
        found, steady = _is_steady(turn, found, gross, noise, candidates)
    following = replace(turn, number=turn.number + 1, gross=gross, memory=state.memory, before=None, seen=found.seen)
    if steady or turn.number == MOST_TURNS - 2:
        fewer = _without_needless(following, found, problem, steady=steady)
        if fewer is not None:
            system.forget()
            return found, fewer
    if steady:
        return found, None
    periods = turn.periods if line is None else (*turn.periods, line)
    following = _moved_on(asked.model, replace(following, noise=noise, periods=periods), found, problem, candidates)
    system.forget()
    return found, following


def _is_steady(
    turn: Turn, found: Found, gross: np.ndarray, noise: Noise, candidates: Sequence[Effect]
) -> tuple[Found, bool]:
    """The explanation, after a first turn with moments to the row, and whether another turn would change nothing.

    Args:
        turn: this turn, whose model and blocks are those of the explanation.
        found: the explanation.
        gross: rows to be left out next, (n,) bool.
        noise: to whiten with next.
        candidates: effects that may be missing.
    """
    if turn.number > 0:
        return found, noise.total > NARROWER_NOISE * found.noise.total and bool((found.gross == gross).all())
    if gross.any() or noise is not found.noise:
        return found, False
    again = _with_moments(found, candidates)  # the next turn would differ only by finer moments
    return (again, True) if again.state.keys == found.state.keys else (found, False)


def _without_needless(following: Turn, found: Found, problem: Problem, *, steady: bool) -> Turn | None:
    """The next turn without effects that an exact fit of the model does without; None where there are none."""
    current = without_needless(found if steady else _fitted_beside(found, problem), problem)
    needless = set(found.fitted.model.keys) - set(current.keys)
    if not needless:
        return None
    kept, barred = (*current.keys, *_blocks(found)), following.barred | needless
    return replace(following, model=current, kept=kept, barred=barred, before=found)


def _moved_on(model: Model, following: Turn, found: Found, problem: Problem, candidates: Sequence[Effect]) -> Turn:
    """The next turn, at the model moved to the explanation."""
    scorer, state, blocks = found.scorer, found.state, _blocks(found)
    moments = best_moments(scorer, state, droppable(scorer, state), candidates)
    carried = carried_by(state, found.system, problem)
    current = moved(found, model, problem)
    return replace(
        following, model=current, carried=carried, held=blocks,
        kept=(*current.keys, *blocks),
        moments=unlike([*moments, *moments_of(current)]),
        opening=following.opening | untold_rows(current.terms, problem, following.noise),
    )  # fmt: skip


def _blocks(found: Found) -> tuple[str, ...]:
    """Keys of the explanation's blocks."""
    return tuple(key for key in found.state.keys if found.system.atoms[key].block is not None)


def _with_moments(found: Found, candidates: Sequence[Effect]) -> Found:
    """The explanation searched on with moments to the row."""
    moments = best_moments(found.scorer, found.state, droppable(found.scorer, found.state), candidates)
    scorer = with_moments(found.scorer, moments)
    state = plainest(scorer, refilled(scorer, improve(scorer, found.state)))
    return replace(found, scorer=scorer, state=state)


def _fitted_beside(found: Found, problem: Problem) -> Found:
    """The explanation refitted beside its present blocks, which may differ from those of the turn before."""
    carried = carried_by(found.state, found.system, problem)
    fitted = fit_less(found.fitted.model, problem, carried, found.gross, found.noise)
    return replace(found, fitted=fitted, carried=carried)
