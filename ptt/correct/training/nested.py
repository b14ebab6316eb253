"""Nested hold-out of physics and network: neither fit nor choice of settings uses the rows that are judged."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from nets import RbfSettings, RbfTraining
from ptt.correct.training.physics import fit_physics, keep_physics
from ptt.correct.training.protocols import Protocol
from ptt.correct.training.rest import Space, inputs_of, learn_rest, step_of
from ptt.fitting.chunks import LONG
from ptt.fitting.long import held_out_residual
from ptt.fitting.result import sound_rows
from ptt.fitting.solve import hold_to_base
from ptt.model.model import Model
from ptt.progress import Progress
from ptt.run.axes import rms
from ptt.run.holdout import pose_groups
from ptt.run.problem import Problem

Figures = dict[str, float]


@dataclass(frozen=True)
class HeldOut:
    """Errors of rows that neither physics nor network had seen, NaN elsewhere.

    Attributes:
        given: residual of the model with the parameters it came with, (n, 3) mm.
        physics: residual of the refitted model, (n, 3) mm.
        whole: residual with the network, (n, 3) mm; of several networks, the one that the other rows choose.
        by_space: residual with the network of each kind of inputs, (n, 3) mm.
        rows: the rows that count, (n,) bool.
    """

    given: np.ndarray
    physics: np.ndarray
    whole: np.ndarray
    by_space: dict[Space, np.ndarray]
    rows: np.ndarray

    def rms_um(self) -> dict[str, Figures]:
        """Root mean square per axis and in total, um, for 'given', 'physics' and 'rbf'."""
        return {
            "given": rms(self.given, self.rows),
            "physics": rms(self.physics, self.rows),
            "rbf": rms(self.whole, self.rows),
        }

    def kept(self) -> np.ndarray:
        """Axes on which the network reduces the error, (3,) bool."""
        left, given = np.square(self.whole[self.rows]).sum(axis=0), np.square(self.physics[self.rows]).sum(axis=0)
        return np.asarray(left < given)

    def without(self, axes: np.ndarray) -> "HeldOut":
        """Errors of a network that does not correct some axes, (3,) bool."""
        return replace(self, whole=np.where(axes, self.physics, self.whole))

    def spaces_um(self) -> dict[str, float]:
        """Total rms of the network of each kind of inputs, um."""
        return {space: rms(residual, self.rows)["total"] for space, residual in self.by_space.items()}


def hold_out(
    model: Model,
    problem: Problem,
    protocol: Protocol,
    networks: Mapping[Space, RbfTraining],
    settings: RbfSettings | None = None,
    progress: Progress | None = None,
) -> HeldOut:
    """Errors of rows that were hidden from physics and network.

    Number of nodes, width, linear part, each axis' penalty and the inputs are chosen again by cross-validation within
    the rows that are left: rows that took part in the choice would make the error look smaller.

    Args:
        model: effects to be refitted without the hidden rows.
        problem: the readings.
        protocol: which rows are hidden.
        networks: trained on all rows, by the kind of their inputs; they tell which axes are learned. Empty for
            physics alone.
        settings: candidates and rules of the network.
        progress: told what is done, how much of how much.

    Returns:
        The errors.
    """
    problem = hold_to_base(model, problem)
    given = keep_physics(model, problem)
    physics, rows = np.full((problem.table.rows, 3), np.nan), sound_rows(problem, given)
    if not networks and model.terms and problem.table.rows > LONG:
        physics = _one_step_residual(model, problem, protocol)
        return HeldOut(given.residual, physics, physics, {}, rows & np.isfinite(physics).all(axis=1))
    by_space: dict[Space, np.ndarray] = {space: physics.copy() for space in networks}
    whole = physics.copy()
    for number, hidden in enumerate(protocol.folds):
        if progress is not None:
            progress("held-out", number, len(protocol.folds))
        rest = problem.masked(hidden)
        part, seen = fit_physics(model, rest, lean=True), hidden & rows
        physics[seen] = whole[seen] = part.residual[seen]
        again = {
            space: learn_rest(rest, part, sound_rows(rest, part), _groups(protocol, rest), settings, space)
            for space, network in networks.items()
            if network.learned.any()
        }
        for space, network in networks.items():
            by_space[space][seen] = part.residual[seen]
            if space in again:
                place = inputs_of(problem, space)[seen]
                by_space[space][seen] += np.where(network.learned, step_of(again[space].network, place), 0.0)
        if networks:
            whole[seen] = by_space[better_space({space: again.get(space, networks[space]) for space in networks})][seen]
    scored = rows & np.isfinite(whole).all(axis=1)
    return HeldOut(given.residual, physics, whole, by_space, scored)


def _one_step_residual(model: Model, problem: Problem, protocol: Protocol) -> np.ndarray:
    """Residual of the hidden rows of a long run, (n, 3) mm; NaN elsewhere.

    With so many rows the fit without one part is within one Gauss-Newton step of the fit of all rows, and each refit
    would cost as much as the fit of all.
    """
    whole = fit_physics(model, problem, lean=True).fitted
    assert whole is not None
    shown = np.any(protocol.folds, axis=0)
    return np.where(shown[:, None], held_out_residual(whole, problem, protocol.folds), np.nan)


def better_space(networks: Mapping[Space, RbfTraining]) -> Space:
    """Inputs whose network has the least cross-validation error."""
    return min(networks, key=lambda space: float(np.square(networks[space].heldout_rms).sum()))


def _groups(protocol: Protocol, rest: Problem) -> np.ndarray:
    """Groups for the inner choice: blocks, or poses where only one block is left."""
    left = np.unique(protocol.groups[rest.used])
    return protocol.groups if len(left) > 1 else pose_groups(rest.table)
