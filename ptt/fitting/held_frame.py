"""What frames that base reflectors hold leave open of a fit: their readings scatter as well."""

from dataclasses import replace

import numpy as np

from ptt.fitting.chunks import LONG
from ptt.fitting.factor import inverse
from ptt.fitting.layout import lay_out
from ptt.fitting.long import LongEvaluator
from ptt.fitting.result import FitResult
from ptt.fitting.stated import fitted_terms
from ptt.fitting.whitened import Evaluator
from ptt.run.problem import Problem


def with_frame_doubt(fitted: FitResult, problem: Problem) -> FitResult:
    """A fit whose frames stood where base reflectors put them, its errors with those of the frames.

    The unknowns u of a fit beside held frames f move with these by -(X^T X + W)^-1 X^T F, X and F being the columns of
    both and W the weight of the prior; and the reflectors B tell the frames no better than (B^T B + 1)^-1, in usual
    sizes, for some in one line leave a turn about it open. The tool goes with the unknowns alone: where these make good
    for a frame that is off, it stands off the base as the frame does, and the next registration shows that.

    Args:
        fitted: found with the frames held.
        problem: the same readings with the reflectors.

    Returns:
        The fit; as given where there are no reflectors.
    """
    if problem.base is None or not len(fitted.unknowns):
        return fitted
    layout = lay_out(fitted.model, problem, fitted.layout.terms)
    evaluate = (LongEvaluator if problem.table.rows > LONG else Evaluator)(layout, problem, fitted.noise)
    system, kept = evaluate(np.append(fitted.unknowns, np.zeros(6 * problem.frames))), problem.used & ~fitted.outliers
    base = system.sums(np.zeros_like(kept))[0]
    rows, count = system.sums(kept)[0] - base, len(fitted.unknowns)
    moved = np.linalg.solve(rows[:count, :count] + np.diag(fitted.prior.weight), rows[:count, count:])
    spread = inverse(base[count:, count:] + np.eye(6 * problem.frames))
    result = replace(fitted, doubt=moved @ np.linalg.cholesky(spread))
    return replace(result, model=replace(result.model, terms=fitted_terms(result)))
