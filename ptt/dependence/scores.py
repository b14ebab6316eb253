"""How unlikely the best trial function of each variable is, on the data and on permuted rows."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ptt.dependence.chance import log_chance, slow_excess, slow_spectrum, spread
from ptt.dependence.contexts import is_joint
from ptt.dependence.regressors import Atoms, build_atoms, build_varying, orthonormal
from ptt.dependence.strata import LEAST_POSES, RepeatedPoses, Stratum, build_stratum

STIFF = 4  # directions of a curve that cannot follow slow error closely
SECOND = ("temperature", "payload")  # what a play may open with


@dataclass(frozen=True)
class Variable:
    """One variable and its trial functions.

    Attributes:
        name: of the variable.
        second: of the variable that a direction's say varies with, or None.
        stratum: the independent rows that speak for it.
        raw: its trial functions on those rows.
        trial: the same, whitened and orthonormal.
    """

    name: str
    second: str | None
    stratum: Stratum
    raw: tuple[Atoms, ...]
    trial: tuple[Atoms, ...]

    def on_rows(self) -> tuple[Atoms, ...]:
        """Raw trial functions on every row."""
        return tuple(replace(atoms, columns=self.stratum.spread(atoms.columns)) for atoms in self.raw)


@dataclass(frozen=True)
class Score:
    """Log chances of a variable's best trial function.

    Attributes:
        variable: the variable.
        found: (r,) for the data.
        chance: (B,) the largest over all residuals, for every permutation.
        kind: (r,) the best kind.
        atom: (r,) its best trial function.
        toll: (kinds,) directions that chance uses up in the search.
        offset: (kinds,) by how much the search lifts the log chance.
    """

    variable: Variable
    found: np.ndarray
    chance: np.ndarray
    kind: np.ndarray
    atom: np.ndarray
    toll: np.ndarray
    offset: np.ndarray

    def honest(self, r: int, slow: int) -> float:
        """Log chance for residual r after the toll for slow error.

        Args:
            r: number of the residual.
            slow: how many of the slowest cosines over the travel count as slow.

        Returns:
            The log chance as if the error left over had the same power at all speeds.
        """
        if self.variable.name == "time":
            return float(self.found[r])
        trial, white = self.variable.trial[self.kind[r]], self.variable.stratum.white[:, r]
        columns = trial.pick(int(self.atom[r]))
        fitted = columns @ (columns.T @ white)
        share = float(fitted @ fitted / max(float(white @ white), 1e-30))
        odds = share / max(1.0 - share, 1e-7) / self._inflation(columns, fitted, white - fitted, r, slow)
        log = log_chance(np.array([odds / (1.0 + odds)]), trial.dims, len(white) - 1 - trial.dims)
        return float(log[0] - self.offset[self.kind[r]])

    def _inflation(self, columns: np.ndarray, fitted: np.ndarray, left: np.ndarray, r: int, slow: int) -> float:
        """What slow error adds: as far as visits of one pose tell, else as far as it is left beside the fit."""
        stratum = self.variable.stratum
        if stratum.means and stratum.within is not None:
            slow = min(slow, len(stratum.within) // 4)
            travel = slow_spectrum(stratum.spread(fitted), slow)
            return spread(travel, slow_excess(stratum.within[:, r], slow))
        if columns.shape[1] > STIFF:
            # Many bins would take the slow error with them: a stiff curve leaves it to be seen.
            columns = next(trial.columns for trial in self.variable.trial if trial.kind in ("smooth", "levels"))
            left = fitted + left
            left = left - columns @ (columns.T @ left)
        slow = min(max(slow, 3 * columns.shape[1]), len(left) // 4)
        removed = slow_spectrum(columns, slow, whole=False)
        return spread(slow_spectrum(fitted, slow), slow_excess(left, slow, removed))


def build_scores(
    residual: np.ndarray, contexts: dict[str, np.ndarray], poses: RepeatedPoses, *, permutations: int, seed: int
) -> list[Score]:
    """Score every variable against every residual.

    Args:
        residual: (n, r), each of about unit variance, single precision.
        contexts: (n,) each.
        poses: repeated visits.
        permutations: B.
        seed: of the permutations.

    Returns:
        A score for each variable, and for each direction whose say may vary with temperature or payload.
    """
    rows = build_stratum(residual, poses, means=False, permutations=permutations, seed=seed)
    means = rows
    if len(poses.size) < len(residual):
        means = build_stratum(residual, poses, means=True, permutations=permutations, seed=seed)
    return [_score(variable, residual.shape[1]) for variable in _variables(contexts, rows, means)]


def _variables(contexts: dict[str, np.ndarray], rows: Stratum, means: Stratum) -> Iterator[Variable]:
    for name, column in contexts.items():
        stratum = means if means is not rows and rows.poses.holds(column) else rows
        if stratum.rows < LEAST_POSES:
            continue
        yield _variable(name, None, stratum, build_atoms(stratum.values(column), periodic=is_joint(name)))
    for name, column in contexts.items():
        for second in SECOND:
            if name.startswith("direction") and second in contexts:
                yield _variable(name, second, rows, build_varying(column, contexts[second]))


def _variable(name: str, second: str | None, stratum: Stratum, raw: tuple[Atoms, ...]) -> Variable:
    trial = tuple(orthonormal(atoms, stratum.nuisance, stratum.whiten) for atoms in raw)
    return Variable(name, second, stratum, raw, trial)


def _score(variable: Variable, count: int) -> Score:
    """Each kind is set back by what it reaches on permuted rows, so that no kind wins by trying more."""
    shuffled = variable.stratum.shuffled
    logs, atoms, toll, offset = [], [], [], []
    for trial in variable.trial:
        taken = trial.shares(shuffled)
        atoms.append(taken[:, :count].argmax(axis=0))
        best = taken.max(axis=0)
        log = log_chance(best, trial.dims, len(shuffled) - 1 - trial.dims)
        toll.append(float(best[count:].mean()) * len(shuffled))
        offset.append(float(log[count:].mean()) - 1.0)
        logs.append(log - offset[-1])
    together = np.array(logs)
    kind = together[:, :count].argmax(axis=0)
    top = together.max(axis=0)
    largest = top[count:].reshape(-1, count).max(axis=1)
    atom = np.array(atoms)[kind, np.arange(count)]
    return Score(variable, top[:count], largest, kind, atom, np.array(toll), np.array(offset))
