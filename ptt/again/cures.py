"""Cures: effects of a solved model that are zero now, whatever the model's fit had attributed to them."""

from dataclasses import replace

import numpy as np

from ptt.again.changes import CHANGE_ODDS
from ptt.again.explanation import Explanation, find_explanation
from ptt.again.figures import estimate_moves
from ptt.again.linear_problem import build_linear_problem, expansion_point
from ptt.again.prior import Prior
from ptt.diagnosis.evidence.noise_level import starting_noise
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.plainest import PLAIN_NATS
from ptt.diagnosis.telling.steps import BESIDE_NATS
from ptt.diagnosis.telling.ties import TIE_NATS
from ptt.effects import Library
from ptt.progress import Tell
from ptt.run.problem import Problem

SOME = 0.5  # share of an effect that is still there, from which it is not cured


def with_cures(found: Explanation, problem: Problem, known: Library, tell: Tell) -> Explanation:
    """The best explanation of a run, with effects that are cured.

    Where the model's own run could not separate two effects, their values are correlated. A cured effect is zero now
    whatever its fitted value was, and the others then have the values that the posterior gives them without it: that is
    another prior for the run, not a change of each value from its fitted one.

    Args:
        found: the best explanation without cures.
        problem: the run.
        known: effects by name.
        tell: told what is being done.

    Returns:
        The explanation with the cures that the evidence clearly supports.
    """
    while found.new or any(change.effect.key not in found.prior.cured for change in found.changed):
        tried = {key: cured(found.prior, key) for key in _worth_a_try(found, problem)}
        ends = {key: find_explanation(prior, problem, known, tell, found) for key, prior in tried.items()}
        ends = {key: end for key, end in ends.items() if _is_cure(end, key, found)}
        best = max(ends, key=lambda key: _worth(ends[key]), default=None)
        if best is None:
            break
        clearly = BESIDE_NATS if ends[best].new else PLAIN_NATS
        if _worth(ends[best]) - _odds(found) < _worth(found) + clearly:
            break
        others = [key for key, end in ends.items() if key != best and _worth(end) > _worth(ends[best]) - TIE_NATS]
        alike = {**found.alike, best: tuple(f"{key} as a whole" for key in others)}
        found = replace(find_explanation(tried[best], problem, known, tell), alike=alike)
    return found


def _worth_a_try(found: Explanation, problem: Problem) -> list[str]:
    """Effects of several values whose cure alone scores clearly higher than an unchanged machine."""
    prior = found.prior
    whole = [change.effect.key for change in found.changes if change.whole and change.effect.key not in prior.cured]
    least = _plain(prior, found, problem) + _odds(found)
    return [key for key in whole if _plain(cured(prior, key), found, problem) > least]


def _is_cure(end: Explanation, key: str, found: Explanation) -> bool:
    """Whether a supposed cure is one: little of the effect is estimated back, and nothing new takes its place."""
    (whole,) = (change for change in end.changed if change.effect.key == key)
    most = max(estimate_moves(end, [whole]), key=lambda one: abs(one.before))
    return len(end.new) <= len(found.new) and most.now / most.before < SOME


def cured(prior: Prior, key: str) -> Prior:
    """The prior with one more effect cured.

    Args:
        prior: the solved model.
        key: of the effect.
    """
    return replace(prior, cured=prior.cured | {key})


def _plain(prior: Prior, found: Explanation, problem: Problem) -> float:
    """Score of a prior without any change or new effect, nats."""
    rows = np.isin(np.arange(problem.table.rows), found.system.rows)
    at = expansion_point(prior, np.zeros(prior.width), problem.masked(~rows), found.noise)
    linear_problem = build_linear_problem(prior, at, problem, (), (), found.noise, starting_noise(problem)[1], rows, {})
    return Scorer(linear_problem.system).score((), WHITE).total


def _worth(found: Explanation) -> float:
    """Score of an explanation, nats; one with something new has to exceed others by the margin of a diagnosis."""
    return found.state.total - (BESIDE_NATS if found.new else 0.0)


def _odds(found: Explanation) -> float:
    return CHANGE_ODDS + float(np.log(max(len(found.changes), 1)))
