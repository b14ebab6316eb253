"""Which effects of an explanation are named and at which values; none that does nothing or has impossible values."""

from dataclasses import dataclass, replace

import numpy as np

from ptt.diagnosis.evidence.at_tool import moved_by
from ptt.diagnosis.evidence.noise_level import noise_after
from ptt.diagnosis.evidence.possible import CLEARLY_BEYOND
from ptt.diagnosis.search.fits import is_reachable
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.telling.exchange import Exchange, exchanges
from ptt.diagnosis.telling.steps import Named, name_steps
from ptt.diagnosis.telling.terms import posterior_terms, sent_terms
from ptt.model.model import Model, Term
from ptt.run.problem import Problem

YIELDING, SAG = "axis-compliance", "self-weight"  # joints that yield to their load, and to the arm's own weight
IDLE_CHI2 = 10.0  # chi-squared of all that an effect does, below which it does nothing: half of what a name has to gain


@dataclass(frozen=True)
class Naming:
    """The named effects of an explanation at their values.

    Attributes:
        named: the steps.
        others: refits with moments of different sudden effects exchanged.
        terms: effects of the model as given and named ones, at the posterior's values.
        sent: the same at the values that correct a machine.
        impossible: names of effects at whose values commanded poses cannot be reached; then no step is named.
        idle: names of effects that do nothing visible at their fitted values; they are no steps.
        backward: names of effects with values of a physically impossible sign; they are no steps.
    """

    named: Named
    others: tuple[Exchange, ...]
    terms: tuple[Term, ...]
    sent: tuple[Term, ...]
    impossible: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()
    backward: tuple[str, ...] = ()


def naming_of(found: Found, model: Model, problem: Problem, shown: Problem) -> Naming:
    """The named effects; none where commanded poses of the shown rows cannot be reached with their values.

    Args:
        found: the explanation.
        model: as given.
        problem: the readings that count.
        shown: the rows that are used for display and checks: all of them, or the sample of a long run.
    """
    named, others = _with_same_cause(name_steps(found.scorer, found.state), found, problem), exchanges(found, problem)
    keys = tuple(step.key for step in named.steps)
    terms = posterior_terms(found, model, keys, others)
    idle, backward = _idle(found, keys, terms, shown, problem), _backward(found, keys, terms)
    if idle or backward:
        named = replace(named, steps=tuple(step for step in named.steps if step.key not in (*idle, *backward)))
        keys = tuple(step.key for step in named.steps)
        terms = posterior_terms(found, model, keys, others)
    sent, names = sent_terms(found, terms, keys), {key: atom.name for key, atom in found.system.atoms.items()}
    if is_reachable(terms, shown) and is_reachable(sent, shown):
        not_named = {"idle": tuple(names[key] for key in idle), "backward": tuple(names[key] for key in backward)}
        return Naming(named, others, terms, sent, **not_named)
    given = tuple(term for term in found.fitted.model.terms if term.effect.key in model.keys)
    impossible = tuple(names[key] for key in keys)
    return Naming(replace(named, steps=()), others, given, given, impossible)


def _with_same_cause(named: Named, found: Found, problem: Problem) -> Named:
    """The steps, with self-weight tied to joints that yield to nothing but the stated weights of an arm's links.

    Sag under the arm's own weight is then the same cause, and has more values only because it knows no masses.
    """
    atoms, view = found.system.atoms, problem.view
    known = any(atom.name == SAG for atom in atoms.values())
    if not known or view.link_load is None or view.torque is not None or "payload" in view.varies:
        return named
    steps = (
        replace(step, others=(*step.others, SAG))
        if atoms[step.key].name == YIELDING and SAG not in step.others
        else step
        for step in named.steps
    )
    return replace(named, steps=tuple(steps))


def _idle(
    found: Found, keys: tuple[str, ...], terms: tuple[Term, ...], shown: Problem, problem: Problem
) -> tuple[str, ...]:
    """Keys of effects that do nothing visible at their fitted values."""
    atoms, white = found.system.atoms, noise_after(problem, found.system, found.state).whitener
    values = {term.effect.key: term for term in terms}
    named = [(key, values[atoms[key].name]) for key in keys if atoms[key].name in values]
    share = problem.used.sum() / max(shown.used.sum(), 1)
    held = shown.anchored()  # with the frame held by base reflectors, a motion as a whole is visible
    seen = {key: share * float(np.square(moved_by(term, held) @ white.T).sum()) for key, term in named}
    return tuple(key for key, square in seen.items() if square < IDLE_CHI2)


def _backward(found: Found, keys: tuple[str, ...], terms: tuple[Term, ...]) -> tuple[str, ...]:
    """Keys of one-way effects with a value clearly of the wrong sign."""
    values = {term.effect.key: term for term in terms}
    named = [(key, values[name]) for key in keys if (name := found.system.atoms[key].name) in values]
    return tuple(
        key for key, term in named
        if term.effect.one_way and term.std is not None and bool((term.theta < -CLEARLY_BEYOND * term.std).any())
    )  # fmt: skip
