"""Reach: values with which the machine could not have stood where it was commanded to are refused."""

from collections.abc import Sequence

import numpy as np

from ptt.effects.phrases import listed
from ptt.errors import PosesError
from ptt.model.model import Term
from ptt.run.problem import Problem


def require_reach(stood: np.ndarray, terms: Sequence[Term], problem: Problem) -> None:
    """Refuse values with which the machine could not have stood where it was commanded to: nothing follows from them.

    Args:
        stood: rows at which it could, (n,) bool.
        terms: the effects; those without values are left aside.
        problem: n rows.

    Raises:
        PosesError: there are such rows.
    """
    lost = np.flatnonzero(problem.used & ~stood)
    if not len(lost):
        return
    values = listed([term.effect.key for term in terms if len(term.theta)]) or "the drawing"
    more = f" and {len(lost) - 1} more" if len(lost) > 1 else ""
    raise PosesError(
        f"{problem.table.place(int(lost[0]))}{more}: with the values that the readings ask of {values}, the machine "
        "cannot stand where it was commanded to; look for readings far off (ptt compare) or columns in another unit"
    )
