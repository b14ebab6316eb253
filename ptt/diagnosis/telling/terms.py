"""Values and standard errors of an explanation's effects, and the values that correct a machine."""

from dataclasses import replace

import numpy as np
import torch

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.telling.absent import absent_effects
from ptt.diagnosis.telling.exchange import Exchange, exchanged_errors
from ptt.diagnosis.telling.spread import spread_of, values_of
from ptt.fitting.layout import bounds_of
from ptt.fitting.result import MEASURED_SHARE
from ptt.model.model import Model, Term


def posterior_terms(
    found: Found, model: Model, keys: tuple[str, ...], others: tuple[Exchange, ...]
) -> tuple[Term, ...]:
    """The given effects and the steps at the posterior's values, with standard errors.

    Args:
        found: the best explanation.
        model: the model as given.
        keys: of the steps' atoms.
        others: refits with moments of a slip and a knock exchanged.

    Returns:
        The terms, in the order of a model; terms without free values are as given.
    """
    exchanged = exchanged_errors(found, others)
    absent = absent_effects(found.scorer, found.state, drawn=found.fitted.unnamed is None)
    system, state = found.system, found.state
    current = replace(model, terms=tuple(term for term in model.terms if term.effect.key not in system.atoms))
    for key in (*found.scorer.given, *keys):
        atom, own = system.atoms[key], state.of(key)
        term = next((t for t in found.fitted.model.terms if t.effect.key == atom.name), None)
        if term is None or atom.shape is not None:
            continue
        free = _free(found, atom)
        theta, error = term.theta.clone(), torch.full_like(term.theta, torch.nan)
        seen = torch.ones(len(theta), dtype=torch.bool)
        theta[free] = torch.as_tensor(atom.amplitudes(state.posterior.values[own], system.scale))
        std, prior = state.errors(atom, system.scale)
        error[free] = torch.as_tensor(
            np.sqrt(
                spread_of(found.scorer, state, key, absent) ** 2
                + exchanged[atom.name][free.numpy()]
                + found.fitted.open[_own(found, atom)]
            )
        )
        seen[free] = torch.as_tensor(std**2 < MEASURED_SHARE * prior**2)
        current = current + replace(term, theta=_within(term, theta, model), std=error, measured=seen)
    return current.terms


def sent_state(found: Found, keys: tuple[str, ...]) -> State:
    """The set of the steps alone, under white noise, from which commands are corrected.

    Beside a block an effect has only its own part, and the block's part would remain uncorrected. The noise is white
    because, without the block, a wander would grow and absorb what effects have to correct.

    Args:
        found: the best explanation.
        keys: of the steps' atoms.

    Returns:
        The explanation's own set where it has nothing else.
    """
    scorer = found.scorer
    return found.state if set(found.state.keys) == {*scorer.given, *keys} else scorer.score(keys, WHITE)


def sent_terms(found: Found, terms: tuple[Term, ...], keys: tuple[str, ...]) -> tuple[Term, ...]:
    """Terms at the values that correct a machine: those of the held-out error, and of a fit by `ptt add`.

    Args:
        found: the best explanation.
        terms: its given effects and its steps.
        keys: of the steps' atoms.

    Returns:
        The terms; as given where the explanation has nothing but the steps.
    """
    alone, sent = sent_state(found, keys), list[Term]()
    if alone is found.state:
        return terms
    atoms = {found.system.atoms[key].name: found.system.atoms[key] for key in alone.keys}
    for term in terms:
        atom, theta = atoms.get(term.effect.key), term.theta.clone()
        if atom is None:  # all of its values are held
            sent.append(term)
            continue
        theta[_free(found, atom)] = torch.as_tensor(values_of(alone, atom, found.system.scale))
        sent.append(replace(term, theta=_within(term, theta, found.fitted.model)))
    return tuple(sent)


def _within(term: Term, theta: torch.Tensor, model: Model) -> torch.Tensor:
    """Values with searched parameters clipped to their bounds, beyond which a linearised solution may be."""
    bounds, place = list[tuple[float, float]](), 0
    for parameter in (each.on(model.file.machine.kind) for each in term.effect.parameters):
        size = parameter.size(model.joints)
        own = term.theta[place : place + size].numpy()
        bounds += [bounds_of(parameter, own) if parameter.role == "searched" else (-np.inf, np.inf)] * size
        place += size
    low, high = torch.tensor(bounds, dtype=theta.dtype).T
    return torch.clamp(theta, low, high)


def _own(found: Found, atom: Atom) -> np.ndarray:
    """Which unknowns of the fit belong to an effect, (u,) bool."""
    layout = found.fitted.layout
    return np.asarray(layout.owner == [term.effect.key for term in layout.terms].index(atom.name))


def _free(found: Found, atom: Atom) -> torch.Tensor:
    """Which values of a model's effect are free, and so columns of its atom, (p,) bool."""
    index = [term.effect.key for term in found.fitted.layout.terms].index(atom.name)
    return torch.as_tensor(found.fitted.layout.free[index])
