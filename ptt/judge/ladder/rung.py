"""One rung of a ladder: a nested model must not fit worse than the one that it extends, so several starts are tried."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from ptt.effects.layout import shape_of, sizes
from ptt.effects.parameter import Parameter
from ptt.effects.sudden import Sudden
from ptt.fitting.chunks import LONG
from ptt.fitting.moment import exchanged, place_own_moments
from ptt.fitting.result import FitResult, sound_rows
from ptt.fitting.solve import acts_on_base, fit, hold_to_base, with_rounds_beside
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem

LITTLE = 0.5  # nats of log density, within which the earlier fit is kept
TURNS = 4  # of trying other starts, at most


def fit_rung(rung: Model, problem: Problem, noise: Noise | None, before: FitResult | None = None) -> FitResult:
    """Fit a model from several starts, and keep the likeliest fit.

    Searched values (a moment, a length) may end in a local optimum in which the model fits worse than the nested one
    before it. So the fit is repeated from the values of that one, with sudden effects moved to the rows that show them,
    and with effects in other forms.

    Args:
        rung: the model.
        problem: the readings.
        noise: the noise floor; None takes the problem's.
        before: fit of the nested model before it; None where there is none.

    Returns:
        The fit.
    """
    best = fit(rung, problem, noise=noise)
    if problem.table.rows > LONG or not _may_have_local_optima(rung):
        return best
    if before is not None and (grown := _started_from(rung, before)) is not rung:
        best = _better(fit(grown, problem, noise=noise), best, problem)
    given = any(isinstance(term.effect, Sudden) and len(term.theta) for term in rung.terms)  # and so are its moments
    for _ in range(0 if given else TURNS):
        last = best
        for other in _other_starts(best, rung, problem):
            best = _better(fit(other, problem, noise=noise), best, problem)
        if best is last:
            break
    return best


def with_frames_of_base(
    rung: Model, problem: Problem, noise: Noise | None = None, before: FitResult | None = None
) -> Problem:
    """The run with its frames held where base reflectors put them: free ones could absorb an effect.

    Args:
        rung: the model; its effects of the tracker, which move the reflectors' readings too, are fitted first.
        problem: the readings.
        noise: the noise floor; None takes the problem's.
        before: fit of the nested model before it; None where there is none.

    Returns:
        The problem with frames held; as given where there are no reflectors.
    """
    if problem.base is not None and any(acts_on_base(term) for term in rung.terms):
        rung = fit_rung(rung, with_rounds_beside(rung, problem, noise), noise, before).model
    return hold_to_base(rung, problem)


def _may_have_local_optima(model: Model) -> bool:
    """Whether a model has several effects, one of them with searched values and no fitted ones yet.

    Searched values of fitted effects are kept.
    """
    searched = [t for t in model.terms if not len(t.theta) and any(p.role != "linear" for p in t.effect.parameters)]
    return bool(searched) and len(model.terms) > 1


def _started_from(rung: Model, before: FitResult) -> Model:
    """The model with the fitted terms of the nested one as start; the model itself where there are none to take."""
    known = {term.effect.key: term for term in before.model.terms if len(term.theta)}
    if not any(term.effect.key in known for term in rung.terms if not len(term.theta)):
        return rung
    return replace(rung, terms=tuple(t if len(t.theta) else known.get(t.effect.key, t) for t in rung.terms))


def _other_starts(fitted: FitResult, rung: Model, problem: Problem) -> Iterator[Model]:
    """Other starts: sudden effects at other moments, and new effects in other forms."""
    new = {term.effect.key for term in rung.terms if not len(term.theta)}
    yield from _other_forms(fitted.model, new, problem)
    if any(isinstance(term.effect, Sudden) for term in fitted.model.terms):
        dated = place_own_moments(fitted, problem)
        if dated is not fitted.model:
            yield dated
        yield from exchanged(fitted)
        yield from _sought_again(fitted.model, [t.effect.key for t in rung.terms if not len(t.theta)])


def _sought_again(model: Model, new: Sequence[str]) -> Iterator[Model]:
    """The model with the moment of one new sudden effect sought anew beside the others, which may have come after it.

    A knock that is added before the guide that errs is found where the guide errs most.
    """
    for index, term in enumerate(model.terms):
        if isinstance(term.effect, Sudden) and term.effect.key in new and len(new) > 1:
            empty = replace(term, theta=term.theta[:0], std=None, measured=None)
            yield replace(model, terms=(*model.terms[:index], empty, *model.terms[index + 1 :]))


def _other_forms(model: Model, new: set[str], problem: Problem) -> Iterator[Model]:
    """The model with one new effect in another form, which gross errors may have kept the first fit from finding."""
    joints = problem.view.joints
    for index, term in enumerate(model.terms):
        effect, own = term.effect, shape_of(term.effect, term.theta, joints)
        amounts = torch.cat([part for part, p in _parts(term, joints) if p.role == "linear"])
        for meant in effect.meant_by(problem.view, {}, amounts) if own and effect.key in new else ():
            other = {stem: meant.get(stem, value) for stem, value in own.items()}
            if any(not torch.equal(other[stem], value) for stem, value in own.items()):
                theta = torch.cat([other.get(p.stem, part) for part, p in _parts(term, joints)])
                terms = (*model.terms[:index], replace(term, theta=theta), *model.terms[index + 1 :])
                yield replace(model, terms=terms)


def _parts(term: Term, joints: int) -> list[tuple[Tensor, Parameter]]:
    """Each parameter with its values."""
    parts = torch.split(term.theta, list(sizes(term.effect, joints)))
    return list(zip(parts, term.effect.parameters, strict=True))


def _better(one: FitResult, other: FitResult, problem: Problem) -> FitResult:
    """The likelier fit; within `LITTLE` nats the second one."""
    return one if log_density(one, problem) > log_density(other, problem) + LITTLE else other


def log_density(fitted: FitResult, problem: Problem) -> float:
    """Log density of the readings, nats, with densities in 1/mm.

    Outliers count as a density of one, as if spread evenly over about a millimetre.

    Args:
        fitted: the fit.
        problem: its readings.
    """
    rows = sound_rows(problem, fitted)
    left = np.square(fitted.residual[rows] @ fitted.noise.whitener.T).sum()
    return float(fitted.noise.log_density(int(rows.sum())) - 0.5 * left)
