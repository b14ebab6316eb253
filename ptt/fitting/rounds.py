"""Rounds of a fit: learn prior variances, fit, leave out gross errors, until nothing changes."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from ptt.fitting.gauss_newton import HOPELESS, TOLERANCE, descend
from ptt.fitting.layout import Layout
from ptt.fitting.prior import Prior, learn_prior
from ptt.fitting.whitened import Total
from ptt.run.noise import Noise

MOST_ROUNDS = 3  # rounds of leaving out gross errors, learning variances anew and fitting again
SETTLED_VARIANCES = 0.1  # change of a log variance below which it counts as settled


class RowSums(Protocol):
    """Sums of the chosen rows at a point, however the rows are stored."""

    @property
    def total(self) -> Total:
        """J^T J, J^T r, r^T r and the number of coordinates of the rows that count."""
        ...

    @property
    def design_effect(self) -> float:
        """Design effect: how many of them count as one."""
        ...

    @property
    def sifted(self) -> np.ndarray:
        """The choice without gross errors, decided anew for all rows."""
        ...


Rows = Callable[
    [np.ndarray, np.ndarray], RowSums
]  # unknowns and a choice of rows, which the rows alone know how to read


@dataclass(frozen=True)
class Settled:
    """Where the rounds ended.

    Attributes:
        unknowns: (u,) in usual sizes.
        prior: under which they were fitted.
        choice: rows that counted.
        status: 'converged', what kept the last fit from it, or that there was nothing to fit.
    """

    unknowns: np.ndarray
    prior: Prior
    choice: np.ndarray
    status: str


def settle(
    rows: Rows, layout: Layout, noise: Noise, start: np.ndarray, choice: np.ndarray, prior: Prior,
    done: float = TOLERANCE, hopeless: float = np.inf,
) -> Settled:  # fmt: skip
    """Fit to some rows, learning prior variances and finding gross errors on the way.

    Args:
        rows: the rows.
        layout: the unknowns.
        noise: that whitened the rows.
        start: (u,) in usual sizes.
        choice: rows that count at first.
        prior: to start from.
        done: decrease of chi-squared still to be had at which a fit ends.
        hopeless: chi-squared, prior and all, above which all ends where it is.

    Returns:
        Where it ended.
    """
    unknowns, status, settled, design_effect = start, "nothing to fit", False, 1.0
    for attempt in range(1 + MOST_ROUNDS):
        if attempt:  # residuals before the first fit are smooth for want of a model
            design_effect = rows(unknowns, choice).design_effect
        before, prior = prior, learn_prior(rows(unknowns, choice).total, layout, unknowns, noise, prior, design_effect)
        if settled and _near(before, prior):
            prior = before
            break
        if len(unknowns):
            equations = partial(_equations, rows, choice, prior)
            ended = descend(equations, unknowns, layout.lower, layout.upper, done, hopeless)
            unknowns, status = ended.unknowns, ended.status
            if status == HOPELESS:
                break
        if attempt < MOST_ROUNDS:
            counted, choice = choice, rows(unknowns, choice).sifted
            settled = np.array_equal(counted, choice)
    return Settled(unknowns, prior, choice, status)


def _near(one: Prior, other: Prior) -> bool:
    """Whether two priors are so similar that no unknown would move notably."""
    return bool(np.abs(np.log(one.group_variances / other.group_variances)).max(initial=0.0) < SETTLED_VARIANCES)


def _equations(
    rows: Rows, choice: np.ndarray, prior: Prior, unknowns: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Normal equations of the rows that count and of the prior."""
    gram, side, square, _ = rows(unknowns, choice).total
    return gram + np.diag(prior.weight), side - prior.pull(unknowns), float(square + prior.cost(unknowns))
