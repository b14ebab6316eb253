"""Size of errors and effects at the tool, after the rigid motion that a fitted tracker frame takes of them."""

from collections.abc import Iterator

import numpy as np

from ptt.fitting.factor import RANK_TOLERANCE
from ptt.model.chain import predict
from ptt.model.model import Term
from ptt.run.problem import Problem


def without_rigid_motion(error: np.ndarray, problem: Problem) -> np.ndarray:
    """Errors on the rows that count, less the best-fitting small rigid motion of each frame that is fitted.

    Args:
        error: of the tool or of its readings, (n, 3) mm.
        problem: n rows, of which m count.

    Returns:
        (m, 3) mm; unchanged where no frame is fitted.
    """
    left, place = error[problem.used].copy(), problem.view.p.numpy()[problem.used]
    for own in _set_ups(problem):
        left[own] -= _rigid_part(left[own], place[own])
    return left


def _rigid_part(moved: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Least-squares small rigid motion of points at `place` (n, 3) mm that moved by `moved` (n, 3) mm: (n, 3) mm.

    About the centroid shift and rotation decouple: the shift is the mean motion, and the rotation w solves
    J w = sum p x m with the inertia J of the points p and their motions m. A rotation about a line on which all points
    lie is set to zero.
    """
    shift, arm = moved.mean(axis=0), place - place.mean(axis=0)
    second = arm.T @ arm
    inertia, moment = np.trace(second) * np.eye(3) - second, arm.T @ (moved - shift)
    axial = np.array([moment[1, 2] - moment[2, 1], moment[2, 0] - moment[0, 2], moment[0, 1] - moment[1, 0]])
    turn = np.linalg.pinv(inertia, rcond=RANK_TOLERANCE, hermitian=True) @ axial
    return np.asarray(shift + np.cross(turn, arm))


def _set_ups(problem: Problem) -> Iterator[np.ndarray]:
    """For each fitted frame, which of the rows that count are in it, (m,) bool; none where no frame is fitted."""
    if problem.frames:
        frame = problem.frame[problem.used]
        yield from (frame == index for index in np.unique(frame))


def moved_by(term: Term, problem: Problem) -> np.ndarray:
    """Shift of the readings by an effect alone, less what a fitted frame takes of it, (m, 3) mm.

    Args:
        term: the effect, at its values.
        problem: the readings, of which m count.
    """
    view = problem.view
    moved = predict([(term.effect, term.theta)], view).reading - predict([], view).reading
    return without_rigid_motion(moved.detach().numpy(), problem)


def at_tool_um(term: Term, problem: Problem) -> float:
    """Root mean square length of `moved_by`, um."""
    left = moved_by(term, problem)
    return 1e3 * float(np.sqrt(np.square(left).sum(axis=1).mean())) if len(left) else 0.0
