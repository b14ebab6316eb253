"""The best explanation of a run: by named effects alone where they suffice, else by a search with unknowns."""

from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.atoms import is_block
from ptt.diagnosis.evidence.noise_level import starting_noise
from ptt.diagnosis.evidence.possible import beyond_machines
from ptt.diagnosis.noise.gross import are_exceptions, common_place
from ptt.diagnosis.search.asked import Asked, scorer_at
from ptt.diagnosis.search.bursts import broken_beams, crowded_moments, lost_rows
from ptt.diagnosis.search.exact import by_names
from ptt.diagnosis.search.excess import QUIET_EXCESS, stated_of
from ptt.diagnosis.search.first import names_suffice
from ptt.diagnosis.search.fits import fit_less
from ptt.diagnosis.search.follow import follow
from ptt.diagnosis.search.found import Found, carried_by, is_denser, moved
from ptt.diagnosis.search.improve import improve
from ptt.diagnosis.search.laws import by_laws, with_atoms
from ptt.diagnosis.search.moves import droppable
from ptt.diagnosis.search.names import names_alone
from ptt.diagnosis.search.plainest import PLAIN_NATS, is_in_model, plainest
from ptt.diagnosis.search.turn import (
    Turn,
    first_turn,
    still_missed,
)
from ptt.diagnosis.unknown.span import Span
from ptt.effects import Library
from ptt.fitting.solve import with_rounds_beside
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.axes import rms_length
from ptt.run.problem import Problem

MOST_ADDED = 12  # effects that may be added to a model


def find(
    model: Model, problem: Problem, known: Library, tell: Tell, steps: int = MOST_ADDED, span: Span | None = None
) -> Found:
    """Find the best explanation of a run.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name.
        tell: callback for progress.
        steps: how many effects may be added.
        span: of the run that the rows are a part of; None where they are all of it.

    Returns:
        The explanation.
    """
    asked, first = _asked(model, problem, known, tell, steps, span)
    if span is None and (without := _without_lost_rows(asked, first)):
        return without
    found = _explained(asked, first)
    if span is not None:  # the rest is done on all rows of the run
        return found
    broken = broken_beams(found)
    less = found.gross | broken
    if broken.any() and (crowded_moments(found) or _names_suffice(_masked(asked, less), first)):
        other = _without_rows(asked, first, less)
        placed = common_place(other.gross, other.fitted.residual, problem) is not None
        sound = are_exceptions(other.gross, problem.used) and not placed
        found = other if sound and is_denser(other, found) else found
    return found


def named_effects_suffice(model: Model, problem: Problem, known: Library, tell: Tell, steps: int) -> bool:
    """Whether named effects alone suffice, found much faster than a search with unknowns; arguments as of `find`."""
    return _names_suffice(*_asked(model, problem, known, tell, steps))


def _asked(
    model: Model, problem: Problem, known: Library, tell: Tell, steps: int, span: Span | None = None
) -> tuple[Asked, Turn]:
    """The question, and the first turn of its search."""
    noise, freedom = starting_noise(problem)
    return Asked(model, problem, known, tell, steps, span, freedom), first_turn(model, problem, noise)


def _explained(asked: Asked, first: Turn) -> Found:
    """The best explanation, with implausible values barred where that is better, and laws in place of stand-ins."""
    found, problem = _searched(asked, first)
    barred, tried = first.barred, set(asked.model.keys)
    while name := next((name for name in _beyond_machines(found) if name not in tried), None):
        tried.add(name)
        other, others = _searched(asked, replace(first, barred=barred | {name}))
        if is_denser(other, found):
            found, problem, barred = replace(other, too_large=(*found.too_large, name)), others, barred | {name}
    found = by_names(asked, found, problem)
    return found if asked.span is not None else _with_laws(asked, _not_empty_for_plainness(found, problem), problem)


def _beyond_machines(found: Found) -> tuple[str, ...]:
    """Names of effects with implausibly large values."""
    atoms = found.system.atoms
    return tuple(atoms[key].name for key in beyond_machines(found.state, atoms, found.system.scale))


def _searched(asked: Asked, first: Turn) -> tuple[Found, Problem]:
    """Named effects alone, or a search from nothing if they do not suffice; and the readings without opening rows."""
    first, named, asked = _beside_names(asked, first)
    found, problem = follow(asked, named)
    if names_suffice(found.scorer, found.state, problem):
        return found, problem
    found.system.forget()
    anew, others = follow(asked, first)  # rounds as tight as beside the names, or the two could not be compared
    if not is_denser(found, anew, PLAIN_NATS):
        return anew, others
    anew.system.forget()  # names are clearly better than the search from nothing: look for unknowns beside them
    beside, problem = follow(asked, named, alone=False)
    return (beside, problem) if is_denser(beside, anew) else (anew, others)


def _beside_names(asked: Asked, first: Turn) -> tuple[Turn, Turn, Asked]:
    """The turns of `names_alone`, and the question with base reflectors that hold the frame beside these names."""
    first, named = names_alone(asked, first)
    return first, named, replace(asked, problem=with_rounds_beside(named.model, asked.problem))


def _without_lost_rows(asked: Asked, first: Turn) -> Found | None:
    """Named effects alone, where they suffice without a few rows that are far beyond all others.

    A search would try for minutes to explain rows that were paired with the readings of others.
    """
    lost = lost_rows(asked.problem)
    if not lost.any():
        return None
    _, named, masked = _beside_names(_masked(asked, lost), first)
    found, problem = follow(masked, named)
    gross = found.gross | lost
    placed = common_place(gross, found.fitted.residual, asked.problem) is not None
    return replace(found, gross=gross) if names_suffice(found.scorer, found.state, problem) and not placed else None


def _names_suffice(asked: Asked, first: Turn) -> bool:
    """Whether named effects alone suffice."""
    _, named, asked = _beside_names(asked, first)
    found, problem = follow(asked, named)
    suffice = names_suffice(found.scorer, found.state, problem)
    found.system.forget()
    return suffice


def _without_rows(asked: Asked, first: Turn, broken: np.ndarray) -> Found:
    """The explanation without some rows, (n,) bool; those of them that it predicts well count again."""
    found = _explained(_masked(asked, broken), first)
    missed = still_missed(found.fitted, asked.problem, found.noise, broken)
    if not np.array_equal(missed, broken):
        found, broken = _explained(_masked(asked, missed), first), missed
    return replace(found, gross=found.gross | broken)


def _masked(asked: Asked, rows: np.ndarray) -> Asked:
    return replace(asked, problem=asked.problem.masked(rows))


def _not_empty_for_plainness(found: Found, problem: Problem) -> Found:
    """The likeliest set instead of the empty one, where that was only the plainest and the error exceeds the noise."""
    scorer, state = found.scorer, found.state
    if droppable(scorer, state) or problem.noise is None:
        return found
    left = found.system.in_mm(found.system.residual(state.columns, state.posterior.values))
    if rms_length(left) <= QUIET_EXCESS * stated_of(problem.noise, problem.rounding[1])[1]:
        return found
    best = max(scorer.scored.values(), key=lambda other: other.total)
    return replace(found, state=plainest(scorer, best, nothing=False))


def _with_laws(asked: Asked, found: Found, problem: Problem) -> Found:
    """The explanation with laws of one variable where these score higher; effects found beside them are refitted."""
    scorer, state = by_laws(found.scorer, found.state)
    lawful = replace(found, scorer=scorer, state=state)
    if is_in_model(scorer, state):
        return lawful
    return max(_with_effects_in_model(asked, lawful, problem), found, key=_score_if_in_model)


def _score_if_in_model(found: Found) -> float:
    return found.state.total if is_in_model(found.scorer, found.state) else -np.inf


def _with_effects_in_model(asked: Asked, found: Found, problem: Problem) -> Found:
    """The explanation with all of its effects in the model, refitted and linearised there, its laws kept as atoms."""
    carried = carried_by(found.state, found.system, problem)
    current = moved(found, asked.model, problem)
    fitted = fit_less(current, problem, carried, found.gross, found.noise)
    scorer, untestable = scorer_at(asked, found, fitted, problem)
    blocks = [found.system.atoms[key] for key in found.state.keys if is_block(found.system.atoms[key])]
    scorer = with_atoms(scorer, [block for block in blocks if block.key not in scorer.system.atoms])
    keys = [*(key for key in current.keys if key in scorer.system.atoms), *(block.key for block in blocks)]
    improve(scorer, scorer.score(keys, found.state.memory))  # scores the sets nearby, for the probabilities
    state = max((each for each in scorer.scored.values() if is_in_model(scorer, each)), key=lambda each: each.total)
    return replace(
        found, fitted=fitted, scorer=scorer, state=scorer.score(state.keys, state.memory),
        carried=carried, untestable=untestable,
    )  # fmt: skip
