"""Readings of base reflectors in the course of a run, and how much they scatter: singly, by round, by reflector."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ptt.run.base_visits import rounds_apart
from ptt.run.frames import align
from ptt.run.view import View

# Variance of the means of rounds beside an effect, over that without it, below which the effect is what moved them: a
# tracker that wanders a little has a knock or a drift in most runs that explains half of it
CLEARLY_LESS = 0.1


@dataclass(frozen=True)
class BaseReadings:
    """Readings of base reflectors in the course of a run, on which metrology effects act as on the poses.

    Attributes:
        view: one row for each of m visits, with its time and with the reflector's drawn position as p.
        reading: (m, 3) mm, near the base frame.
        frame: (m,) int, index of the frame.
        point: (m,) int, index of the reflector.
        round: (m,) int, equal for visits to different reflectors one after the other.
        drawn: (m,) mm, standard deviation of a coordinate of the drawn position, an error common to all its visits.
        apart: (m,) mm, standard deviation between rounds, an error common to all reflectors of a round.
        aside: (n,) bool, rows of the run whose visit was left out as faulty.
        scatter: standard deviation of a coordinate of a single visit, as the visits show it, mm; zero where they do
            not.
    """

    view: View
    reading: np.ndarray
    frame: np.ndarray
    point: np.ndarray
    round: np.ndarray
    drawn: np.ndarray
    apart: np.ndarray
    aside: np.ndarray
    scatter: float

    @property
    def place(self) -> np.ndarray:
        """Where the reflectors are drawn, (m, 3) mm."""
        return self.view.p.numpy()

    def whitened(self, values: np.ndarray, whitener: np.ndarray) -> np.ndarray:
        """Whiten values of the visits by their covariance: of a single reading, of drawn positions and of rounds.

        A tracker scatters along its beam a tenth as much as across, and the beam to a reflector has another direction
        than those to the poses: so on every axis a visit is given the scatter of a pose on its worst axis, or that
        of the visits themselves where it is larger.

        Args:
            values: (m, 3, c) mm.
            whitener: (3, 3) 1/mm of one reading of a pose, its rows principal axes.

        Returns:
            (m, 3, c); rows are eigenvectors of the covariance over visits, no longer single visits.
        """
        worst = float(np.square(whitener).sum(axis=1).min())  # 1/mm^2
        single = max(1.0 / worst, self.scatter**2)
        common, ways = self._common
        wide = np.sqrt(single + common)
        return np.asarray(np.tensordot(ways.T, values, axes=1) / wide[:, None, None])

    @cached_property
    def _common(self) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues (m,) mm^2 and eigenvectors (m, m) of the covariance between visits, without single readings."""
        point, together = (one[:, None] == one[None, :] for one in (self.point, self.round))
        common, ways = np.linalg.eigh(np.square(self.drawn) * point + np.square(self.apart) * together)
        return np.maximum(common, 0.0), ways

    def beside(self, told: np.ndarray, columns: np.ndarray) -> "BaseReadings":
        """The visits with the scatter between rounds that a prediction leaves, where that is clearly less.

        A drift moves the rounds apart, and until it is known as such they tell little of where the frame is.

        Args:
            told: predicted readings, (m, 3) mm.
            columns: derivative of the prediction by each number that was fitted, (m, 3, c) mm per unit.
        """
        left, apart = self.reading - told, self.apart.copy()
        for index in np.unique(self.frame):
            own = self.frame == index
            scatter = rounds_apart(left[own], self.point[own], self.round[own], columns[own])
            if scatter is None:
                continue
            alone = self.scatter**2 * len(np.unique(self.round[own])) / own.sum()  # of a mean, by its visits
            if scatter**2 + alone < CLEARLY_LESS * (apart[own][0] ** 2 + alone):
                apart[own] = scatter
        return replace(self, apart=apart)

    def frames_beside(self, told: np.ndarray, frames: int) -> tuple[np.ndarray, np.ndarray]:
        """Rigid motion of each frame given a prediction of the reflectors' readings.

        Args:
            told: predicted readings, (m, 3) mm.
            frames: number of frames.

        Returns:
            R (f, 3, 3) and t (f, 3) mm, as of `ptt.run.frames.align`.
        """
        found = [align(told[self.frame == index], self.reading[self.frame == index]) for index in range(frames)]
        return np.array([turn for turn, _ in found]), np.array([shift for _, shift in found])
