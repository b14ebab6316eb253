"""Find: the best explanation of a run, by names where they suffice, else by a search from nothing."""

from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.atoms import is_block
from ptt.diagnosis.evidence.noise_level import starting_noise
from ptt.diagnosis.evidence.possible import beyond_machines
from ptt.diagnosis.noise.gross import are_exceptions, has_a_place
from ptt.diagnosis.search.asked import Asked, scorer_at
from ptt.diagnosis.search.bursts import broken_beams, crowded_moments
from ptt.diagnosis.search.exact import by_names
from ptt.diagnosis.search.first import names_suffice
from ptt.diagnosis.search.fits import fit_less
from ptt.diagnosis.search.follow import follow
from ptt.diagnosis.search.found import Found, carried_by, moved, says_more
from ptt.diagnosis.search.improve import improve
from ptt.diagnosis.search.laws import by_laws, with_atoms
from ptt.diagnosis.search.moves import droppable
from ptt.diagnosis.search.names import names_alone
from ptt.diagnosis.search.plainest import PLAIN_NATS, is_in_model, plainest
from ptt.diagnosis.search.rest import QUIET_EXCESS, stated_of
from ptt.diagnosis.search.turn import (
    Turn,
    first_turn,
    still_missed,
)
from ptt.diagnosis.unknown.span import Span
from ptt.effects import Library
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem

MOST_ADDED = 12  # effects that may be added to a model


def find(
    model: Model, problem: Problem, known: Library, tell: Tell, steps: int = MOST_ADDED, span: Span | None = None
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
    asked, first = _asked(model, problem, known, tell, steps, span)
    found = _explained(asked, first)
    if span is not None:  # what explains a part has to be worked out for all of the run
        return found
    broken = broken_beams(found)
    less = found.gross | broken
    if broken.any() and (crowded_moments(found) or _names_do(_masked(asked, less), first)):
        other = _left_out(asked, first, less)
        placed = has_a_place(other.gross, other.fitted.residual, problem)
        sound = are_exceptions(other.gross, problem.used) and not placed
        found = other if sound and says_more(other, found) else found
    return found


def names_say_all(model: Model, problem: Problem, known: Library, tell: Tell, steps: int) -> bool:
    """Whether names alone say all, which takes a small part of the time that unknowns do; arguments as of `find`."""
    return _names_do(*_asked(model, problem, known, tell, steps))


def _asked(
    model: Model, problem: Problem, known: Library, tell: Tell, steps: int, span: Span | None = None
) -> tuple[Asked, Turn]:
    """What is asked, and the first turn."""
    noise, freedom = starting_noise(problem)
    return Asked(model, problem, known, tell, steps, span, freedom), first_turn(model, problem, noise)


def _explained(asked: Asked, first: Turn) -> Found:
    """Where names lead, or a search from nothing, less what no machine is off by, with laws where they are likelier."""
    found, problem = _begun(asked, first)
    barred, tried = first.barred, set(asked.model.keys)
    while name := next((name for name in _beyond_machines(found) if name not in tried), None):
        tried.add(name)
        other, others = _begun(asked, replace(first, barred=barred | {name}))
        if says_more(other, found):
            found, problem, barred = other, others, barred | {name}
    found = by_names(asked, found, problem)
    return found if asked.span is not None else _lawful(asked, _more_than_nothing(found, problem), problem)


def _beyond_machines(found: Found) -> tuple[str, ...]:
    """Names of effects with values that no machine has."""
    atoms = found.system.atoms
    return tuple(atoms[key].name for key in beyond_machines(found.state, atoms, found.system.scale))


def _begun(asked: Asked, first: Turn) -> tuple[Found, Problem]:
    """Where names lead, or a search from nothing if they do not suffice; and the readings without an opening."""
    first, named = names_alone(asked, first)
    found, problem = follow(asked, named)
    if names_suffice(found.scorer, found.state, problem):
        return found, problem
    found.system.forget()
    anew, others = follow(asked, first)
    if not says_more(found, anew, PLAIN_NATS):
        return anew, others
    anew.system.forget()  # an unknown beside names is likelier than all that began with unknowns
    beside, problem = follow(asked, named, alone=False)
    return (beside, problem) if says_more(beside, anew) else (anew, others)


def _names_do(asked: Asked, first: Turn) -> bool:
    """Whether names alone say all."""
    found, problem = follow(asked, names_alone(asked, first)[1])
    suffice = names_suffice(found.scorer, found.state, problem)
    found.system.forget()
    return suffice


def _left_out(asked: Asked, first: Turn, broken: np.ndarray) -> Found:
    """What is found without some rows, (n,) bool, less those that it reaches all the same."""
    found = _explained(_masked(asked, broken), first)
    reached = replace(found.fitted, residual=found.fitted.residual - found.carried)
    missed = still_missed(reached, asked.problem, found.noise, broken)
    if not np.array_equal(missed, broken):
        found, broken = _explained(_masked(asked, missed), first), missed
    return replace(found, gross=found.gross | broken)


def _masked(asked: Asked, rows: np.ndarray) -> Asked:
    return replace(asked, problem=asked.problem.masked(rows))


def _more_than_nothing(found: Found, problem: Problem) -> Found:
    """What is likeliest, where nothing is said for being plain alone though the error is beyond what is stated."""
    scorer, state = found.scorer, found.state
    if droppable(scorer, state) or problem.noise is None:
        return found
    left = found.system.in_mm(found.system.residual(state.columns, state.posterior.values))
    if np.sqrt(np.square(left).sum(axis=1).mean()) <= QUIET_EXCESS * stated_of(problem.noise, problem.rounding[1])[1]:
        return found
    best = max(scorer.scored.values(), key=lambda other: other.total)
    return replace(found, state=plainest(scorer, best, nothing=False))


def _lawful(asked: Asked, found: Found, problem: Problem) -> Found:
    """The same with laws of one variable where readings prefer them; what they let in is linearised at."""
    scorer, state = by_laws(found.scorer, found.state)
    lawful = replace(found, scorer=scorer, state=state)
    if is_in_model(scorer, state):
        return lawful
    return max(_told(asked, lawful, problem), found, key=_told_total)


def _told_total(found: Found) -> float:
    return found.state.total if is_in_model(found.scorer, found.state) else -np.inf


def _told(asked: Asked, found: Found, problem: Problem) -> Found:
    """The same explanation with all of its effects in the model, linearised there, its laws carried along."""
    carried = carried_by(found.state, found.system, problem)
    current = moved(found, asked.model, problem)
    fitted = fit_less(current, problem, carried, found.gross, found.noise)
    scorer, untestable = scorer_at(asked, found, fitted, problem)
    blocks = [found.system.atoms[key] for key in found.state.keys if is_block(found.system.atoms[key])]
    scorer = with_atoms(scorer, [block for block in blocks if block.key not in scorer.system.atoms])
    keys = [*(key for key in current.keys if key in scorer.system.atoms), *(block.key for block in blocks)]
    improve(scorer, scorer.score(keys, found.state.memory))  # what comes near has a say in probabilities
    state = max((each for each in scorer.scored.values() if is_in_model(scorer, each)), key=lambda each: each.total)
    return replace(
        found, fitted=fitted, scorer=scorer, state=scorer.score(state.keys, state.memory),
        carried=carried, untestable=untestable,
    )  # fmt: skip
