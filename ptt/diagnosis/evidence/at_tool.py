"""What errors and effects come to at the tool, where a set-up that is fitted has taken its share."""

from collections.abc import Iterator

import numpy as np

from ptt.fitting.factor import RANK_TOLERANCE
from ptt.model.chain import predict
from ptt.model.model import Term
from ptt.run.problem import Problem


def off_set_up(error: np.ndarray, problem: Problem) -> np.ndarray:
    """What a rigid motion of each set-up leaves of errors on the rows that count; all where no frame is fitted.

    Args:
        error: of the tool or of its readings, (n, 3) mm.
        problem: n rows.

    Returns:
        (m, 3) mm.
    """
    left, place = error[problem.used].copy(), problem.view.p.numpy()[problem.used]
    for own in _set_ups(problem):
        left[own] -= _rigid_part(left[own], place[own])
    return left


def _rigid_part(moved: np.ndarray, place: np.ndarray) -> np.ndarray:
    """The shift and small turn that suit motions of points best, at each of them: (n, 3) and (n, 3) mm -> (n, 3) mm.

    About the points' middle shift and turn do not mix: the shift is the mean, and the turn w solves J w = sum p x m
    with the points' inertia J. A turn about a line that all of them lie on moves none, and is none.
    """
    shift, arm = moved.mean(axis=0), place - place.mean(axis=0)
    second = arm.T @ arm
    inertia, moment = np.trace(second) * np.eye(3) - second, arm.T @ (moved - shift)
    axial = np.array([moment[1, 2] - moment[2, 1], moment[2, 0] - moment[0, 2], moment[0, 1] - moment[1, 0]])
    turn = np.linalg.pinv(inertia, rcond=RANK_TOLERANCE, hermitian=True) @ axial
    return np.asarray(shift + np.cross(turn, arm))


def _set_ups(problem: Problem) -> Iterator[np.ndarray]:
    """Which of the rows that count are of each set-up, (m,) bool; none where no frame is fitted."""
    if problem.frames:
        frame = problem.frame[problem.used]
        yield from (frame == index for index in np.unique(frame))


def moved_by(term: Term, problem: Problem) -> np.ndarray:
    """How far an effect alone moves the tool as it is read, less what a frame that is fitted takes of it, (m, 3) mm.

    Args:
        term: the effect, at its values.
        problem: the readings, of which m count.
    """
    view = problem.view
    moved = predict([(term.effect, term.theta)], view).reading - predict([], view).reading
    return off_set_up(moved.detach().numpy(), problem)


def at_tool_um(term: Term, problem: Problem) -> float:
    """The same as a root mean square, um."""
    left = moved_by(term, problem)
    return 1e3 * float(np.sqrt(np.square(left).sum(axis=1).mean())) if len(left) else 0.0
