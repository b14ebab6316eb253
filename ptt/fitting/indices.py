"""Observability indices: how well a set of poses tells the parameters of a machine, in five figures of the field."""

from dataclasses import dataclass

import numpy as np

from ptt.fitting.stated import SEEN_INFORMATION
from ptt.record import Record

ROUNDING = 1e-13  # share of an unknown's information that is rounding


@dataclass(frozen=True)
class Indices(Record):
    """Five indices of the singular values s_1 >= ... >= s_L of an identification Jacobian, frames projected off.

    Source: Sun and Hollerbach, Observability index selection for robot calibration (2008). Columns are in usual sizes
    of the parameters and rows in units of noise, so that the figures do not depend on whether a length is in mm or m.

    Attributes:
        o1: (s_1 ... s_L)^(1/L) / sqrt(poses), of Borm and Menq; the D-optimal choice makes it largest.
        o2: s_L / s_1, the inverse condition number, of Driels and Pathre.
        o3: s_L, of Nahvi, Hollerbach and Hayward; the E-optimal choice.
        o4: s_L^2 / s_1, the noise amplification index of Nahvi and Hollerbach.
        o5: 1 / (1/s_1 + ... + 1/s_L), of Sun and Hollerbach; near the A-optimal choice.
        rank: directions L that the poses see better than the usual size of the parameters.
        parameters: how many there are, seen or not.
        poses: how many readings.
    """

    o1: float
    o2: float
    o3: float
    o4: float
    o5: float
    rank: int
    parameters: int
    poses: int

    @property
    def text(self) -> str:
        """One line."""
        figures = ", ".join(f"O{i} {getattr(self, f'o{i}'):.3g}" for i in range(1, 6))
        return f"observability: {self.rank} of {self.parameters} directions seen; {figures}"


def observability_indices(information: np.ndarray, poses: int) -> Indices:
    """Indices of what is known of parameters.

    Args:
        information: J^T J in usual sizes and units of noise, what is fitted beside projected off, (u, u).
        poses: number of readings behind it.

    Returns:
        The indices over the directions that are seen; zeros where none is.
    """
    values = np.linalg.eigvalsh(information) if len(information) else np.zeros(0)
    singular = np.sqrt(values[values >= SEEN_INFORMATION])[::-1]
    count = len(singular)
    if not count:
        return Indices(0.0, 0.0, 0.0, 0.0, 0.0, 0, len(information), poses)
    most, least = float(singular[0]), float(singular[-1])
    mean = float(np.exp(np.log(singular).mean()))
    return Indices(
        mean / np.sqrt(max(poses, 1)), least / most, least, least**2 / most, float(1.0 / (1.0 / singular).sum()), count,
        len(information), poses,
    )  # fmt: skip


def project_off(information: np.ndarray, own: np.ndarray, free: float = 1e-9) -> np.ndarray:
    """Information on some unknowns when all others are fitted beside them: the Schur complement.

    Args:
        information: J^T J, (u, u).
        own: indices of the unknowns that matter, (p,).
        free: information that the others have of their own, which keeps their unseen directions finite.

    Returns:
        (p, p).
    """
    others = np.setdiff1d(np.arange(len(information)), own)
    block = information[np.ix_(others, others)]
    # A turn of the frame about the line on which all targets lie is unseen: beside the others `free` may be lost.
    block = block + np.diag(free + ROUNDING * np.diagonal(block))
    cross = information[np.ix_(others, own)]
    return np.asarray(information[np.ix_(own, own)] - cross.T @ np.linalg.solve(block, cross))
