"""Basis of smooth curves along an axis: bending modes of a natural cubic spline, straight line, finer splines between.

Bending modes have no constant and no linear part, which are the shapes of effects of their own (homing, lead; position,
tilt).
"""

from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

KNOTS = 17  # sixteen pieces: a bend within less of the range is local damage, not the lead of a screw or a rail's line
SHAPES = KNOTS - 2  # bending modes
FINE = 2  # dense pieces for each piece; four name a rough screw in 9 of 12 runs instead of 7, but take twice the time
WAVES = (KNOTS - 1) * (FINE - 1)  # finer splines, zero at the knots


def _bends(values: np.ndarray) -> np.ndarray:
    """Second derivatives of m natural cubic splines at k even knots from 0 to 1, from their values there, (k, m) both.

    Not by scipy, whose splines load its optimisers, which takes longer than all the rest.
    """
    size = len(values) - 2
    inner = 4.0 * np.eye(size) + np.eye(size, k=1) + np.eye(size, k=-1)
    bends = np.zeros_like(values)
    bends[1:-1] = np.linalg.solve(inner, 6.0 * (size + 1) ** 2 * np.diff(values, 2, axis=0))
    return bends


def natural_pieces(values: np.ndarray) -> np.ndarray:
    """Natural cubic splines through values at even knots from 0 to 1, as one cubic for each piece.

    Args:
        values: (k, m).

    Returns:
        (4, k - 1, m): coefficients of x^3, x^2, x and 1, x counted from the piece's lower end.
    """
    bends, width = _bends(values), 1.0 / (len(values) - 1)
    slope = np.diff(values, axis=0) / width - width * (2.0 * bends[:-1] + bends[1:]) / 6.0
    return np.stack([np.diff(bends, axis=0) / (6.0 * width), 0.5 * bends[:-1], slope, values[:-1]])


@lru_cache(maxsize=1)
def _modes() -> tuple[np.ndarray, np.ndarray]:
    """Natural splines orthogonal in bending energy, the softest first: values at the knots (KNOTS, SHAPES), and pieces.

    They are scaled so that the sum of squares of their coefficients is the bending energy, up to a factor: a prior of
    equal variances is then that of a smoothing spline, whose slope is a random walk along the axis (Wahba, Spline
    Models for Observational Data, 1990). The first mode has height 1, the k-th about 1/k^2.
    """
    bend = _bends(np.eye(KNOTS))
    hats = (4.0 * np.eye(KNOTS) + np.eye(KNOTS, k=1) + np.eye(KNOTS, k=-1)) / 6.0  # integrals of hat products / h
    energy, modes = np.linalg.eigh(bend.T @ hats @ bend)  # the two without energy are the constant and the line
    modes = modes[:, 2:] * np.sign(modes[-1, 2:]) / np.sqrt(energy[2:])
    values = modes / np.abs(modes[:, 0]).max()
    return values, natural_pieces(values)


def straight_shapes(position: Tensor) -> Tensor:
    """The straight part that bending modes lack: a line from -1 to 1, and a constant 1.

    Args:
        position: place along the axis, scaled so that the range runs from 0 to 1, any shape (...).

    Returns:
        (..., 2).
    """
    return torch.stack([2.0 * position.clamp(0.0, 1.0) - 1.0, torch.ones_like(position)], dim=-1)


def smooth_shapes(position: Tensor) -> Tensor:
    """Evaluate the bending modes.

    Args:
        position: place along the axis, scaled so that the range runs from 0 to 1, any shape (...); constant beyond it.

    Returns:
        (..., SHAPES), the first of height 1 and the others ever smaller, orthogonal at the knots to each other, to a
        constant and to a line.
    """
    return _evaluated(_modes()[1], position)


@lru_cache(maxsize=1)
def _waves() -> np.ndarray:
    """Cardinal natural splines on FINE times as many knots, those that are zero at all the coarse knots, as pieces.

    Each is 1 halfway between two coarse knots and 0 at all other dense ones: there a random walk held at both ends (a
    Brownian bridge, whose Karhunen-Loeve expansion begins with such a bow) departs most. With the bending modes they
    span all natural splines on the dense knots, and they share no bending energy with the modes.
    """
    values = np.zeros(((KNOTS - 1) * FINE + 1, WAVES))
    values[np.arange(len(values)) % FINE > 0] = np.eye(WAVES)
    return natural_pieces(values)


def wave_shapes(position: Tensor) -> Tensor:
    """Evaluate the finer splines, which are zero at the knots of the bending modes.

    Args:
        position: place along the axis, scaled so that the range runs from 0 to 1, any shape (...); constant beyond it.

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
    """A curve of bending modes, straight part and finer splines as one cubic for each piece between dense knots.

    Args:
        smooth: (SHAPES,) coefficients of the bending modes.
        straight: (2,) slope and level.
        waves: (WAVES,) coefficients of the finer splines.

    Returns:
        (FINE * (KNOTS - 1), 4): coefficients as those of `curve_pieces`.
    """
    knots = torch.linspace(0.0, 1.0, (KNOTS - 1) * FINE + 1, dtype=torch.float64)
    values = smooth_shapes(knots).numpy() @ smooth + straight_shapes(knots).numpy() @ straight
    return np.asarray(natural_pieces(values[:, None])[..., 0] + _waves() @ waves).T


def curve_pieces(smooth: np.ndarray, straight: np.ndarray) -> np.ndarray:
    """A curve of bending modes and straight part as one cubic for each piece between knots.

    Args:
        smooth: (SHAPES,) coefficients of the bending modes.
        straight: (2,) slope and level.

    Returns:
        (KNOTS - 1, 4): coefficients of x^3, x^2, x and 1, x counted from the piece's lower end.
    """
    pieces = np.asarray(_modes()[1] @ smooth).T.copy()
    pieces[:, 2] += 2.0 * straight[0]
    pieces[:, 3] += straight[0] * (2.0 * np.arange(KNOTS - 1) / (KNOTS - 1) - 1.0) + straight[1]
    return pieces
