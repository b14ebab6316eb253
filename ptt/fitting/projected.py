"""Normal equations with the columns of a model projected off."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ptt.fitting.stated import SEEN_INFORMATION

# share of a column's information below which what is its own is an artefact of the linearisation
LINEARISATION_TRACE = 1e-7


@dataclass(frozen=True)
class Projected:
    """Normal sums of columns projected off those of the present model.

    Attributes:
        gram: X^T X of the projected columns, (P, P).
        side: X^T y, (P,).
        left: residual sum of squares of the present model.
        before: diagonal of X^T X before the projection, (P,).
    """

    gram: np.ndarray
    side: np.ndarray
    left: float
    before: np.ndarray

    def least(self, chosen: np.ndarray) -> float:
        """Information from which a direction of the chosen columns counts as seen.

        With very many rows, even the thousandth part by which two columns differ only because of where they were
        linearised would exceed the absolute limit and give arbitrarily large values.
        """
        return max(SEEN_INFORMATION, LINEARISATION_TRACE * float(self.before[chosen].max(initial=0.0)))


def project(gram: np.ndarray, side: np.ndarray, square: float, base: np.ndarray) -> Projected:
    """Project off the base columns.

    Args:
        gram: (P, P).
        side: (P,).
        square: sum of squared values.
        base: indices of the present model's columns.

    Returns:
        The projection, over all columns; those of the base are zero up to rounding.
    """
    if not len(base):
        return Projected(gram, side, square, np.diag(gram))
    eigenvalues, directions = linalg.eigh(gram[np.ix_(base, base)])
    seen = eigenvalues > SEEN_INFORMATION
    root = directions[:, seen] / np.sqrt(eigenvalues[seen])
    cross = root.T @ gram[base]  # shape: (s, P)
    along = root.T @ side[base]
    left = max(square - float(along @ along), 0.0)
    return Projected(gram - cross.T @ cross, side - cross.T @ along, left, np.diag(gram))


def gain(projected: Projected, chosen: np.ndarray) -> float:
    """Sum of squares that chosen columns explain beside the present model.

    Args:
        projected: columns with the present model taken off.
        chosen: indices.

    Returns:
        Reduction of the sum of squares.
    """
    eigenvalues, directions = linalg.eigh(projected.gram[np.ix_(chosen, chosen)])
    seen = eigenvalues > projected.least(chosen)
    along = directions[:, seen].T @ projected.side[chosen]
    return float(along @ (along / eigenvalues[seen]))
