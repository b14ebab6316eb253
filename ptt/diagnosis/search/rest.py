"""Residual tests: what the best explanation leaves must be noise. The mandatory last step before a verdict."""

from dataclasses import dataclass, replace

import numpy as np

from nets import RbfSettings, train_rbf
from ptt.dependence.dependence import Dependence
from ptt.dependence.following import dependence_of
from ptt.dependence.said import by_chance
from ptt.diagnosis.evidence.noise_level import MACHINE_FILE
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System, holds_unknown
from ptt.diagnosis.search.excess import AXIS_EXCESS, NOISE_EXCESS, Objections, beyond_noise, remaining_error
from ptt.diagnosis.search.joint_wander import JointWander, wander_of_joint
from ptt.diagnosis.search.neighbours import off_alike, thin
from ptt.effects.phrases import listed
from ptt.judge.compare.lack_of_fit import lack_of_fit_of
from ptt.run.axes import AXES
from ptt.run.holdout import BLOCKS, blocks, pose_groups, sharing_groups
from ptt.run.means import about_means, group_means
from ptt.run.noise import Noise
from ptt.run.problem import Problem

CHANCE_LACK = 1e-4  # p-value of the lack-of-fit test
CHANCE_FIELD = 1e-4  # p-value at which a network over position predicts held-out residuals
CHANCE_PLACE = 1e-4  # p-value at which neighbours in space are off alike
CHANCE_DEPENDS = 1e-5  # p-value at which a smooth function of a context variable predicts residuals
LIGHT_NETWORK = RbfSettings(centre_counts=(12,), spreads=(1.0, 2.0), ridges=(1e-4, 1e-2), affine=(False,), restarts=1)
FIELD_ROWS = 3000  # rows that the network is trained on at most: a field that these do not show is not worth naming
NETWORK_ROWS = 30  # rows from which the twelve nodes of the network have more than two each
# Held-out parts of a run; with fewer, gains would have to agree within percents to pass `CHANCE_FIELD`
NETWORK_PARTS = 5


@dataclass(frozen=True)
class Rest:
    """Result of the tests of what an explanation leaves.

    Attributes:
        depends_on: what the residual depends on, significant entries only.
        reasons: the tests that object, in words.
        wanders: the joint along which the readings wander; None where none is told.
    """

    depends_on: tuple[Dependence, ...]
    reasons: tuple[str, ...]
    wanders: JointWander | None = None

    @property
    def significant(self) -> bool:
        """Whether any test objects."""
        return bool(self.reasons)

    def objected(self, objections: Objections, left: Noise, stated: Noise | None) -> "Rest":
        """The result with further objections, and with the residual's excess over a stated noise.

        Args:
            objections: to what is named and set aside.
            left: noise that the explanation leaves.
            stated: the stated noise; None for none.

        Returns:
            The result with those reasons.
        """
        reasons = [*self.reasons, *objections.reasons]
        if stated is not None:
            ratios = np.sqrt(np.diag(left.covariance) / np.diag(stated.covariance))
            worst = int(np.argmax(ratios))
            if left.total > NOISE_EXCESS * stated.total:
                reasons.append(beyond_noise("the remaining error", left.total / stated.total, stated.source))
            elif stated.source == MACHINE_FILE and ratios[worst] > AXIS_EXCESS:
                what = f"the remaining error in {AXES[worst]}"
                reasons.append(beyond_noise(what, float(ratios[worst]), stated.source))
        if objections.unexplained_error and not reasons:
            reasons.append(objections.unexplained_error)
        return replace(self, reasons=tuple(reasons))


def look_for_rest(system: System, state: State, problem: Problem) -> Rest:
    """Test the innovations against repeats, against position, and against every context variable.

    Args:
        system: the linearised problem.
        state: the best set.
        problem: n rows.

    Returns:
        The rest.
    """
    left = rest_left(innovations_of(system, state, problem), state, problem.with_noise(system.noise))
    wanders = None if holds_unknown(system, state.keys, state.memory) else wander_of_joint(system, state)
    if wanders is None:
        return left
    moved = f"the readings wander in the way in which {wanders.residual} moves the tool, as no tracker does"
    return replace(left, reasons=(*left.reasons, moved), wanders=wanders)


def rest_left(residual: np.ndarray, state: State, problem: Problem) -> Rest:
    """Test the residuals of some rows.

    Args:
        residual: innovations, (n, 3) mm; NaN on rows left out.
        state: the best set.
        problem: the rows, with the noise.

    Returns:
        The rest.
    """
    if problem.noise is not None and np.nanmean(np.square(residual)) < problem.noise.least:
        return Rest((), ())  # less than the rounding of the readings
    every, residual = residual, _of_visits(residual, state, problem)
    against, lack = "repeats", lack_of_fit_of(problem, residual, round(state.effective_parameters)).p_value
    if lack is None:
        against = "visits to a pose from any side"
        lack = lack_of_fit_of(problem, residual, round(state.effective_parameters), from_any_side=True).p_value
    field = _field(problem, residual)
    place, where = off_alike(problem, residual)
    depends = dependence_of(problem, residual)
    if problem.rounding[1]:
        depends = (*depends, *dependence_of(problem, _about_poses(every, problem)))
    if state.memory.wander is not None:  # a remaining dependence on time is the wander's, which is reported already
        depends = tuple(item for item in depends if item.on not in ("time", "run"))
    reasons = []
    if lack is not None and lack < CHANCE_LACK:
        reasons.append(f"the remaining error exceeds the scatter of {against} ({by_chance(lack)})")
    if field < CHANCE_FIELD:
        reasons.append(
            f"a network over position predicts the remaining error of held-out readings ({by_chance(field)})"
        )
    if place < CHANCE_PLACE:
        near = listed([f"{axis} = {value:.0f}" for axis, value in zip("xyz", where, strict=True)])
        reasons.append(f"neighbouring poses have similar errors, the largest near {near} mm ({by_chance(place)})")
    strong = [item for item in depends if item.p_value < CHANCE_DEPENDS]
    reasons += [
        f"{remaining_error(item.residual)} depends on {item.on} ({by_chance(item.p_value)})" for item in strong[:1]
    ]
    return Rest(depends, tuple(reasons))


def _of_visits(residual: np.ndarray, state: State, problem: Problem) -> np.ndarray:
    """Mean residuals of visits where each visit has a random error: its readings are one independent observation.

    Where commands are rounded, mean residuals of poses, since the rounding error is the same at every visit.

    Args:
        residual: innovations, (n, 3) mm; NaN on rows left out.
        state: the best set.
        problem: the rows.

    Returns:
        (n, 3) mm, the mean of each visit or pose on its first row that counts, NaN on the others; unchanged where
        readings are independent.
    """
    counted = np.isfinite(residual).all(axis=1)
    group, by_visit = sharing_groups(problem.table, counted)
    if problem.rounding[1]:
        group = pose_groups(problem.table)
    elif not (by_visit and state.memory.pose):
        return residual
    rows, means = np.flatnonzero(counted), np.full_like(residual, np.nan)
    first = np.unique(group[rows], return_index=True)[1]
    means[rows[first]] = group_means(residual[rows], group[rows])[1]
    return means


def _about_poses(residual: np.ndarray, problem: Problem) -> np.ndarray:
    """Residuals (n, 3) mm about the mean of their pose, which are free of the rounding of commands."""
    counted, about = np.isfinite(residual).all(axis=1), np.full_like(residual, np.nan)
    about[counted] = about_means(residual[counted], pose_groups(problem.table)[counted])
    return about


def innovations_of(system: System, state: State, problem: Problem) -> np.ndarray:
    """Innovations of the whole explanation, (n, 3) mm; NaN on rows left out."""
    white = system.innovation(state.columns, state.posterior.values, state.memory)
    return system.everywhere(white, problem.table.rows)


def _field(problem: Problem, residual: np.ndarray) -> float:
    """p-value of a small RBF network over position that predicts held-out residuals; 1 where rows are too few."""
    rows = np.flatnonzero(np.isfinite(residual).all(axis=1))
    rows = thin(rows, FIELD_ROWS)
    group = blocks(problem.table, 2 * BLOCKS)[rows]
    if len(rows) < NETWORK_ROWS or len(np.unique(group)) < NETWORK_PARTS:
        return 1.0
    inputs, scatter = problem.view.p.numpy()[rows], np.nanstd(residual[rows], axis=0)
    scatter = np.where(scatter > 0.0, scatter, 1.0)  # an axis that never errs, as across the plane of a flat arm
    trained = train_rbf(inputs, residual[rows] / scatter, group, settings=LIGHT_NETWORK)
    return float(min(1.0, 3.0 * np.min(trained.p_value)))
