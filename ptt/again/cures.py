"""Cures: an effect of a solved model that is gone, whatever share of it the model had given to its neighbours."""

from dataclasses import replace

import numpy as np

from ptt.again.before import Before
from ptt.again.changes import CHANGE_ODDS
from ptt.again.figures import moved_of
from ptt.again.supposed import stand_at, suppose
from ptt.again.weigh import Weighed, weigh
from ptt.diagnosis.evidence.noise_level import starting_noise
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.plainest import PLAIN_NATS
from ptt.diagnosis.telling.steps import BESIDE_NATS, TIE_NATS
from ptt.effects import Library
from ptt.progress import Tell
from ptt.run.problem import Problem

SOME = 0.5  # share of an effect that is left from which it is not gone


def with_cures(found: Weighed, problem: Problem, known: Library, tell: Tell) -> Weighed:
    """The best explanation of a run, effects that are wholly gone among them.

    Where the first run could not part two effects, the values of both are uncertain together. A cured one is at zero
    now whatever it was, so what the first run had taken from its neighbours is theirs again: that is another prior of
    the run, not a change of so many values by what the model says of them.

    Args:
        found: the best explanation without.
        problem: the run.
        known: effects by name.
        tell: told what is being done.

    Returns:
        An explanation with cures where it does better by more than a tie.
    """
    while found.new or any(change.effect.key not in found.before.cured for change in found.changed):
        tried = {key: cured(found.before, key) for key in _worth_a_try(found, problem)}
        ends = {key: weigh(before, problem, known, tell, found) for key, before in tried.items()}
        ends = {key: end for key, end in ends.items() if _is_cure(end, key, found)}
        best = max(ends, key=lambda key: _worth(ends[key]), default=None)
        if best is None:
            break
        clearly = BESIDE_NATS if ends[best].new else PLAIN_NATS
        if _worth(ends[best]) - _odds(found) < _worth(found) + clearly:
            break
        others = [key for key, end in ends.items() if key != best and _worth(end) > _worth(ends[best]) - TIE_NATS]
        alike = {**found.alike, best: tuple(f"{key} as a whole" for key in others)}
        found = replace(weigh(tried[best], problem, known, tell), alike=alike)
    return found


def _worth_a_try(found: Weighed, problem: Problem) -> list[str]:
    """Effects of several values whose cure alone explains clearly more than a machine that is the same."""
    before = found.before
    whole = [change.effect.key for change in found.changes if change.whole and change.effect.key not in before.cured]
    least = _plain(before, found, problem) + _odds(found)
    return [key for key in whole if _plain(cured(before, key), found, problem) > least]


def _is_cure(end: Weighed, key: str, found: Weighed) -> bool:
    """Whether an effect that is taken to be gone leaves nothing that would have to be made good for."""
    (whole,) = (change for change in end.changed if change.effect.key == key)
    most = max(moved_of(end, [whole]), key=lambda one: abs(one.before))
    return len(end.new) <= len(found.new) and most.now / most.before < SOME


def cured(before: Before, key: str) -> Before:
    """The same machine with one effect gone.

    Args:
        before: the solved model.
        key: of the effect.
    """
    return replace(before, cured=before.cured | {key})


def _plain(before: Before, found: Weighed, problem: Problem) -> float:
    """Score of a machine on which nothing else has happened, nats."""
    rows = np.isin(np.arange(problem.table.rows), found.system.rows)
    at = stand_at(before, np.zeros(before.width), problem.masked(~rows), found.noise)
    supposed = suppose(before, at, problem, (), (), found.noise, starting_noise(problem)[1], rows, {})
    return Scorer(supposed.system).score((), WHITE).total


def _worth(found: Weighed) -> float:
    """Score of an explanation; something new has to be worth as much more as elsewhere."""
    return found.state.total - (BESIDE_NATS if found.new else 0.0)


def _odds(found: Weighed) -> float:
    return CHANGE_ODDS + float(np.log(max(len(found.changes), 1)))
