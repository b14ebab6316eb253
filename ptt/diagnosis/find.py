"""Find: linearise, search, move the model to what was found, linearise there again."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.asked import Asked, open_turn
from ptt.diagnosis.atoms import is_block
from ptt.diagnosis.bursts import broken_beams
from ptt.diagnosis.candidates import present_candidates
from ptt.diagnosis.detail import follows_travel, with_detail
from ptt.diagnosis.drawing import by_drawing
from ptt.diagnosis.exact import by_names, without_needless
from ptt.diagnosis.first import beside_names, names_suffice, search_first
from ptt.diagnosis.fits import fit_less
from ptt.diagnosis.found import Found, carried_by, is_better, moved, says_more, scorer_at, settled
from ptt.diagnosis.gross import are_exceptions, has_a_place
from ptt.diagnosis.harmonics import with_harmonics
from ptt.diagnosis.improve import improve
from ptt.diagnosis.instead import refilled
from ptt.diagnosis.laws import by_laws, with_atoms
from ptt.diagnosis.memory import WHITE
from ptt.diagnosis.moves import loose
from ptt.diagnosis.names import names_alone
from ptt.diagnosis.noise import noise_again, starting_noise
from ptt.diagnosis.periods import period_left
from ptt.diagnosis.plainest import PLAIN, is_told, plainest
from ptt.diagnosis.possible import beyond_machines
from ptt.diagnosis.rest import SILENT, stated_of
from ptt.diagnosis.row_system import RowSystem
from ptt.diagnosis.score import Scorer
from ptt.diagnosis.shapes import best_meanings, with_moments, with_other_meanings
from ptt.diagnosis.span import Span
from ptt.diagnosis.state import State
from ptt.diagnosis.turn import (
    Turn,
    best_moments,
    first_turn,
    gross_beside,
    moments_of,
    still_missed,
    unlike,
)
from ptt.effects import Effect, Library
from ptt.fitting.opening import untold_rows, without_opening
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem

STEPS = 12  # effects that may be added
TURNS = 5  # of linearising and searching
NARROWER = 0.8  # of the noise that an explanation was found with: where it leaves less, it is asked for again with that


def find(
    model: Model, problem: Problem, known: Library, tell: Tell, steps: int = STEPS, span: Span | None = None
) -> Found:
    """Find the best explanation of a run.

    Args:
        model: as given.
        problem: the readings.
        known: effects by name.
        tell: told what is being done.
        steps: how many effects may be added.
        span: of the run that the rows are a part of; None where they are all of it.

    Returns:
        What was found.
    """
    noise, freedom = starting_noise(problem)
    asked = Asked(model, problem, known, tell, steps, span, freedom)
    first = first_turn(model, problem, noise)
    found = _explained(asked, first)
    if span is not None:  # what explains a part has to be worked out for all of the run
        return found
    broken = broken_beams(found)
    if broken.any():
        other = _left_out(asked, first, broken | found.gross)
        sound = are_exceptions(other.gross, problem.used) and not has_a_place(other.gross, problem)
        found = other if sound and says_more(other, found) else found
    return found


def _explained(asked: Asked, first: Turn) -> Found:
    """Where names lead, or a search from nothing, less what no machine is off by, with laws where they are likelier."""
    found, problem = _begun(asked, first)
    for key in beyond_machines(found.state, found.system.atoms, found.system.scale):
        if key in asked.model.keys:
            continue
        other, others = _begun(asked, replace(first, barred=first.barred | {key}))
        if says_more(other, found):
            found, problem = other, others
    found = by_names(found, asked.model, problem, asked.known, asked.freedom, asked.steps)
    return found if asked.span is not None else _lawful(asked, _more_than_nothing(found, problem), problem)


def _begun(asked: Asked, first: Turn) -> tuple[Found, Problem]:
    """Where names lead, or a search from nothing if they do not suffice; and the readings without an opening."""
    first, named = names_alone(asked, first)
    found, problem = _followed(asked, named)
    if names_suffice(found.scorer, found.state, problem):
        return found, problem
    found.system.forget()
    anew, others = _followed(asked, first)
    if not says_more(found, anew, PLAIN):
        return anew, others
    anew.system.forget()  # an unknown beside names is likelier than all that began with unknowns
    beside, problem = _followed(asked, named, alone=False)
    return (beside, problem) if says_more(beside, anew) else (anew, others)


def _left_out(asked: Asked, first: Turn, broken: np.ndarray) -> Found:
    """What is found without some rows, (n,) bool, less those that it reaches all the same."""
    found = _explained(replace(asked, problem=asked.problem.masked(broken)), first)
    reached = replace(found.fitted, residual=found.fitted.residual - found.carried)
    missed = still_missed(reached, asked.problem, found.noise, broken)
    if not np.array_equal(missed, broken):
        found, broken = _explained(replace(asked, problem=asked.problem.masked(missed)), first), missed
    return replace(found, gross=found.gross | broken)


def _more_than_nothing(found: Found, problem: Problem) -> Found:
    """What is likeliest, where nothing is said for being plain alone though the error is beyond what is stated."""
    scorer, state = found.scorer, found.state
    if loose(scorer, state) or problem.noise is None:
        return found
    left = found.system.in_mm(found.system.left(state.columns, state.posterior.values))
    if np.sqrt(np.square(left).sum(axis=1).mean()) <= SILENT * stated_of(problem.noise)[1]:
        return found
    best = max(scorer.scored.values(), key=lambda other: other.total)
    return replace(found, state=plainest(scorer, best, nothing=False))


def _followed(asked: Asked, turn: Turn | None, *, alone: bool = True) -> tuple[Found, Problem]:
    """Where turns lead, the first alone where names are to suffice and do not; and the readings without an opening."""
    assert turn is not None
    while turn is not None:
        problem = without_opening(asked.problem, turn.opening)
        found, candidates = _searched(asked, turn, problem)
        if turn.before is not None and is_better(turn.before, found):  # curves that bend further did the work
            return turn.before, problem
        named = alone and turn.number == 0 and turn.kept is not None
        if named and not names_suffice(found.scorer, found.state, problem):
            return found, problem
        found, turn = _turned(asked, turn, found, problem, candidates)
    return found, problem


def _searched(asked: Asked, turn: Turn, problem: Problem) -> tuple[Found, list[Effect]]:
    """Linearise and search; what may have been added."""
    asked.tell(f"linearise {turn.number + 1}")
    gross, noise = turn.gross, turn.noise
    fitted = fit_less(turn.model, problem, turn.carried, gross, noise)
    candidates, untestable = present_candidates(fitted, problem, asked.known, turn.seen)
    if turn.number > 0 and turn.before is None:  # else it is what other rows said that would be compared
        gross = still_missed(fitted, problem, noise, gross)
    scorer = open_turn(asked, turn, problem, fitted, candidates, gross)
    asked.tell(f"search {turn.number + 1}")
    system = scorer.system
    assert isinstance(system, RowSystem)
    if turn.kept is None:
        scorer, system, state = search_first(scorer, candidates)
    else:
        state = scorer.score([key for key in turn.kept if key in system.atoms], turn.memory)
        if follows_travel(state, system, problem):
            scorer, system = with_detail(scorer, problem)
        scorer, system = with_other_meanings(scorer, fitted, problem)
        state = best_meanings(scorer, state)
        if turn.number == 0:
            state = beside_names(scorer, state, problem)
        elif turn.number < TURNS - 1:  # what is said is what it is linearised at
            state = refilled(scorer, _improved(scorer, state))
    scorer, state = by_drawing(scorer, state)
    return Found(
        fitted, system, scorer, plainest(scorer, state), noise, turn.carried, gross, untestable, turn.periods,
        asked.span, opening=turn.opening, seen=turn.seen,
    ), candidates  # fmt: skip


def _improved(scorer: Scorer, state: State) -> State:
    """The best set that moves lead to; where the noise remembers more than a tracker's does, also without that."""
    starts = [state]
    if scorer.system.clock.is_fault(state.memory.wander):  # it may be the machine that it follows
        starts.append(scorer.score(state.keys, WHITE, state.scales))
    return max((improve(scorer, each) for each in starts), key=lambda end: end.total)


def _turned(
    asked: Asked, turn: Turn, found: Found, problem: Problem, candidates: Sequence[Effect]
) -> tuple[Found, Turn | None]:
    """What was found, and the turn that it asks for; None where it is linearised at what it says."""
    if turn.number == TURNS - 1:
        return found, None
    scorer, state, waves = with_harmonics(found.scorer, found.state, problem, turn.seen)
    system = scorer.system
    assert isinstance(system, RowSystem)
    found = replace(found, scorer=scorer, system=system, state=state, seen=(*turn.seen, *waves))
    line = period_left(scorer, state, problem, turn.periods, waves)
    gross = gross_beside(system, state, found.gross)
    blocks = tuple(key for key in state.keys if system.atoms[key].block is not None)
    stays = settled(state, system) and set(blocks) == set(turn.held)
    same = line is None and stays
    noise = noise_again(problem, system, state, settled=turn.number > 0 and stays)
    wide = noise.total > NARROWER * found.noise.total
    steady = turn.number > 0 and same and wide and bool((found.gross == gross).all())
    still = turn.number == 0 and same and not gross.any()
    if still and noise is found.noise:  # the next would be this one, but for moments
        again = _with_moments(found, candidates)
        steady = again.state.keys == state.keys
        found = again if steady else found
    seen = (*turn.seen, *waves)
    following = replace(turn, number=turn.number + 1, gross=gross, memory=state.memory, before=None, seen=seen)
    if steady or turn.number == TURNS - 2:
        current = without_needless(found if steady else _fitted_beside(found, problem), problem)
        needless = set(found.fitted.model.keys) - set(current.keys)
        if needless:
            kept, barred = (*current.keys, *blocks), turn.barred | needless
            system.forget()
            return found, replace(following, model=current, kept=kept, barred=barred, before=found)
    if steady:
        return found, None
    moments, periods = best_moments(scorer, state, loose(scorer, state), candidates), turn.periods
    carried = carried_by(state, system, problem)
    current = moved(found, asked.model, problem)
    opening = turn.opening | untold_rows(current.terms, problem, noise)
    system.forget()
    return found, replace(
        following, model=current, noise=noise, carried=carried, held=blocks,
        kept=(*current.keys, *blocks),
        moments=unlike([*moments, *moments_of(current)]),
        periods=periods if line is None else (*periods, (line.joint, line.length)),
        opening=opening,
    )  # fmt: skip


def _lawful(asked: Asked, found: Found, problem: Problem) -> Found:
    """The same with laws of one variable where readings prefer them; what they let in is linearised at."""
    scorer, state = by_laws(found.scorer, found.state)
    lawful = replace(found, scorer=scorer, system=scorer.system, state=state)
    if is_told(scorer, state):
        return lawful
    return max(_told(asked, lawful, problem), found, key=_total)


def _total(found: Found) -> float:
    return found.state.total if is_told(found.scorer, found.state) else -np.inf


def _told(asked: Asked, found: Found, problem: Problem) -> Found:
    """The same explanation with all of its effects in the model, linearised there, its laws carried along."""
    carried = carried_by(found.state, found.system, problem)
    current = moved(found, asked.model, problem)
    fitted = fit_less(current, problem, carried, found.gross, found.noise)
    scorer, untestable = scorer_at(found, fitted, asked.model, problem, asked.known, asked.freedom, asked.steps)
    blocks = [found.system.atoms[key] for key in found.state.keys if is_block(found.system.atoms[key])]
    scorer = with_atoms(scorer, [block for block in blocks if block.key not in scorer.system.atoms])
    keys = [*(key for key in current.keys if key in scorer.system.atoms), *(block.key for block in blocks)]
    improve(scorer, scorer.score(keys, found.state.memory))  # what comes near has a say in probabilities
    state = max((each for each in scorer.scored.values() if is_told(scorer, each)), key=lambda each: each.total)
    return replace(
        found, fitted=fitted, system=scorer.system, scorer=scorer, state=scorer.score(state.keys, state.memory),
        carried=carried, untestable=untestable,
    )  # fmt: skip


def _with_moments(found: Found, candidates: Sequence[Effect]) -> Found:
    """The same, searched on with moments to the row."""
    moments = best_moments(found.scorer, found.state, loose(found.scorer, found.state), candidates)
    scorer, system = with_moments(found.scorer, moments)
    state = plainest(scorer, refilled(scorer, improve(scorer, found.state)))
    return replace(found, system=system, scorer=scorer, state=state)


def _fitted_beside(found: Found, problem: Problem) -> Found:
    """The same fitted beside the unknowns that it has now: those of the turn before may be gone."""
    carried = carried_by(found.state, found.system, problem)
    fitted = fit_less(found.fitted.model, problem, carried, found.gross, found.noise)
    return replace(found, fitted=fitted, carried=carried)
