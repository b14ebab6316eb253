"""Component-plus-residual plots of effects: the run's residual without one effect, and the part that it explains."""

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
from ptt.show.sizing import spread
from ptt.show.telling import telling_of

LEVER = 0.5  # share of a joint's median lever arm below which a pose of an arm says too little of the joint to be shown
MOST_READINGS = 1200  # shown in a picture


def rest_of(found: Diagnosis, given: Model, problem: Problem) -> np.ndarray:
    """Residual of each reading with the model that a diagnosis suggests, the frame fitted, (n, 3) mm.

    Args:
        found: the diagnosis.
        given: the model as it was given.
        problem: the readings.
    """
    start = residual_of(given, problem).residual
    moved = (_chain(found.model, problem).reading - _chain(given, problem).reading).numpy()
    return remove_frame(problem, start - moved)


def fits_of(found: Diagnosis, given: Model, problem: Problem) -> dict[str, Any]:
    """For each suggested effect the residual without it (all others kept), and the part of that which it explains.

    Args:
        found: the diagnosis.
        given: the model as it was given.
        problem: the readings.

    Returns:
        Effect -> 'telling' (its telling variable), 'data_um' (residual without it), 'fit_um' (its part) and 'rows',
        (m,) each as lists; 'labels': of the variable's axis, of the residual's component, and the unit of both
        residuals (um or urad); 'steps': whether the variable is a direction of arrival.
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
    """The joint whose own error moves the tool most, and that motion alone.

    An arm's joints move the tool in similar directions: with all of them, the error of one would show on another.

    Args:
        problem: n rows.
        shift: error of each joint, (n, k) mm or rad.

    Returns:
        Number of the joint from 0, and the motion of the tool, (n, 3) mm.
    """
    jacobian = problem.view.jacobian.numpy()
    size = [float(np.nanmean(np.square(shift[:, i : i + 1] * jacobian[:, :, i]))) for i in range(shift.shape[1])]
    joint = int(np.argmax(size))
    return joint, shift[:, joint : joint + 1] * jacobian[:, :, joint]


def _chain(model: Model, problem: Problem) -> Prediction:
    """The model's prediction of all rows in the base frame."""
    with torch.no_grad():
        return predict([(term.effect, term.theta) for term in model.terms], problem.view)


def _fit(effect: Effect, data: np.ndarray, fit: np.ndarray, problem: Problem, joint: int | None) -> dict[str, Any]:
    card, serial = card_of(effect), problem.file.machine.kind == "serial"
    name, joint = _shown(residual_views(problem, fit), card.residual, joint)
    inner = name not in "xyz"
    of_data, of_fit = (_seen(problem, each, name, joint, serial and inner) for each in (data, fit))
    variable, label = telling_of(card.telling, problem.view, joint)
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
    """The component of the residual to draw (that of largest variance), and the joint of the variable, from 0."""
    inner = [name for name in views if name not in "xyz"]
    names = ["x", "y", "z"] if residual != "joint" else inner if joint is None else [inner[joint]]
    name = max(names, key=lambda each: float(np.nanvar(views[each])))
    return name, inner.index(name) if name in inner else int(np.argmax([np.nanvar(views[each]) for each in inner]))


def _seen(problem: Problem, residual: np.ndarray, name: str, joint: int, lone: bool) -> np.ndarray:
    """One component of a residual, (n,) mm or rad; where `lone`, the error of this joint alone that fits it best.

    In the latter case poses that give the joint a short lever arm are NaN: their noise would fill the picture.
    """
    if not lone:
        return residual_views(problem, residual)[name]
    column = problem.view.jacobian.numpy()[:, :, joint]
    lever = np.linalg.norm(column, axis=1)
    error = np.einsum("nc,nc->n", column, residual) / np.maximum(lever, 1e-9) ** 2
    return np.where(problem.used & (lever >= LEVER * np.median(lever)), error, np.nan)
