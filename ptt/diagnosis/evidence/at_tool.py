"""Size of errors and effects at the tool, after the rigid motion that a fitted tracker frame takes of them."""

import numpy as np

from ptt.model.chain import predict
from ptt.model.model import Term
from ptt.run.axes import rms_length
from ptt.run.frames import without_rigid_parts
from ptt.run.problem import Problem


def without_rigid_motion(error: np.ndarray, problem: Problem) -> np.ndarray:
    """Errors on the rows that count, less the best-fitting small rigid motion of each frame that is fitted.

    Args:
        error: of the tool or of its readings, (n, 3) mm.
        problem: n rows, of which m count.

    Returns:
        (m, 3) mm; unchanged where no frame is fitted.
    """
    left, place = error[problem.used], problem.view.p.numpy()[problem.used]
    return without_rigid_parts(left, place, problem.frame[problem.used]) if problem.frames else left


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
    return 1e3 * rms_length(left) if len(left) else 0.0
