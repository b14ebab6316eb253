"""D-optimal poses for the geometry of a machine, from those that it can reach or from a list."""

from dataclasses import dataclass

import numpy as np
import torch

from ptt.effects import Library
from ptt.effects.layout import linear_size
from ptt.effects.usual import usual_values
from ptt.errors import InputError
from ptt.fitting.indices import Indices, observability_indices, project_off
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.workspace import OK, reach
from ptt.model.model import Model
from ptt.plan.forecast import beside, columns_of, see_plan
from ptt.plan.selection import select_poses
from ptt.plan.space import Space, draw_poses
from ptt.plan.visits import singles, table_of
from ptt.run.noise import DEFAULT_SIGMA
from ptt.run.table import Table, take_rows
from ptt.run.target_frame import in_base, target_frames

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
        whole: of all rows of the list that can be driven.
        left_aside: number of poses of the list that cannot: out of reach or travel, or near a singularity.
        effects: keys of the effects that the poses are to determine.
    """

    rows: np.ndarray
    indices: Indices
    drawn: Indices
    whole: Indices
    left_aside: int
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
        InputError: no pose is asked for, fewer can be driven, or there is no parameter to determine.
    """
    if count < 1:
        raise InputError(f"{count} poses cannot be chosen", where=candidates.source, fix="ask for 1 or more")
    table = in_base(candidates, target_frames(model.file, candidates))
    there, poses = _driven(model.file, table), int((candidates.role != "base").sum())
    if len(there) < count:
        some = "" if len(there) == poses else f", of {poses} in the list"
        what = f"{len(there)} poses that can be driven{some}: too few to choose {count} from"
        fix = "list more" if not some else "list more; `ptt predict` says why the others cannot"
        raise InputError(what, where=candidates.source, fix=fix)
    sigma = model.file.tracker.sigma_mm or DEFAULT_SIGMA
    columns, own = _columns(model, take_rows(table, there), known, sigma)
    chosen = np.sort(select_poses(columns, count))
    random = np.random.default_rng(seed).permutation(len(columns))[:count]
    names = tuple(dict.fromkeys((*model.keys, *_wanted(model, known))))
    every = np.arange(len(columns))
    mine, drawn, whole = (_indices(columns, own, rows) for rows in (chosen, random, every))
    return Selection(there[chosen], mine, drawn, whole, poses - len(there), names)


def _driven(file: MachineFile, table: Table) -> np.ndarray:
    """Rows of a list, with targets in the base frame, whose poses the machine can be sent to, (m,) int."""
    mechanism = build_mechanism(file.machine)
    place = torch.tensor(table.target)
    q = torch.full((table.rows, mechanism.joints), torch.nan, dtype=torch.float64)
    q = q if table.command is None else torch.tensor(table.command)
    q = torch.where(torch.isfinite(q).all(dim=1)[:, None], q, mechanism.inverse(place))
    return np.flatnonzero((reach(mechanism, mechanism.forward(q), q) == OK) & (table.role != "base"))


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
