"""This run's data with the fit of one effect through it: what the residual is without the effect, and what it takes."""

from dataclasses import replace
from typing import Any

import numpy as np
import torch

from ptt.dependence.contexts import context_views, level, residual_views
from ptt.diagnosis.verdict import Diagnosis
from ptt.effects.cards import card_of
from ptt.fitting.solve import residual_of
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.problem import Problem
from ptt.show.card.telling import telling_of

MOST = 1200  # readings that a picture shows


def rest_of(found: Diagnosis, given: Model, problem: Problem) -> np.ndarray:
    """What a diagnosis leaves of each reading, (n, 3) mm, the frame taken out.

    Args:
        found: the diagnosis.
        given: the model as it was given.
        problem: the readings.
    """
    start = residual_of(given, problem).residual
    moved = _reading(found.model, problem) - _reading(given, problem)
    return level(problem, start - moved)


def fits_of(found: Diagnosis, given: Model, problem: Problem) -> dict[str, Any]:
    """For each step the residual with everything but this effect, and the part of it that the effect explains.

    Args:
        found: the diagnosis.
        given: the model as it was given.
        problem: the readings.

    Returns:
        Effect -> 'telling', 'data_um', 'fit_um', 'rows', 'labels' (of variable and residual), as lists.
    """
    steps = {step[0] for step in found.suggested}
    if not steps:
        return {}
    rest, whole, contexts = rest_of(found, given, problem), _reading(found.model, problem), context_views(problem)
    fits = {}
    for term in found.model.terms:
        if term.effect.key in steps:
            others = replace(found.model, terms=tuple(other for other in found.model.terms if other is not term))
            fit = level(problem, whole - _reading(others, problem))
            fits[term.effect.key] = _fit(term.effect, rest + fit, fit, problem, contexts)
    return fits


def _reading(model: Model, problem: Problem) -> np.ndarray:
    with torch.no_grad():
        return predict([(term.effect, term.theta) for term in model.terms], problem.view).reading.numpy()


def _fit(
    effect: Any, data: np.ndarray, fit: np.ndarray, problem: Problem, contexts: dict[str, np.ndarray]
) -> dict[str, Any]:
    of_data, of_fit = residual_views(problem, data), residual_views(problem, fit)
    card = card_of(effect)
    inner = [name for name in of_fit if name not in "xyz"]
    names = inner if card.residual == "joint" else ["x", "y", "z"]
    name = max(names, key=lambda each: float(np.nanvar(of_fit[each])))
    joint = int(name.split()[1]) - 1 if name in inner else int(np.argmax([np.nanvar(of_fit[each]) for each in inner]))
    variable, label = telling_of(card.telling, joint, problem, contexts)
    serial = problem.file.machine.kind == "serial"
    factor, unit = (1e6, "urad") if serial and name in inner else (1e3, "um")
    rows = np.flatnonzero(np.isfinite(of_data[name]) & np.isfinite(of_fit[name]) & np.isfinite(variable))
    rows = rows[np.unique(np.linspace(0, max(len(rows) - 1, 0), min(MOST, len(rows))).astype(int))]
    return {
        "telling": np.round(variable[rows], 6).tolist(),
        "data_um": np.round(factor * of_data[name][rows], 4).tolist(),
        "fit_um": np.round(factor * of_fit[name][rows], 4).tolist(),
        "rows": rows.tolist(),
        "labels": [label, name, unit],
        "steps": bool(card.telling == "direction"),
    }
