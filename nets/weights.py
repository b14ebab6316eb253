"""Weights with supervision: closed-form ridge and gradient descent on the same normal equations.

The network is y = background @ slope + features @ weights, the background a column of ones (the threshold of eq. 17,
with its sign) and, where asked for, the scaled inputs. The background carries no penalty, so it is eliminated first;
what is left is gram @ w = moment in the features alone, whose eigenvectors serve every ridge and every number of
gradient steps at once.
"""

from dataclasses import dataclass

import numpy as np

from nets.scaling import FloatArray


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Least squares in the features after the background has been eliminated.

    Attributes:
        rows: number of rows n summed over.
        gram: (q, q) features^T features.
        moment: (q, o) features^T outputs.
        energy: (o,) outputs^T outputs, what the background leaves of them.
        background_features: (h, q) coefficients of the features on the background.
        background_outputs: (h, o) coefficients of the outputs on the background.
    """

    rows: int
    gram: FloatArray
    moment: FloatArray
    energy: FloatArray
    background_features: FloatArray
    background_outputs: FloatArray

    def background(self, weights: FloatArray) -> FloatArray:
        """Coefficients of the background that go with given weights.

        Args:
            weights: (..., q, o).

        Returns:
            (..., h, o).
        """
        return self.background_outputs - self.background_features @ weights


@dataclass(frozen=True, eq=False)
class Products:
    """Sums over rows of the products of the columns [background, features, outputs]; they add up over parts.

    Attributes:
        rows: number of rows summed over.
        matrix: (h + q + o, h + q + o).
        sizes: (h, q, o).
    """

    rows: int
    matrix: FloatArray
    sizes: tuple[int, int, int]

    def __add__(self, part: "Products") -> "Products":
        """The sums over the rows of both."""
        return Products(self.rows + part.rows, self.matrix + part.matrix, self.sizes)

    def __sub__(self, part: "Products") -> "Products":
        """What remains when a part of the rows is held out."""
        return Products(self.rows - part.rows, self.matrix - part.matrix, self.sizes)


def products(background: FloatArray, features: FloatArray, outputs: FloatArray) -> Products:
    """Sum the products of all columns over rows.

    Args:
        background: (n, h).
        features: (n, q), values of the hidden nodes.
        outputs: (n, o).

    Returns:
        The sums.
    """
    columns = np.hstack([background, features, outputs])
    return Products(len(columns), columns.T @ columns, (background.shape[1], features.shape[1], outputs.shape[1]))


def normal_equations(sums: Products) -> NormalEquations:
    """Eliminate the background (its Schur complement), which carries no penalty.

    Args:
        sums: products over the training rows.

    Returns:
        The equations in the features alone.
    """
    h, q, _ = sums.sizes
    top, rest = sums.matrix[:h, :h], sums.matrix[:h, h:]  # (h, h), (h, q + o)
    # A constant input makes the background singular; the pseudo-inverse gives it no slope.
    solved = np.linalg.pinv(top, rcond=1e-12, hermitian=True) @ rest
    left = sums.matrix[h:, h:] - rest.T @ solved
    return NormalEquations(
        rows=sums.rows,
        gram=left[:q, :q],
        moment=left[:q, q:],
        energy=np.maximum(np.diagonal(left[q:, q:]), 0.0),
        background_features=solved[:, :q],
        background_outputs=solved[:, q:],
    )


def shrinkage(eigenvalues: FloatArray, penalty: FloatArray, rate: float, steps: int | None) -> FloatArray:
    """Factor from the moment to the weight along each eigenvector of the gram matrix.

    Ridge: 1 / c with the curvature c = s + penalty. Gradient descent from zero reaches
    1 - (1 - rate c / c_max)^steps of it after `steps` steps, so an unfinished descent is judged exactly, unrun.

    Args:
        eigenvalues: (q,), >= 0.
        penalty: (r,), > 0: ridge times rows.
        rate: eta of eq. 16 in (0, 1].
        steps: number of gradient steps; None for the closed form.

    Returns:
        (r, q).
    """
    curvature = eigenvalues[None, :] + penalty[:, None]  # (r, q)
    if steps is None:
        return 1.0 / curvature
    remaining = (1.0 - rate * curvature / curvature.max(axis=1, keepdims=True)) ** steps
    return (1.0 - remaining) / curvature


def ridge_path(
    equations: NormalEquations, ridges: FloatArray, *, rate: float = 1.0, steps: int | None = None
) -> FloatArray:
    """Weights for every ridge from one eigendecomposition.

    Minimises mean|outputs - prediction|^2 + ridge |w|^2 (or walks `steps` gradient steps towards that minimum).

    Args:
        equations: of the training rows.
        ridges: (r,), > 0.
        rate: eta of eq. 16, used with `steps`.
        steps: number of gradient steps; None for the closed form.

    Returns:
        (r, q, o) weights.

    Source: Hoerl and Kennard, Technometrics 12(1), 1970.
    """
    if equations.gram.shape[0] == 0:
        return np.zeros((len(ridges), 0, equations.moment.shape[1]))
    eigenvalues, vectors = np.linalg.eigh(equations.gram)
    factors = shrinkage(np.maximum(eigenvalues, 0.0), ridges * equations.rows, rate, steps)
    projected = vectors.T @ equations.moment  # (q, o)
    scaled = factors[:, :, None] * projected[None, :, :]  # (r, q, o)
    return np.asarray(np.einsum("pq,rqo->rpo", vectors, scaled, optimize=True))


def descend_gradient(
    equations: NormalEquations, ridge: FloatArray, *, rate: float, epochs: int
) -> tuple[FloatArray, FloatArray]:
    """Gradient descent of eq. 16: w += rate * phi^T (expected - actual output), summed over all rows.

    The step is divided by the largest curvature of the objective, the largest eigenvalue of the gram matrix plus
    the penalty. With that no direction overshoots for any rate in (0, 1], and the mean squared error falls at every
    step. The threshold follows the weights exactly at every step.

    Args:
        equations: of the training rows.
        ridge: (o,), one penalty per output.
        rate: eta in (0, 1].
        epochs: passes over the data.

    Returns:
        (q, o) weights and the (epochs + 1, o) curve of the mean squared error in squared units of the outputs, the
        first entry before any step.
    """
    penalty = ridge * equations.rows
    step = rate / (_largest_eigenvalue(equations.gram) + penalty)
    weights = np.zeros_like(equations.moment)
    curve = np.empty((epochs + 1, weights.shape[1]))
    for epoch in range(epochs):
        pull = equations.gram @ weights
        curve[epoch] = _mean_squared_error(equations, weights, pull)
        weights = weights + step * (equations.moment - pull - penalty * weights)
    curve[epochs] = _mean_squared_error(equations, weights, equations.gram @ weights)
    return weights, curve


def _largest_eigenvalue(gram: FloatArray) -> float:
    return float(np.linalg.eigvalsh(gram)[-1]) if len(gram) else 0.0


def _mean_squared_error(equations: NormalEquations, weights: FloatArray, pull: FloatArray) -> FloatArray:
    squared = equations.energy + np.sum(weights * (pull - 2.0 * equations.moment), axis=0)
    return np.asarray(np.maximum(squared, 0.0) / equations.rows)
