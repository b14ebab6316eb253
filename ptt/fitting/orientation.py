"""Orientation of an arm's tool: how far measured ones are from a model's."""

import numpy as np
import torch
from torch import Tensor

from ptt.fitting.result import FitResult
from ptt.mechanisms.rotations import from_quaternion, rotation_vector
from ptt.mechanisms.serial import Serial
from ptt.run.axes import rms_length
from ptt.run.frames import rotation
from ptt.run.problem import Problem

TRIM_MEDIANS = 4.0  # medians of the angle beyond which an orientation is a gross error


def orientation_rms(fitted: FitResult, problem: Problem) -> float | None:
    """Compare measured orientations with those of a fitted model, how the target sits on the tool taken out.

    Args:
        fitted: a fit to the positions.
        problem: the readings.

    Returns:
        Root mean square angle, mrad; None where the machine is no arm or no reading of a position has one.
    """
    arm, table = problem.view.mechanism, problem.table
    if table.orientation_measured is None or not isinstance(arm, Serial):
        return None
    rotations = from_quaternion(torch.as_tensor(np.asarray(table.orientation_measured, dtype=float)))
    measured = torch.as_tensor(problem.rotation[problem.frame]).mT @ rotations  # shape: (n, 3, 3)
    predicted = arm.pose(fitted.prediction.q, fitted.prediction.geometry)[1]
    if fitted.layout.frames:
        turns = rotation(fitted.layout.frame_parameters(fitted.unknowns)[:, 3:])[0]
        predicted = turns[torch.as_tensor(problem.frame)] @ predicted
    return _rms_mrad(measured, predicted, problem.used)


def _rms_mrad(measured: Tensor, predicted: Tensor, used: np.ndarray) -> float | None:
    """Root mean square angle between orientations, gross errors left aside."""
    rows = used & np.isfinite(measured.numpy()).all(axis=(1, 2))
    if not rows.any():
        return None
    relative = (predicted.mT @ torch.nan_to_num(measured)).numpy()
    kept = rows
    for _ in range(3):
        left, _, right = np.linalg.svd(relative[kept].sum(axis=0))
        target = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        angle = rotation_vector(measured @ (predicted @ torch.as_tensor(target)).mT).numpy()
        size = np.linalg.norm(angle, axis=1)
        kept = rows & (np.nan_to_num(size, nan=np.inf) <= TRIM_MEDIANS * np.median(size[rows]))
    return 1e3 * rms_length(angle[kept])
