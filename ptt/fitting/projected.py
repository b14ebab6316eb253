"""Projected: columns of normal equations with everything taken off that a model explains."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ptt.fitting.stated import SEEN_INFORMATION

# share of a column's information below which what is its own is an artefact of the linearisation
LINEARISATION_TRACE = 1e-7


@dataclass(frozen=True)
class Projected:
    """Columns with everything the present model explains taken off.

    Attributes:
        gram: (P, P) of the columns.
        side: (P,).
        left: sum of squares that the present model leaves.
        before: (P,) information of each column before anything was taken off.
    """

    gram: np.ndarray
    side: np.ndarray
    left: float
    before: np.ndarray

    def least(self, chosen: np.ndarray) -> float:
        """Information from which a direction of the chosen columns counts as seen.

        In very many rows even the thousandth part by which two columns differ only because of where they were
        linearised would count, and be blown up into anything.
        """
        return max(SEEN_INFORMATION, LINEARISATION_TRACE * float(self.before[chosen].max(initial=0.0)))


def project(gram: np.ndarray, side: np.ndarray, square: float, base: np.ndarray) -> Projected:
    """Take off what the base columns explain.

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
    strength, directions = linalg.eigh(gram[np.ix_(base, base)])
    seen = strength > SEEN_INFORMATION
    root = directions[:, seen] / np.sqrt(strength[seen])
    cross = root.T @ gram[base]  # shape: (s, P)
    along = root.T @ side[base]
    left = max(square - float(along @ along), 0.0)
    return Projected(gram - cross.T @ cross, side - cross.T @ along, left, np.diag(gram))


def gain(projected: Projected, chosen: np.ndarray) -> float:
    """What chosen columns take off the rest.

    Args:
        projected: columns with the present model taken off.
        chosen: indices.

    Returns:
        Reduction of the sum of squares.
    """
    strength, directions = linalg.eigh(projected.gram[np.ix_(chosen, chosen)])
    seen = strength > projected.least(chosen)
    along = directions[:, seen].T @ projected.side[chosen]
    return float(along @ (along / strength[seen]))
