"""Weighted least squares of all effects and the tracker frame together, with gross errors and covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from torch import Tensor

from ptt.effects import Effect
from ptt.effects.sudden import Sudden
from ptt.fitting.autocorrelation import excess_scatter, times_of
from ptt.fitting.chunks import LONG, SAMPLE_ROWS, sample_stretches, take
from ptt.fitting.gauss_newton import TOLERANCE
from ptt.fitting.layout import Layout, lay_out
from ptt.fitting.long import LongEvaluator, LongSystem
from ptt.fitting.outliers import inside, linear_residual
from ptt.fitting.prior import Prior, design_effect_of, usual_prior
from ptt.fitting.reach import require_reach
from ptt.fitting.result import FitResult
from ptt.fitting.rounds import Settled, settle
from ptt.fitting.search import open_terms
from ptt.fitting.stated import Witness, state_fit
from ptt.fitting.whitened import Evaluator, Total, WhitenedSystem
from ptt.model.chain import linearise_base, read_base
from ptt.model.model import Model, Term
from ptt.run.holdout import pose_groups
from ptt.run.noise import Noise, guessed_noise
from ptt.run.problem import Problem

COARSE_TOLERANCE = 0.01  # chi-squared still to be gained at which a coarse fit ends


def fit(
    model: Model,
    problem: Problem,
    *,
    robust: bool = True,
    noise: Noise | None = None,
    lean: bool = False,
    coarse: bool = False,
    hopeless: float = np.inf,
) -> FitResult:
    """Fit all effects and frames of a model.

    Args:
        model: effects without values start where `ptt.fitting.search` finds them.
        problem: the readings.
        robust: leave out gross errors; they are named in the result.
        noise: the noise floor; None takes the problem's, or a first guess where it has none.
        lean: skip the confirmation that the set of outliers is stable.
        coarse: stop a hundredth of chi-squared from the end, which is near enough to compare models; errors are stated
            without autocorrelation.
        hopeless: cost (chi-squared and prior) above which the fit is given up.

    Returns:
        The fit; what kept it from converging is in its status.
    """
    noise = noise or problem.noise or guessed_noise()
    begun = _begin_long if problem.table.rows > LONG else _begin
    evaluate, unknowns, kept, prior = begun(model, problem, noise, robust, coarse)
    rows = partial(_RowSums, evaluate, pose_groups(problem.table), robust and not (lean or coarse))
    done = COARSE_TOLERANCE if coarse else TOLERANCE
    found = settle(rows, evaluate.layout, noise, unknowns, kept, prior, done, hopeless)
    return _result(model, problem, evaluate, found, coarse)


def residual_of(model: Model, problem: Problem, noise: Noise | None = None) -> FitResult:
    """Residual of a model as it is: only what a tracker frame may take is fitted; base reflectors hold the frame.

    Args:
        model: its effects are held.
        problem: the readings.
        noise: the noise floor; None as in `fit`.

    Returns:
        The fit of the frame alone.
    """
    held = tuple(hold(term) for term in model.terms if len(term.theta))
    result = fit(replace(model, terms=held), hold_to_base(model, problem), noise=noise)
    return replace(result, model=model)


def hold_to_base(model: Model, problem: Problem) -> Problem:
    """The problem with its frames where base reflectors put them beside what a model says of the tracker.

    Args:
        model: effects of the tracker that have values act on the reflectors.
        problem: the readings.

    Returns:
        The problem with frames held; as given where there are no reflectors.
    """
    told = _told_of_base(model)
    if problem.base is None or not told:
        return problem.anchored()
    return problem.anchored(read_base(_values(told), problem.base.view).numpy())


def with_rounds_beside(model: Model, problem: Problem, noise: Noise | None = None) -> Problem:
    """The problem with base reflectors that scatter from round to round by what effects of the tracker do not explain.

    Args:
        model: effects of the tracker act on the reflectors; a fit is made where some have no values yet.
        problem: the readings.
        noise: the noise floor of that fit; None as in `fit`.

    Returns:
        The problem; as given where there are no reflectors or no such effects.
    """
    base = problem.base
    if base is None or not any(acts_on_base(term) for term in model.terms):
        return problem
    if any(acts_on_base(term) and not len(term.theta) for term in model.terms):
        model = fit(model, problem, noise=noise, lean=True, coarse=True).model
    told = _told_of_base(model)
    reading, columns = linearise_base(_values(told), base.view)
    free = lay_out(model, problem, told).columns()
    return replace(problem, base=base.beside(reading.numpy(), columns.numpy()[..., free]))


def _told_of_base(model: Model) -> list[Term]:
    """Effects that move what is read of reflectors; those without values say nothing yet."""
    return [term for term in model.terms if acts_on_base(term) and len(term.theta)]


def _values(terms: Sequence[Term]) -> list[tuple[Effect, Tensor]]:
    return [(term.effect, term.theta) for term in terms]


def acts_on_base(term: Term) -> bool:
    """Whether an effect moves what is read of reflectors fixed to the base."""
    return term.effect.stage == "metrology"


def hold(term: Term) -> Term:
    """The term with all its parameters fixed."""
    return replace(term, fixed=frozenset(parameter.stem for parameter in term.effect.parameters))


@dataclass(frozen=True)
class _RowSums:
    """`RowSums` of a run at a point, with the rows that count, (n,) bool."""

    evaluate: Evaluator | LongEvaluator
    block: np.ndarray
    sifting: bool
    unknowns: np.ndarray
    kept: np.ndarray

    @property
    def total(self) -> Total:
        return self.evaluate(self.unknowns).sums(self.kept)

    @property
    def design_effect(self) -> float:
        return design_effect_of(self.evaluate(self.unknowns).residual, self.kept, self.block)

    @property
    def sifted(self) -> np.ndarray:
        return _sound(self.evaluate, self.unknowns) if self.sifting else self.kept


def _sound(evaluate: Evaluator | LongEvaluator, unknowns: np.ndarray) -> np.ndarray:
    """Rows that are no gross errors, (n,) bool."""
    problem = evaluate.problem
    return inside(evaluate(unknowns).residual, problem.used, problem, evaluate.noise)


def _begin(
    model: Model, problem: Problem, noise: Noise, robust: bool, coarse: bool
) -> tuple[Evaluator, np.ndarray, np.ndarray, Prior]:
    """Evaluator, starting unknowns, rows that count, and prior."""
    layout = lay_out(model, problem, open_terms(model.terms, problem, noise))
    evaluate = Evaluator(layout, problem, noise, coarse=coarse)
    unknowns = np.clip(layout.start(), layout.lower, layout.upper)
    require_reach(_stood(evaluate(unknowns)), model.terms, problem)
    kept = _without_outliers(evaluate(unknowns), problem, layout, noise) if robust else problem.used.copy()
    return evaluate, unknowns, kept, usual_prior(layout)


def _stood(system: WhitenedSystem) -> np.ndarray:
    """Rows at which the machine can stand, (n,) bool."""
    reached = np.isfinite(system.prediction.reading.numpy()).all(axis=1)
    return np.asarray(reached & np.isfinite(system.jacobian).all(axis=(1, 2)))


def _begin_long(
    model: Model, problem: Problem, noise: Noise, robust: bool, coarse: bool
) -> tuple[LongEvaluator, np.ndarray, np.ndarray, Prior]:
    """`_begin` for a long run, starting from a fit to a sample, which is near enough to find gross errors at once."""
    if any(isinstance(term.effect, Sudden) and not len(term.theta) for term in model.terms):
        model = replace(model, terms=tuple(open_terms(model.terms, problem, noise)))  # its moment may lie between them
    few = fit(model, take(problem, sample_stretches(problem, SAMPLE_ROWS)), robust=robust, noise=noise, coarse=coarse)
    layout = lay_out(model, problem, few.layout.terms)
    evaluate = LongEvaluator(layout, problem, noise)
    reading = evaluate(few.unknowns).prediction.reading.numpy()
    require_reach(np.isfinite(reading).all(axis=1), layout.terms, problem)
    kept = _sound(evaluate, few.unknowns) if robust else problem.used.copy()
    return evaluate, few.unknowns, kept, few.prior


def _without_outliers(system: WhitenedSystem, problem: Problem, layout: Layout, noise: Noise) -> np.ndarray:
    """Rows that remain after a robust fit of the linearised problem, (n,) bool."""
    width = system.jacobian.shape[-1]
    base = np.concatenate(
        [
            system.base_jacobian.reshape(3 * len(system.base_jacobian), width),
            np.diag(layout.held.astype(float))[layout.held],
        ]
    )
    trusted = np.concatenate([system.base_residual.ravel(), np.zeros(int(layout.held.sum()))])
    whole, used = np.full_like(system.residual, np.nan), problem.used
    whole[used], _ = linear_residual(system.residual[used], system.jacobian[used], trusted, base)
    return inside(whole, used, problem, noise)


def _result(
    model: Model, problem: Problem, evaluate: Evaluator | LongEvaluator, found: Settled, coarse: bool
) -> FitResult:
    unknowns, kept = found.unknowns, found.choice
    layout, noise, system = evaluate.layout, evaluate.noise, evaluate(unknowns)
    information, _, chi2, count = system.sums(kept)
    empty = np.zeros((0, 0))
    result = FitResult(
        model, layout, unknowns, empty, empty, system.prediction, system.residual @ np.linalg.inv(noise.whitener).T,
        problem.used & ~kept, noise, 0.0, 1, 0, empty, found.prior, evaluate.calls, found.status,
    )  # fmt: skip
    return state_fit(result, unknowns, information, chi2, count, None if coarse else _witness(system, problem, kept))


def _witness(system: WhitenedSystem | LongSystem, problem: Problem, kept: np.ndarray) -> Witness | None:
    """A function for the autocorrelation of the residuals; None for a long run, whose rows are never held at once."""
    if not isinstance(system, WhitenedSystem) or not system.jacobian.shape[-1]:
        return None
    times = times_of(problem, kept)
    return lambda inverse, scatter: excess_scatter(
        system.jacobian[kept], system.residual[kept], times, inverse, scatter
    )
