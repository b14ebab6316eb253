"""Orientation of an arm's tool: how far it is from the model's, and a fit of positions and orientations together."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ptt.errors import TableError
from ptt.fitting.gauss_newton import descend
from ptt.fitting.layout import Layout
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.fitting.whitened import build_whitened
from ptt.mechanisms.rotations import from_quaternion, rotation_vector
from ptt.mechanisms.serial import Serial
from ptt.model.chain import Prediction, Shifts, differentiate, predict
from ptt.model.model import Model
from ptt.run.frames import rotation
from ptt.run.problem import Problem
from ptt.run.view import View

TRIM = 4.0  # medians beyond which an orientation does not count


@dataclass(frozen=True)
class Orientation:
    """How measured orientations differ from a model's.

    Attributes:
        residual: (n, 3) rad, rotation vector in the base frame from predicted to measured; NaN where not measured.
        target: (3, 3) the tracker's target on the tool, found along: its axes in the tool's frame.
        rows: rows that were measured and are no gross errors, (n,) bool.
    """

    residual: np.ndarray
    target: np.ndarray
    rows: np.ndarray

    @property
    def rms_mrad(self) -> float:
        """Root mean square angle, mrad."""
        return float(np.sqrt(np.square(self.residual[self.rows]).sum(axis=1).mean()) * 1e3)


@dataclass(frozen=True)
class PoseFit:
    """A fit to positions and orientations.

    Attributes:
        model: the model with fitted parameters.
        residual: measured less predicted position in the base frame, (n, 3) mm; NaN where not observed.
        orientation: what is left of the orientations.
        status: 'converged' or what kept it from converging.
    """

    model: Model
    residual: np.ndarray
    orientation: Orientation
    status: str


def orientation_of(fitted: FitResult, problem: Problem) -> Orientation | None:
    """Compare measured orientations with those of a fitted model.

    Args:
        fitted: a fit to the positions.
        problem: the readings.

    Returns:
        The difference; None where the table has no orientations or the machine is no arm.
    """
    measured = _measured(problem)
    if measured is None:
        return None
    return _compare(measured, _predicted(fitted.prediction, problem, fitted.layout, fitted.unknowns), problem.used)


def fit_poses(model: Model, problem: Problem, *, length_mm: float | None = None) -> PoseFit:
    """Fit effects, frame and mount to positions and orientations at once.

    Source: Hui Jizhuang et al. (2016), eqs. 7 and 8: dr and dphi as sums over the links of the partial derivatives.

    Args:
        model: effects without values start at zero.
        problem: the readings, with orientations.
        length_mm: an orientation is weighed like a shift of this length times it; None for the arm's characteristic
            length, at which turns and shifts of the Jacobian are alike in size.

    Returns:
        The fit.

    Raises:
        TableError: no orientations.
    """
    measured = _measured(problem)
    if measured is None:
        raise TableError("no measured orientations", where=problem.table.source, fix="add qx_meas .. qw_meas")
    arm = problem.view.mechanism
    assert isinstance(arm, Serial)
    first = fit(model, problem)
    layout, noise, kept = first.layout, first.noise, problem.used & ~first.outliers
    weight = (length_mm or arm.length_mm) * np.sqrt(3.0) / noise.total
    begun = _compare(measured, _predicted(first.prediction, problem, layout, first.unknowns), kept)
    turned = begun.rows

    def equations(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        residual, jacobian = build_whitened(layout, problem, noise.whitener, unknowns).stacked(kept)
        angle, by_angle = _angles(layout, problem, measured, unknowns, turned)
        pull = first.prior.pull(unknowns)
        normal = jacobian.T @ jacobian + weight**2 * by_angle.T @ by_angle + np.diag(first.prior.weight)
        side = jacobian.T @ residual + weight**2 * by_angle.T @ angle - pull
        return normal, side, float(residual @ residual + weight**2 * angle @ angle + first.prior.cost(unknowns))

    ended = descend(equations, first.unknowns, layout.lower, layout.upper)
    system = build_whitened(layout, problem, noise.whitener, ended.unknowns)
    terms = tuple(
        replace(term, theta=theta, std=None, measured=None)
        for term, theta in zip(layout.terms, layout.thetas(ended.unknowns), strict=True)
    )
    left = _compare(measured, _predicted(system.prediction, problem, layout, ended.unknowns), problem.used)
    place = system.residual @ np.linalg.inv(noise.whitener).T
    return PoseFit(replace(model, terms=terms), place, left, ended.status)


def _measured(problem: Problem) -> Tensor | None:
    """Measured orientations near the base frame, (n, 3, 3)."""
    table = problem.table
    if table.orientation_measured is None or not isinstance(problem.view.mechanism, Serial):
        return None
    rotations = from_quaternion(torch.as_tensor(np.asarray(table.orientation_measured, dtype=float)))
    return torch.as_tensor(problem.rotation[problem.frame]).mT @ rotations


def _predicted(prediction: Prediction, problem: Problem, layout: Layout, unknowns: np.ndarray) -> Tensor:
    """Orientations of the last link that a model predicts, in the frame of the readings, (n, 3, 3)."""
    arm = problem.view.mechanism
    assert isinstance(arm, Serial)
    turn = arm.pose(prediction.q, prediction.geometry)[1]
    if not layout.frames:
        return turn
    return rotation(layout.frame_parameters(unknowns)[:, 3:])[0][torch.as_tensor(problem.frame)] @ turn


def _compare(measured: Tensor, predicted: Tensor, used: np.ndarray) -> Orientation:
    """Take out how the target sits on the tool, gross errors left aside, and compare."""
    rows = used & np.isfinite(measured.numpy()).all(axis=(1, 2))
    relative = (predicted.mT @ torch.nan_to_num(measured)).numpy()
    kept = rows
    for _ in range(3):
        left, _, right = np.linalg.svd(relative[kept].sum(axis=0))
        target = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        angle = rotation_vector(measured @ (predicted @ torch.as_tensor(target)).mT).numpy()
        size = np.linalg.norm(angle, axis=1)
        kept = rows & (np.nan_to_num(size, nan=np.inf) <= TRIM * np.median(size[rows]))
    return Orientation(np.where(rows[:, None], angle, np.nan), target, kept)


def _angles(
    layout: Layout, problem: Problem, measured: Tensor, unknowns: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Orientation residual (3 m,) and its derivative (3 m, u), the target's place on the tool projected off."""
    terms = [(term.effect, theta) for term, theta in zip(layout.terms, layout.thetas(unknowns), strict=True)]
    view = layout.see(problem, unknowns)
    prediction = predict(terms, view)
    predicted = _predicted(prediction, problem, layout, unknowns)
    turn = torch.eye(3, dtype=torch.float64)[None]
    if layout.frames:
        turn = rotation(layout.frame_parameters(unknowns)[:, 3:])[0][torch.as_tensor(problem.frame)]
    machine = (turn @ _turn_columns(terms, view, prediction))[..., torch.as_tensor(layout.columns())]
    whole = np.zeros((view.rows, 3, len(unknowns)))
    whole[..., : machine.shape[-1]] = machine.numpy()
    for index in range(layout.frames):
        place = len(unknowns) - 6 * (layout.frames - index) + 3
        whole[:, :, place : place + 3] = np.where((problem.frame == index)[:, None, None], np.eye(3), 0.0)
    whole *= layout.scale
    found = _compare(measured, predicted, rows)
    axes = (predicted @ torch.as_tensor(found.target)).numpy()[rows].reshape(-1, 3)
    columns = whole[rows].reshape(-1, len(unknowns))
    count = float(rows.sum())  # each row's axes are orthonormal, so the projection needs no inverse
    columns = columns - axes @ (axes.T @ columns) / count
    return found.residual[rows].reshape(-1), columns


def _turn_columns(terms: Shifts, view: View, prediction: Prediction) -> Tensor:
    """Derivative of the tool's rotation vector by all effect parameters, (n, 3, P) rad per unit."""
    arm = view.mechanism
    assert isinstance(arm, Serial)
    by_joint = arm.pose_jacobian(prediction.q, prediction.geometry)[..., 3:, :]
    by_slot = arm.geometry_jacobian(prediction.q, prediction.geometry)[..., 3:, :]
    at_joints, blocks = view.at(q=prediction.q), [by_slot.new_zeros(view.rows, 3, 0)]
    for effect, theta in terms:
        if effect.stage == "drive":
            blocks.append(by_joint @ differentiate(effect, theta, view)[1])
        elif effect.stage == "geometry":
            blocks.append(by_slot @ differentiate(effect, theta, at_joints)[1])
        else:
            blocks.append(by_slot.new_zeros(view.rows, 3, len(theta)))
    return torch.cat(blocks, dim=-1)
