"""Significance of the best trial function of each variable, on the data and on permuted rows."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ptt.dependence.chance import minus_log_p, slow_excess, slow_spectrum, variance_inflation
from ptt.dependence.contexts import is_direction, is_joint
from ptt.dependence.regressors import TrialFunctions, build_trials, build_varying, orthonormalise
from ptt.dependence.strata import LEAST_POSES, RepeatedPoses, Stratum, build_stratum

STIFF = 4  # columns up to which a curve hardly follows slow error
SECOND = ("temperature", "payload")  # variables that a reversal error may vary with


@dataclass(frozen=True)
class Variable:
    """One variable and its trial functions.

    Attributes:
        name: of the variable.
        second: variable that the effect of a direction varies with, or None.
        stratum: the independent rows on which it is tested.
        raw: its trial functions on those rows.
        trial: its trial functions whitened and orthonormalised.
    """

    name: str
    second: str | None
    stratum: Stratum
    raw: tuple[TrialFunctions, ...]
    trial: tuple[TrialFunctions, ...]

    def on_rows(self) -> tuple[TrialFunctions, ...]:
        """Raw trial functions on every row."""
        return tuple(replace(trials, columns=self.stratum.expand(trials.columns)) for trials in self.raw)


@dataclass(frozen=True)
class Score:
    """-log p of a variable's best trial function, for r residuals and B permutations.

    Attributes:
        variable: the variable.
        found: of each residual, (r,).
        chance: largest over all residuals in each permutation, (B,).
        kind: index of the best kind for each residual, (r,).
        index: of the best trial function in that kind, (r,).
        parameters: effective number of parameters of each kind, the search included: rows x mean share by chance.
        offset: subtracted from -log p of each kind, so that under permutation its mean is 1, as without a search.
    """

    variable: Variable
    found: np.ndarray
    chance: np.ndarray
    kind: np.ndarray
    index: np.ndarray
    parameters: np.ndarray
    offset: np.ndarray

    def corrected(self, r: int, slow: int) -> float:
        """-log p for a residual, with its odds share / (1 - share) reduced for slow error.

        Args:
            r: index of the residual.
            slow: number of lowest cosines over the travel that count as slow.

        Returns:
            The corrected -log p; for time itself the uncorrected one.
        """
        if self.variable.name == "time":
            return float(self.found[r])
        trial, white = self.variable.trial[self.kind[r]], self.variable.stratum.white[:, r]
        columns = trial.pick(int(self.index[r]))
        fitted = columns @ (columns.T @ white)
        share = float(fitted @ fitted / max(float(white @ white), 1e-30))
        odds = share / max(1.0 - share, 1e-7) / self._inflation(columns, fitted, white - fitted, r, slow)
        log = minus_log_p(np.array([odds / (1.0 + odds)]), trial.dims, len(white) - 1 - trial.dims)
        return float(log[0] - self.offset[self.kind[r]])

    def _inflation(self, columns: np.ndarray, fitted: np.ndarray, left: np.ndarray, r: int, slow: int) -> float:
        """Variance inflation by slow error, estimated from repeats within poses if enough, else from the residual."""
        stratum = self.variable.stratum
        if stratum.means and stratum.within is not None:
            slow = min(slow, len(stratum.within) // 4)
            travel = slow_spectrum(stratum.expand(fitted), slow)
            return variance_inflation(travel, slow_excess(stratum.within[:, r], slow))
        if columns.shape[1] > STIFF:
            # A flexible curve would absorb the slow error; a stiff one leaves it in the residual.
            columns = next(trial.columns for trial in self.variable.trial if trial.kind in ("smooth", "levels"))
            left = fitted + left
            left = left - columns @ (columns.T @ left)
        slow = min(max(slow, 3 * columns.shape[1]), len(left) // 4)
        removed = slow_spectrum(columns, slow, whole=False)
        return variance_inflation(slow_spectrum(fitted, slow), slow_excess(left, slow, removed))


def build_scores(
    residual: np.ndarray, contexts: dict[str, np.ndarray], poses: RepeatedPoses, *, seed: int
) -> list[Score]:
    """Score every variable against every residual.

    Args:
        residual: (n, r), each of about unit variance, single precision.
        contexts: (n,) each.
        poses: repeated visits.
        seed: of the permutations.

    Returns:
        A score for each variable, and for each interaction of a direction with temperature or payload.
    """
    rows = build_stratum(residual, poses, means=False, seed=seed)
    means = rows
    if len(poses.size) < len(residual):
        means = build_stratum(residual, poses, means=True, seed=seed)
    return [_score(variable, residual.shape[1]) for variable in _variables(contexts, rows, means)]


def _variables(contexts: dict[str, np.ndarray], rows: Stratum, means: Stratum) -> Iterator[Variable]:
    for name, column in contexts.items():
        stratum = means if means is not rows and rows.poses.is_constant(column) else rows
        if stratum.rows < LEAST_POSES:
            continue
        yield _variable(name, None, stratum, build_trials(stratum.values(column), periodic=is_joint(name)))
    for name, column in contexts.items():
        for second in SECOND:
            if is_direction(name) and second in contexts:
                yield _variable(name, second, rows, build_varying(column, contexts[second]))


def _variable(name: str, second: str | None, stratum: Stratum, raw: tuple[TrialFunctions, ...]) -> Variable:
    trial = tuple(orthonormalise(trials, stratum.nuisance, stratum.whiten) for trials in raw)
    return Variable(name, second, stratum, raw, trial)


def _score(variable: Variable, count: int) -> Score:
    """Score a variable; each kind is offset by its mean on permuted rows, so that none wins by more trials."""
    shuffled = variable.stratum.shuffled
    logs, trials, parameters, offset = [], [], [], []
    for trial in variable.trial:
        taken = trial.shares(shuffled)
        trials.append(taken[:, :count].argmax(axis=0))
        best = taken.max(axis=0)
        log = minus_log_p(best, trial.dims, len(shuffled) - 1 - trial.dims)
        parameters.append(float(best[count:].mean()) * len(shuffled))
        offset.append(float(log[count:].mean()) - 1.0)
        logs.append(log - offset[-1])
    together = np.array(logs)
    kind = together[:, :count].argmax(axis=0)
    top = together.max(axis=0)
    largest = top[count:].reshape(-1, count).max(axis=1)
    index = np.array(trials)[kind, np.arange(count)]
    return Score(variable, top[:count], largest, kind, index, np.array(parameters), np.array(offset))
