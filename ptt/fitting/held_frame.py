"""Uncertainty of a fit by frames that base reflectors held, since readings of these scatter as well."""

from dataclasses import replace

import numpy as np

from ptt.fitting.chunks import LONG
from ptt.fitting.factor import inverse
from ptt.fitting.layout import lay_out
from ptt.fitting.long import LongEvaluator
from ptt.fitting.result import FitResult
from ptt.fitting.solve import with_rounds_beside
from ptt.fitting.stated import with_fitted_terms
from ptt.fitting.whitened import Evaluator
from ptt.run.problem import Problem


def with_frame_doubt(fitted: FitResult, problem: Problem) -> FitResult:
    """Add the uncertainty of held frames to a fit, as its `doubt`.

    The fitted unknowns u depend on the held frames f by -(X^T X + W)^-1 X^T F, where X and F are the columns of both
    and W is the prior precision. The covariance of the frames is (B^T B + 1)^-1 in usual sizes, with the columns B of
    the reflectors' readings, whose rounds scatter by what the fit leaves of them; the prior keeps it finite where
    reflectors in one line leave a rotation open. The tool position depends on the unknowns alone: where these
    compensate an error of the frame, the tool is off the base by as much, as the next registration will show.

    Args:
        fitted: found with the frames held.
        problem: the same readings with the reflectors.

    Returns:
        The fit; as given where there are no reflectors.
    """
    if problem.base is None or not len(fitted.unknowns):
        return fitted
    problem = with_rounds_beside(fitted.model, problem)
    layout = lay_out(fitted.model, problem, fitted.layout.terms)
    evaluate = (LongEvaluator if problem.table.rows > LONG else Evaluator)(layout, problem, fitted.noise)
    system, kept = evaluate(np.append(fitted.unknowns, np.zeros(6 * problem.frames))), problem.used & ~fitted.outliers
    base = system.sums(np.zeros_like(kept))[0]
    rows, count = system.sums(kept)[0] - base, len(fitted.unknowns)
    moved = np.linalg.solve(rows[:count, :count] + np.diag(fitted.prior.weight), rows[:count, count:])
    spread = inverse(base[count:, count:] + np.eye(6 * problem.frames))
    return with_fitted_terms(replace(fitted, doubt=moved @ np.linalg.cholesky(spread)))
