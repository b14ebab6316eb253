"""This run's data with the fit of one effect through it: what the residual is without the effect, and what it takes."""

from dataclasses import replace
from typing import Any

import numpy as np
import torch

from ptt.dependence.contexts import remove_frame, residual_views
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import Effect
from ptt.effects.cards import card_of
from ptt.fitting.solve import residual_of
from ptt.model.chain import Prediction, predict
from ptt.model.model import Model
from ptt.run.problem import Problem
from ptt.show.card.telling import telling_of
from ptt.show.sizing import spread

LEVER = 0.5  # of the usual one, below which an arm's pose tells little of a joint
MOST_READINGS = 1200  # that a picture shows


def rest_of(found: Diagnosis, given: Model, problem: Problem) -> np.ndarray:
    """What a diagnosis leaves of each reading, (n, 3) mm, the frame taken out.

    Args:
        found: the diagnosis.
        given: the model as it was given.
        problem: the readings.
    """
    start = residual_of(given, problem).residual
    moved = (_chain(found.model, problem).reading - _chain(given, problem).reading).numpy()
    return remove_frame(problem, start - moved)


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
    rest, whole = rest_of(found, given, problem), _chain(found.model, problem)
    fits = {}
    for term in found.model.terms:
        if term.effect.key in steps:
            others = replace(found.model, terms=tuple(other for other in found.model.terms if other is not term))
            less, joint = _chain(others, problem), None
            moved = (whole.reading - less.reading).numpy()
            if term.effect.stage == "drive":
                joint, moved = _foremost(problem, (whole.q - less.q).numpy())
            fit = remove_frame(problem, moved)
            fits[term.effect.key] = _fit(term.effect, rest + fit, fit, problem, joint)
    return fits


def _foremost(problem: Problem, shift: np.ndarray) -> tuple[int, np.ndarray]:
    """The joint that moves the tool most by its own error, and that motion alone.

    An arm's joints move the tool in much the same ways, so that one would show the other's error beside its own.

    Args:
        problem: n rows.
        shift: (n, k) mm or rad, of each joint.

    Returns:
        Its number from 0, and (n, 3) mm.
    """
    jacobian = problem.view.jacobian.numpy()
    size = [float(np.nanmean(np.square(shift[:, i : i + 1] * jacobian[:, :, i]))) for i in range(shift.shape[1])]
    joint = int(np.argmax(size))
    return joint, shift[:, joint : joint + 1] * jacobian[:, :, joint]


def _chain(model: Model, problem: Problem) -> Prediction:
    with torch.no_grad():
        return predict([(term.effect, term.theta) for term in model.terms], problem.view)


def _fit(effect: Effect, data: np.ndarray, fit: np.ndarray, problem: Problem, joint: int | None) -> dict[str, Any]:
    card, serial = card_of(effect), problem.file.machine.kind == "serial"
    name, joint = _shown(residual_views(problem, fit), card.residual, joint)
    inner = name not in "xyz"
    of_data, of_fit = (_seen(problem, each, name, joint, serial and inner) for each in (data, fit))
    variable, label = telling_of(card.telling, joint, problem)
    factor, unit = (1e6, "urad") if serial and inner else (1e3, "um")
    rows = np.flatnonzero(np.isfinite(of_data) & np.isfinite(of_fit) & np.isfinite(variable))
    rows = rows[spread(len(rows), MOST_READINGS)]
    return {
        "telling": np.round(variable[rows], 6).tolist(),
        "data_um": np.round(factor * of_data[rows], 4).tolist(),
        "fit_um": np.round(factor * of_fit[rows], 4).tolist(),
        "rows": rows.tolist(),
        "labels": [label, name, unit],
        "steps": card.telling == "direction",
    }


def _shown(views: dict[str, np.ndarray], residual: str, joint: int | None) -> tuple[str, int]:
    """The component of the residual that is drawn, and the joint whose variable it is drawn against, from 0."""
    inner = [name for name in views if name not in "xyz"]
    names = ["x", "y", "z"] if residual != "joint" else inner if joint is None else [inner[joint]]
    name = max(names, key=lambda each: float(np.nanvar(views[each])))
    return name, inner.index(name) if name in inner else int(np.argmax([np.nanvar(views[each]) for each in inner]))


def _seen(problem: Problem, residual: np.ndarray, name: str, joint: int, lone: bool) -> np.ndarray:
    """One component of a residual, (n,) mm or rad; on an arm what its joint alone would have to be off by.

    Poses that give a joint a short lever tell little of it, and their noise would fill the picture: they are NaN.
    """
    if not lone:
        return residual_views(problem, residual)[name]
    column = problem.view.jacobian.numpy()[:, :, joint]
    lever = np.linalg.norm(column, axis=1)
    error = np.einsum("nc,nc->n", column, residual) / np.maximum(lever, 1e-9) ** 2
    return np.where(problem.used & (lever >= LEVER * np.median(lever)), error, np.nan)
