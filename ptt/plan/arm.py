"""D-optimal poses for the geometry of a machine, from those that it can reach or from a list."""

from dataclasses import dataclass

import numpy as np
import torch

from ptt.effects import Library
from ptt.effects.layout import linear_size
from ptt.effects.usual import usual_values
from ptt.errors import InputError
from ptt.fitting.indices import Indices, observability_indices, project_off
from ptt.model.model import Model
from ptt.plan.forecast import beside, columns_of, see_plan
from ptt.plan.selection import select_poses
from ptt.plan.space import Space, draw_poses
from ptt.plan.visits import singles, table_of
from ptt.run.noise import DEFAULT_SIGMA
from ptt.run.table import Table

CHOICE = 8  # candidates drawn for each pose that is chosen
# Effects whose parameters the chosen poses are to determine.
GEOMETRY = {
    "serial": ("dh-offsets",),
    "three-ptt": ("homing-offset", "tower-position", "tower-tilt", "link-length"),
}


@dataclass(frozen=True)
class Selection:
    """Poses chosen from a list.

    Attributes:
        rows: chosen rows of the list, ascending, (count,) int.
        indices: observability indices of the chosen poses.
        drawn: of as many poses taken at random from the list.
        whole: of the whole list.
        effects: keys of the effects that the poses are to determine.
    """

    rows: np.ndarray
    indices: Indices
    drawn: Indices
    whole: Indices
    effects: tuple[str, ...]


def d_optimal_poses(
    model: Model, space: Space, count: int, random: np.random.Generator, known: Library, sigma: float
) -> torch.Tensor:
    """D-optimal poses of an arm for its geometry, from candidates within its limits.

    Args:
        model: the arm.
        space: where it can go.
        count: how many poses.
        random: generator of the candidates.
        known: effects by name.
        sigma: noise of one coordinate, mm.

    Returns:
        (count, k) rad; the first candidates where no geometry effect is known.
    """
    poses = draw_poses(space, CHOICE * count, random)
    if known.get("dh-offsets") is None and "dh-offsets" not in model.keys:
        return poses[:count]
    table = table_of(singles(poses), space, straight=False)
    columns, _ = _columns(model, table, known, sigma)
    return poses[select_poses(columns, count)]


def choose_from(model: Model, candidates: Table, count: int, known: Library, seed: int = 0) -> Selection:
    """Choose D-optimal poses for a machine's geometry from a list.

    Args:
        model: the machine; parameters of its effects are determined beside the geometry.
        candidates: the list.
        count: how many poses.
        known: effects by name.
        seed: of the random choice for comparison.

    Returns:
        The selection.

    Raises:
        InputError: fewer candidates than poses, or no parameter to determine.
    """
    if candidates.rows < count:
        raise InputError(f"{candidates.rows} candidates for {count} poses", where=candidates.source, fix="list more")
    sigma = model.file.tracker.sigma_mm or DEFAULT_SIGMA
    columns, own = _columns(model, candidates, known, sigma)
    chosen = np.sort(select_poses(columns, count))
    random = np.random.default_rng(seed).permutation(len(columns))[:count]
    names = tuple(dict.fromkeys((*model.keys, *_wanted(model, known))))
    every = np.arange(len(columns))
    mine, drawn, whole = (_indices(columns, own, rows) for rows in (chosen, random, every))
    return Selection(chosen, mine, drawn, whole, names)


def _wanted(model: Model, known: Library) -> list[str]:
    told = {term.effect.key for term in model.terms if len(term.theta)}  # these are among the model's own parameters
    return [name for name in GEOMETRY[model.file.machine.kind] if name in known and name not in told]


def _columns(model: Model, table: Table, known: Library, sigma: float) -> tuple[np.ndarray, int]:
    """Derivatives, (n, 3, P) in usual sizes and units of noise, frame and mount last; number of the others."""
    view, _ = see_plan(model, table)
    parts = []
    for name in _wanted(model, known):
        effect = known[name]()
        usual = usual_values(effect, view)[: linear_size(effect, view.joints)]
        parts.append(columns_of(model, effect, view, sigma) * usual.numpy())
    nuisance = beside(model, view, np.ones(view.rows, dtype=bool), sigma)[: 3 * view.rows].reshape(view.rows, 3, -1)
    terms = sum(len(term.theta) for term in model.terms)
    parts.append(nuisance)
    whole = np.concatenate(parts, axis=-1)
    if not whole.shape[-1]:
        raise InputError("nothing to determine", where="[machine]", fix="name a machine with free parameters")
    return whole, whole.shape[-1] - nuisance.shape[-1] + terms


def _indices(columns: np.ndarray, own: int, rows: np.ndarray) -> Indices:
    part = columns[rows].reshape(-1, columns.shape[-1])
    return observability_indices(project_off(part.T @ part, np.arange(own)), len(rows))
