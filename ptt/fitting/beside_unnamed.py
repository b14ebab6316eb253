"""Beside the unnamed: how far a fit is open because sizes of the drawing that its model has not are off as well."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from ptt.effects import Effect, library
from ptt.fitting.evidence import NARROWEST, WIDEST, learn
from ptt.fitting.linear import Trial, linear_columns
from ptt.fitting.posterior import Posterior
from ptt.fitting.prior import FRAME
from ptt.fitting.result import FitResult
from ptt.fitting.stated import fitted_terms
from ptt.fitting.unnamed import Unnamed
from ptt.fitting.whitened import Total
from ptt.model.model import rival
from ptt.run.problem import Problem

LONG = 10_000  # rows, beyond which no columns of what a model does not have are held
EXCLUDED = 1.5  # nats for leaving a size out from which readings say it is none: what they do not know costs less
ROUNDING = 1e-12  # share of the largest square that is rounding


def beside_unnamed(fitted: FitResult, problem: Problem) -> FitResult:
    """A fit with its errors as far as sizes of the drawing that its model does not have leave them open.

    A few values make good, where a run went, for all sizes that are off, and on every real machine all are a little:
    elsewhere they do not, and they are not what they say. So all sizes are learned together, each as large as the
    readings let it be. That may put the model's own values elsewhere: by so much, and by what is open then, they may
    be off, by the chance that each of these sizes has: even where readings know nothing of it.

    Args:
        fitted: the fit.
        problem: its run.

    Returns:
        The fit; as given of a long run, or where every size is named.
    """
    known = len(fitted.unknowns) > 0 and problem.table.rows <= LONG
    trials = unnamed_sizes(fitted.model.keys, problem) if known else []
    if not trials:
        return fitted
    linear = linear_columns(fitted, problem.masked(fitted.outliers), trials, fitted.noise)
    learned = _Learned(fitted, linear.sums(np.zeros(problem.table.rows, dtype=int), 1).total)
    base, some = learned.beside(()), linear.trials
    best = learned.beside(some)
    while some:
        least = some[int(np.argmin(best.scales[len(fitted.layout.kinds) :]))]
        fewer = tuple(trial for trial in some if trial is not least)
        other = learned.beside(fewer)
        if other.total < best.total + EXCLUDED:
            break
        some, best = fewer, other
    if not some:
        return fitted
    width, told = len(fitted.unknowns), np.zeros(len(best.values))
    told[:width] = np.where(fitted.layout.owner >= 0, fitted.unknowns, 0.0)  # frames move on from where they are
    square = best.covariance + np.outer(best.values - told, best.values - told)
    square[:width, :width] -= base.covariance
    size, ways = np.linalg.eigh(square * float(expit((best.total - base.total) / len(some))))
    kept = size > ROUNDING * max(float(size[-1]), 0.0)
    unnamed = Unnamed(tuple(trial.effect for trial in some), ways[:, kept] * np.sqrt(size[kept]))
    result = replace(fitted, unnamed=unnamed)
    return replace(result, model=replace(result.model, terms=fitted_terms(result)))


def unnamed_sizes(keys: Sequence[str], problem: Problem) -> list[Effect]:
    """Sizes of the drawing that a model does not have and a run can test.

    Args:
        keys: of the model's effects.
        problem: the run.
    """
    kind = problem.file.machine.kind
    found = [
        each() for name, each in library().items()
        if each.of_drawing and kind in each.mechanisms and name not in keys and not rival(each(), keys)
    ]  # fmt: skip
    return [effect for effect in found if not effect.needs(problem.view)]


@dataclass(frozen=True)
class _Learned:
    """A linearised run, of which the width of every group of values is learned.

    Attributes:
        fitted: the fit at which it is linearised.
        total: sums of its columns, the fit's unknowns first.
    """

    fitted: FitResult
    total: Total

    def beside(self, trials: Sequence[Trial]) -> Posterior:
        """The fit's unknowns and some further effects, learned together."""
        layout, prior, (gram, side, square, count) = self.fitted.layout, self.fitted.prior, self.total
        columns = np.concatenate([np.arange(len(layout.scale)), *(trial.columns for trial in trials)]).astype(int)
        new = [np.full(len(trial.columns), len(layout.kinds) + index) for index, trial in enumerate(trials)]
        fixed = np.array([kind != "free" for kind in layout.kinds] + [False] * len(trials), dtype=bool)
        scales = np.concatenate([prior.scales, np.ones(len(trials))])
        wide = prior.crowding * max(1.0, self.fitted.chi2 / max(self.fitted.freedom, 1))
        return learn(
            gram[np.ix_(columns, columns)] / wide, side[columns] / wide, square / wide, count / prior.crowding,
            np.concatenate([layout.group, *new]).astype(int), freedom=np.inf, start=scales, wide=FRAME,
            floor=np.where(fixed, scales, NARROWEST), ceiling=np.where(fixed, scales, WIDEST),
        )  # fmt: skip
