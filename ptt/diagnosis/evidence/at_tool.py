"""What errors and effects come to at the tool, where a set-up that is fitted has taken its share."""

from collections.abc import Iterator

import numpy as np

from ptt.model.chain import predict
from ptt.model.model import Term
from ptt.run.frames import rigid_columns
from ptt.run.problem import Problem


def off_set_up(error: np.ndarray, problem: Problem) -> np.ndarray:
    """What a rigid motion of each set-up leaves of errors on the rows that count; all where no frame is fitted.

    Args:
        error: of the tool or of its readings, (n, 3) mm.
        problem: n rows.

    Returns:
        (m, 3) mm.
    """
    left, place = error[problem.used].copy(), rigid_columns(problem.view.p).numpy()[problem.used]
    for own in _set_ups(problem):
        columns = place[own].reshape(-1, 6)
        left[own] -= (columns @ np.linalg.lstsq(columns, left[own].ravel(), rcond=None)[0]).reshape(-1, 3)
    return left


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
