"""Reversals: how soon after one a run shows that play is taken up, and the uncertainty nearer to one.

Readings far behind a reversal show how much motion is lost, not along which travel: play and wind-up (Dahl, A Solid
Friction Model, 1968) look alike to them. Commands that reverse by less than that travel were not measured.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from ptt.effects.layout import sizes
from ptt.effects.memory import gradual_reversal
from ptt.effects.parameter import Parameter
from ptt.effects.phrases import listed
from ptt.effects.reversal import Backlash, Windup, gap_of
from ptt.fitting.chunks import sampled_if_long
from ptt.fitting.observability import Combination
from ptt.fitting.result import FitResult
from ptt.fitting.stated import with_fitted_terms
from ptt.model.chain import EffectTerms, linearise
from ptt.model.model import Term, parameter_names
from ptt.run.problem import Problem
from ptt.run.view import View

SEEN_CHI2 = 4.0  # chi-squared by which wind-up over a travel has to differ from play to be told from it
TRAVEL_SHARES = np.geomspace(10.0, 1e-3, 33)  # tried travels of a wind-up, as shares of the usual one
LONG_TRAVEL = 0.25  # share of the usual travel from which an open wind-up is worth a word: hardly a command ends nearer
LARGER_ERRORS = 5.0  # standard errors by which a gap is tried larger; a fifth of it at the least
SMALL_GAP = 0.2  # share of the largest gap below which a gap is not spoken of
AT_ONCE = 1e-4  # share of the usual travel of a wind-up over which it is play
WINDUP_CHANCE = 0.5  # probability that lost motion is wind-up rather than play where no reading tells


def with_turns(fitted: FitResult, problem: Problem) -> FitResult:
    """Add to a fit with play the longest travel of a wind-up that its readings cannot tell from it.

    Args:
        fitted: the fit.
        problem: the readings that it was fitted to; of a long run stretches stand for all.

    Returns:
        The fit; as given where it has no play.
    """
    terms = [(term.effect, term.theta) for term in fitted.model.terms]
    if not any(isinstance(effect, Backlash) for effect, _ in terms):
        return fitted
    few = sampled_if_long(problem.masked(fitted.outliers))
    used, sigma = torch.as_tensor(few.used), fitted.noise.total / np.sqrt(3.0)
    jacobian = linearise(terms, few.view).jacobian
    usual = _travel(fitted.model.file.machine.kind).usual
    open_yet, lengths = torch.ones(few.view.joints, dtype=torch.bool), torch.zeros(few.view.joints, dtype=torch.float64)
    for share in TRAVEL_SHARES:
        trial = torch.full_like(lengths, usual * float(share))
        square = (unturned(terms, few.view, jacobian, trial)[used] / sigma).square().sum(dim=(0, 1)) / WINDUP_CHANCE
        lengths = torch.where(open_yet & (square < SEEN_CHI2), trial, lengths)
        open_yet = open_yet & (square >= SEEN_CHI2)
    least = [name for term in fitted.model.terms for name in _never_taken_up(term, few, sigma)]
    own, covariance = np.flatnonzero(np.isin(fitted.layout.names, least)), fitted.covariance.copy()
    covariance[own, own] += fitted.layout.scale[own] ** 2
    turned = replace(fitted, turns=tuple(lengths.tolist()), least=tuple(least), covariance=covariance)
    return with_fitted_terms(turned) if least else turned


def marked(fitted: FitResult, term: Term) -> Term:
    """A play term without standard errors for gaps that have only a lower bound.

    Args:
        fitted: the fit, with its turns.
        term: one of its effects.
    """
    if not isinstance(term.effect, Backlash) or term.std is None:
        return term
    own = np.isin(_gap_names(term, fitted.model.file.machine.kind), fitted.least)
    std = term.std.clone()
    std[:-1][torch.as_tensor(own)] = torch.nan
    return replace(term, std=std)


def _gap_names(term: Term, kind: str) -> list[str]:
    """Names of the gaps of a play among a fit's unknowns."""
    return [f"{term.effect.key} {name}" for name in parameter_names(term.effect, kind, len(term.theta) - 1)[:-1]]


def _never_taken_up(term: Term, problem: Problem, sigma: float) -> list[str]:
    """Names of gaps that no move of the run takes up on both sides: a larger gap would give the same readings."""
    gap, waits = gap_of(term.theta) if isinstance(term.effect, Backlash) else (torch.zeros(0), False)
    if not waits or term.std is None:
        return []
    view, names = problem.view, _gap_names(term, problem.file.machine.kind)
    by_joint, found = view.jacobian.square().sum(dim=1).numpy(), []  # shape: (n, k)
    for joint in np.flatnonzero((gap > 0.0).numpy()):
        larger = term.theta.clone()
        larger[joint] += max(LARGER_ERRORS * float(term.std[joint].nan_to_num()), SMALL_GAP * float(gap[joint]))
        more = (term.effect.shift(larger, view) - term.effect.shift(term.theta, view))[:, joint].numpy()
        square = 0.0
        for run in np.unique(view.run[problem.used].numpy()):  # what is the same all along, zeros and frames have
            rows = problem.used & (view.run.numpy() == run)
            apart = more[rows] - np.median(more[rows])
            square += float((by_joint[rows, joint] * apart**2).sum()) / sigma**2
        found += [names[joint]] if square < 1.0 else []
    return found


def open_turns(fitted: FitResult) -> tuple[Combination, ...]:
    """Combinations for joints whose readings do not tell along which travel their play is taken up.

    Args:
        fitted: the fit, with its turns.

    Returns:
        One for each effect that is play, where there is such a joint.
    """
    found, noun = [], fitted.model.file.machine.noun
    for term in fitted.model.terms:
        if joints := _unseen(fitted, term):
            which = f"{noun}{'s' * (len(joints) > 1)} {listed([str(joint) for joint in joints])}"
            partner = f"a wind-up over {_windup(fitted, joints)} (short moves back and forth would tell)"
            found.append(Combination(term.effect.key, f"whether play of {which} is taken up at once", (partner,), {}))
    return tuple(found)


def like_windup(fitted: FitResult, term: Term) -> str:
    """Words on a wind-up that a play may be instead, as no reading lies near a reversal; '' where there is none.

    Args:
        fitted: the fit, with its turns.
        term: one of its effects.
    """
    joints = _unseen(fitted, term)
    if not joints:
        return ""
    return f"wind-up that is complete within {_windup(fitted, joints)} of a reversal, where no reading was taken"


def like_play(fitted: FitResult, term: Term, problem: Problem) -> str:
    """Words on play that a wind-up may be instead, of joints that no reading shows on the way; '' where there are none.

    Args:
        fitted: the fit, for its noise.
        term: one of its effects.
        problem: the readings that it was fitted to.
    """
    if not isinstance(term.effect, Windup):
        return ""
    view, used, sigma = problem.view, problem.used & ~fitted.outliers, fitted.noise.total / np.sqrt(3.0)
    usual = _travel(problem.file.machine.kind).usual
    heights, length = term.theta.view(2, -1)[0].abs(), AT_ONCE * usual
    at_once = torch.cat([term.theta.view(2, -1)[0], torch.full_like(heights, length)])
    shift, play = (term.effect.shift(theta, view)[used].numpy() for theta in (term.theta, at_once))
    columns, like = view.jacobian[used].numpy() / sigma, list[str]()  # shape: (n, 3, k)
    for joint in np.flatnonzero((heights > SMALL_GAP * heights.max()).numpy()):
        own = columns[:, :, joint]
        sides = np.stack([(own * play[:, joint, None]).ravel(), own.ravel()], axis=1)  # what its zero takes is no sign
        moved = (own * shift[:, joint, None]).ravel()
        left = moved - sides @ np.linalg.lstsq(sides, moved, rcond=None)[0]
        like += [str(joint + 1)] if left @ left < SEEN_CHI2 else []
    noun = problem.file.machine.noun
    return f"play of {noun}{'s' * (len(like) > 1)} {listed(like)} that is taken up at once" if like else ""


def _unseen(fitted: FitResult, term: Term) -> list[int]:
    """Numbers, from 1, of joints with play for which no reading tells how it is taken up."""
    if not isinstance(term.effect, Backlash) or not fitted.turns:
        return []
    usual = _travel(fitted.model.file.machine.kind).usual
    gap, long = gap_of(term.theta)[0].numpy(), np.array(fitted.turns) > LONG_TRAVEL * usual
    return [int(joint) + 1 for joint in np.flatnonzero(long & (gap > SMALL_GAP * np.abs(gap).max()))]


def _windup(fitted: FitResult, joints: Sequence[int]) -> str:
    """The longest travel of a wind-up of some joints that no reading tells from play."""
    return f"{max(fitted.turns[joint - 1] for joint in joints):.2g} {_travel(fitted.model.file.machine.kind).unit}"


def likely_turns(turns: Sequence[float], kind: str) -> Tensor:
    """Travels of wind-ups that are as likely as play, (k,) mm or rad: no longer than the usual one.

    Args:
        turns: longest travels that no reading told from play.
        kind: of the machine.
    """
    return torch.tensor(turns, dtype=torch.float64).clamp(max=_travel(kind).usual)


def unturned(terms: EffectTerms, view: View, jacobian: Tensor, lengths: Tensor) -> Tensor:
    """Standard deviations of the tool position in case play is a wind-up that has not turned over yet.

    Args:
        terms: effects of the machine with their parameters.
        view: n rows.
        jacobian: of the reading by all parameters of the terms, (n, 3, p).
        lengths: travel of such a wind-up, (k,) mm or rad; zero where readings tell that it is none.

    Returns:
        (n, 3, k) mm, one column a joint.
    """
    found, first = torch.zeros(view.rows, 3, view.joints, dtype=torch.float64), 0
    for effect, theta in terms:
        if isinstance(effect, Backlash):
            gap = gap_of(theta)[0].clamp(min=0.0)  # below zero it is what a controller adds, and that is at once
            friction = gradual_reversal(view, lengths.clamp(min=1e-12))
            behind = 1.0 - friction * view.direction  # shape: (n, k), of the change that is still to come
            found += jacobian[:, :, first : first + view.joints] * (gap * behind)[:, None]
        first += sum(sizes(effect, view.joints))
    return found * WINDUP_CHANCE**0.5


def _travel(kind: str) -> Parameter:
    """The length of a wind-up on a kind of machine."""
    return next(parameter for parameter in Windup.parameters if parameter.stem == "length").on(kind)
