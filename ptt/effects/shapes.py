"""Smooth shapes along an axis, with the constant and the linear part taken out: bending modes of a natural spline."""

from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

KNOTS = 17  # sixteen pieces: what bends within a twentieth of the range is damage of a spot, not a screw or a rail
SHAPES = KNOTS - 2
FINE = 2  # pieces of one between two knots: with four, rough screws are told in nine of twelve runs for seven
WAVES = (KNOTS - 1) * (FINE - 1)
COARSE = 9  # knots of older machine files, every second one of these, so that their curves are curves of these
COARSE_SHAPES = 6


def _bends(values: np.ndarray) -> np.ndarray:
    """Second derivatives of natural cubic splines at their knots, which run evenly from 0 to 1, (k, m) both.

    Written out here because scipy's splines bring its optimisers along, which take longer to load than all else.
    """
    size = len(values) - 2
    inner = 4.0 * np.eye(size) + np.eye(size, k=1) + np.eye(size, k=-1)
    bends = np.zeros_like(values)
    bends[1:-1] = np.linalg.solve(inner, 6.0 * (size + 1) ** 2 * np.diff(values, 2, axis=0))
    return bends


def natural_pieces(values: np.ndarray) -> np.ndarray:
    """Natural cubic splines through values at even knots from 0 to 1, as one cubic a piece.

    Args:
        values: (k, m).

    Returns:
        (4, k - 1, m): coefficients of the cube, the square, the offset from the piece's lower end, and one.
    """
    bends, width = _bends(values), 1.0 / (len(values) - 1)
    slope = np.diff(values, axis=0) / width - width * (2.0 * bends[:-1] + bends[1:]) / 6.0
    return np.stack([np.diff(bends, axis=0) / (6.0 * width), 0.5 * bends[:-1], slope, values[:-1]])


@lru_cache(maxsize=1)
def _modes() -> tuple[np.ndarray, np.ndarray]:
    """Natural splines that share no bending energy, the softest first, each as high as it is usual.

    They are told as values at the knots, (KNOTS, SHAPES), and as pieces. Sum of squares of their coefficients is the
    bending energy, as in a smoothing spline, whose curves have a slope that wanders at random along the axis (Wahba,
    Spline Models for Observational Data, 1990). The first is one high; the k-th then is about 1/k^2 high.
    """
    bend = _bends(np.eye(KNOTS))
    hats = (4.0 * np.eye(KNOTS) + np.eye(KNOTS, k=1) + np.eye(KNOTS, k=-1)) / 6.0  # integral of products, times 1/h
    energy, modes = np.linalg.eigh(bend.T @ hats @ bend)  # the two without energy are the constant and the line
    modes = modes[:, 2:] * np.sign(modes[-1, 2:]) / np.sqrt(energy[2:])
    values = modes / np.abs(modes[:, 0]).max()
    return values, natural_pieces(values)


def straight_shapes(position: Tensor) -> Tensor:
    """The straight part that smooth shapes leave out: a line of height one at both ends, and a constant.

    Args:
        position: place along the axis, scaled so that the range runs from 0 to 1, any shape (...).

    Returns:
        (..., 2).
    """
    return torch.stack([2.0 * position.clamp(0.0, 1.0) - 1.0, torch.ones_like(position)], dim=-1)


def smooth_shapes(position: Tensor) -> Tensor:
    """Evaluate the smooth shapes.

    Args:
        position: place along the axis, scaled so that the range runs from 0 to 1, any shape (...); held beyond it.

    Returns:
        (..., SHAPES), the first of height one and the others ever smaller, orthogonal at the knots to each other, to a
        constant and to a line.
    """
    return _evaluated(_modes()[1], position)


@lru_cache(maxsize=1)
def _waves() -> np.ndarray:
    """Natural splines on knots FINE times as dense that are zero at all the others, as pieces.

    Halfway between two knots one of them is one high: what a wander at random does between two places that hold it is
    largest there (Loeve's expansion of the Brownian bridge begins with it). With the smooth shapes they are all splines
    on the dense knots, and none of them bends where a smooth shape does: each takes its own energy.
    """
    values = np.zeros(((KNOTS - 1) * FINE + 1, WAVES))
    values[np.arange(len(values)) % FINE > 0] = np.eye(WAVES)
    return natural_pieces(values)


def wave_shapes(position: Tensor) -> Tensor:
    """Evaluate what a curve does between the knots of the smooth shapes.

    Args:
        position: place along the axis, scaled so that the range runs from 0 to 1, any shape (...); held beyond it.

    Returns:
        (..., WAVES), zero at the knots.
    """
    return _evaluated(_waves(), position)


def _evaluated(pieces: np.ndarray, position: Tensor) -> Tensor:
    """Piecewise cubics (4, pieces, m) at places (...), (..., m)."""
    table, count = torch.as_tensor(pieces, dtype=position.dtype), pieces.shape[1]
    inside = position.clamp(0.0, 1.0)
    piece = (inside.detach() * count).floor().long().clamp(0, count - 1)
    offset = (inside - piece / count).unsqueeze(-1)
    cubic, square, linear, constant = (row[piece] for row in table)
    return ((cubic * offset + square) * offset + linear) * offset + constant


def wavy_pieces(smooth: np.ndarray, straight: np.ndarray, waves: np.ndarray) -> np.ndarray:
    """A curve of all shapes as one cubic a piece of the dense knots.

    Args:
        smooth: (SHAPES,) coefficients.
        straight: (2,) slope and level.
        waves: (WAVES,) coefficients.

    Returns:
        (FINE * (KNOTS - 1), 4): coefficients as of `curve_pieces`.
    """
    knots = torch.linspace(0.0, 1.0, (KNOTS - 1) * FINE + 1, dtype=torch.float64)
    values = smooth_shapes(knots).numpy() @ smooth + straight_shapes(knots).numpy() @ straight
    return np.asarray(natural_pieces(values[:, None])[..., 0] + _waves() @ waves).T


def curve_pieces(smooth: np.ndarray, straight: np.ndarray) -> np.ndarray:
    """A curve of the smooth and straight shapes as one cubic a piece.

    Args:
        smooth: (SHAPES,) coefficients.
        straight: (2,) slope and level.

    Returns:
        (KNOTS - 1, 4): coefficients of the cube, the square, the offset from the piece's lower end, and one.
    """
    pieces = np.asarray(_modes()[1] @ smooth).T.copy()
    pieces[:, 2] += 2.0 * straight[0]
    pieces[:, 3] += straight[0] * (2.0 * np.arange(KNOTS - 1) / (KNOTS - 1) - 1.0) + straight[1]
    return pieces


@lru_cache(maxsize=1)
def from_coarse() -> tuple[np.ndarray, np.ndarray]:
    """What the shapes of older machine files are in the present ones.

    Returns:
        Smooth (SHAPES, COARSE_SHAPES) and straight (2, COARSE_SHAPES) coefficients of each older shape, exact.
    """
    from scipy.interpolate import CubicSpline

    coarse, knots = np.linspace(-1.0, 1.0, COARSE), np.linspace(-1.0, 1.0, KNOTS)
    orthogonal, triangle = np.linalg.qr(np.vander(coarse, COARSE_SHAPES + 2, increasing=True))
    shapes = (orthogonal * np.sign(np.diag(triangle)))[:, 2:]
    old = CubicSpline(coarse, shapes / np.abs(shapes).max(axis=0), bc_type="natural")(knots)
    new = np.column_stack([_modes()[0], knots, np.ones(KNOTS)])
    found = np.linalg.solve(new, old)
    return found[:SHAPES], found[SHAPES:]
