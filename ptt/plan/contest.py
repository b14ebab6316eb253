"""Discrimination of two effects (T-optimality): what one cannot imitate of the other, and which rows add to that."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

GOAL = 8.0  # separation to reach, sigma


@dataclass(frozen=True, eq=False)
class Contest:
    """One effect is supposed true, and another, with all nuisance parameters, is fitted to its signature.

    With signature s and columns X of all that is fitted, lambda = min |s - X b|^2 is the non-centrality of the
    chi-squared by which the wrong effect fits worse (Atkinson and Fedorov, Biometrika 62, 1975: T-optimal designs).
    All rows so far are kept as the triangular factor R of [X s] (QR), to which further rows are added.

    Attributes:
        columns: indices of the fitted columns, (p,).
        amplitudes: of the true effect, zero in other columns, (P,) in usual sizes.
        triangle: R, (p + 1, p + 1).
    """

    columns: np.ndarray
    amplitudes: np.ndarray
    triangle: np.ndarray

    @property
    def misfit(self) -> float:
        """Non-centrality lambda, in noise variances."""
        return float(self.triangle[-1, -1] ** 2)

    @property
    def separation(self) -> float:
        """Root of lambda: how many sigma apart the two effects are."""
        return float(np.sqrt(self.misfit))

    @property
    def solution(self) -> np.ndarray:
        """Least squares coefficients b of the fitted columns, (p,) in usual sizes."""
        return linalg.solve_triangular(self.triangle[:-1, :-1], self.triangle[:-1, -1], check_finite=False)

    def add(self, rows: np.ndarray) -> "Contest":
        """The contest with further rows.

        Args:
            rows: whitened rows of the design, (r, P).

        Returns:
            The contest.
        """
        more = self._own(rows)
        return replace(self, triangle=triangle(np.concatenate([self.triangle, more])))

    def without(self, columns: np.ndarray) -> "Contest":
        """The contest with some columns no longer fitted.

        Args:
            columns: their indices.

        Returns:
            The contest.
        """
        kept = ~np.isin(self.columns, columns)
        return replace(self, columns=self.columns[kept], triangle=triangle(self.triangle[:, np.append(kept, True)]))

    def gains(self, groups: np.ndarray) -> np.ndarray:
        """What each group of rows would add to lambda.

        With e the residual of the group's signature and H = X (R^T R)^-1 X^T, it is e^T (1 + H)^-1 e.

        Args:
            groups: whitened rows of the design, (g, r, P).

        Returns:
            (g,).
        """
        own = self._own(groups.reshape(-1, groups.shape[-1])).reshape(*groups.shape[:2], -1)
        left = own[..., -1] - own[..., :-1] @ self.solution
        flat = own[..., :-1].reshape(-1, len(self.columns))
        spread = linalg.solve_triangular(self.triangle[:-1, :-1], flat.T, trans="T", check_finite=False).T
        spread = spread.reshape(own[..., :-1].shape)
        inner = np.eye(groups.shape[1]) + spread @ spread.transpose(0, 2, 1)
        return np.einsum("gr,gr->g", left, np.linalg.solve(inner, left[..., None])[..., 0])

    def _own(self, rows: np.ndarray) -> np.ndarray:
        return np.column_stack([rows[:, self.columns], rows @ self.amplitudes])


def open_contest(known: np.ndarray, columns: np.ndarray, amplitudes: np.ndarray) -> Contest:
    """Set up a contest on the rows measured so far, and priors.

    Args:
        known: triangle of `known_rows`, (r, P).
        columns: indices of the fitted columns, (p,).
        amplitudes: of the true effect, (P,) in usual sizes.

    Returns:
        The contest.
    """
    empty = Contest(columns, amplitudes, np.zeros((0, len(columns) + 1)))
    return empty.add(known)


def triangle(rows: np.ndarray) -> np.ndarray:
    """Triangular factor R of A, R^T R = A^T A, which suffices for least squares.

    Args:
        rows: A, (r, P).

    Returns:
        (P, P); zeros at the end where there are fewer rows than columns.
    """
    found = np.asarray(np.linalg.qr(rows, mode="r"))
    width = rows.shape[1]
    return found if len(found) == width else np.vstack([found, np.zeros((width - len(found), width))])
