"""What a fit states: values, covariance, and directions that the rows do not see."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch

from ptt.fitting.factor import inverse
from ptt.fitting.result import FitResult

SEEN_INFORMATION = 1.0  # information from which a direction counts as seen: the data know it better than its usual size
INFORMATION_ROUNDING = 1e-13  # share of the strongest direction's information that is rounding
Witness = Callable[[np.ndarray, float], np.ndarray | None]


def state_fit(
    fitted: FitResult,
    unknowns: np.ndarray,
    information: np.ndarray,
    chi2: float,
    count: float,
    witness: Witness | None = None,
) -> FitResult:
    """Complete a fit with values, covariance and unseen directions.

    Args:
        fitted: for the layout and the prior.
        unknowns: (u,) in usual sizes.
        information: J^T J of the rows in usual sizes, (u, u).
        chi2: weighted sum of squares that is left of them.
        count: number of their coordinates.
        witness: what autocorrelated rows add to the covariance of X^T r, given the inverse of the normal matrix and the
            variance of a row; None for independent rows.

    Returns:
        The fit with all this.
    """
    layout, prior = fitted.layout, fitted.prior
    left = inverse(information + np.diag(prior.weight))
    freedom = max(count - len(unknowns) + float(np.diag(left) @ prior.weight), 1.0)
    widening, informed = max(1.0, chi2 / freedom), information + np.diag(layout.held.astype(float))
    # Small learned variances give good values; errors allow for a parameter that is larger than others of its group.
    sizes = prior.sizes(layout)
    wide = widening * prior.design_effect
    solved = inverse(information + np.diag(wide / np.maximum(prior.variance, sizes**2)))
    more = witness(solved, wide) if witness else None
    covariance = wide * solved if more is None else wide * solved + solved @ more @ solved
    unseen = unseen_directions(informed * np.outer(sizes, sizes))
    result = replace(
        fitted, unknowns=unknowns, covariance=covariance * np.outer(layout.scale, layout.scale), information=informed,
        chi2=chi2, freedom=round(freedom), rank=len(unknowns) - unseen.shape[1], unseen=unseen,
    )  # fmt: skip
    return with_fitted_terms(result)


def with_fitted_terms(result: FitResult) -> FitResult:
    """A fit whose model has the effects at the fit's unknowns, with what is known of their accuracy.

    Args:
        result: the fit.

    Returns:
        The same with that model.
    """
    layout, terms, start = result.layout, [], 0
    for term, free, theta in zip(layout.terms, layout.free, layout.thetas(result.unknowns), strict=True):
        part = slice(start, start + int(free.sum()))
        std, measured = torch.full_like(theta, torch.nan), torch.ones(len(theta), dtype=torch.bool)
        mask = torch.as_tensor(free)
        std[mask] = torch.as_tensor(result.std[part])
        measured[mask] = torch.as_tensor(result.measured[part])
        terms.append(replace(term, theta=theta, std=std, measured=measured))
        start = part.stop
    return replace(result, model=replace(result.model, terms=tuple(terms)))


def unseen_directions(information: np.ndarray) -> np.ndarray:
    """Directions on which the rows have less information than the prior of the sizes that the unknowns may have.

    Args:
        information: J^T J in units of those sizes, (u, u).

    Returns:
        (u, m), orthonormal columns.
    """
    if not len(information):
        return np.zeros((0, 0))
    eigenvalues, directions = np.linalg.eigh(information)
    return directions[:, eigenvalues < max(SEEN_INFORMATION, INFORMATION_ROUNDING * eigenvalues[-1])]
