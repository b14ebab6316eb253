"""What a run shows beyond a solved model and its changes: diagnosed beside these, unless it was there before."""

from dataclasses import dataclass, replace

import numpy as np

from ptt.again.explanation import Explanation
from ptt.again.figures import errors_of
from ptt.again.words import on_date
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.noise_level import noise_left, wanders_beyond
from ptt.diagnosis.search.excess import NOISE_EXCESS
from ptt.diagnosis.search.rest import look_for_rest
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import Library
from ptt.effects.registry import parse_key
from ptt.fitting.solve import hold
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.axes import rms
from ptt.run.problem import Problem


@dataclass(frozen=True)
class News:
    """What is new in a run.

    Attributes:
        diagnosis: of what the model does not have; None where nothing is new.
        notes: further remarks for the user.
    """

    diagnosis: Diagnosis | None
    notes: tuple[str, ...] = ()


def look_for_news(found: Explanation, model: Model, problem: Problem, known: Library, tell: Tell) -> News:
    """Diagnose what a run shows beside a solved model and its changes.

    Args:
        found: the best explanation.
        model: the solved model with the values of this run, masked effects included.
        problem: the run.
        known: effects by name.
        tell: told what is being done.

    Returns:
        What is new; the diagnosis has to find it as well.
    """
    left = found.prior.left
    if found.new and (size := size_of_new(found)) <= left:
        names = ", ".join(dict.fromkeys(found.system.atoms[key].name for key in found.new))
        then = on_date(found.prior.since)
        return News(
            None, (f"{names} ({size:.1f} um) is no more than the {left:.1f} um that the model left unexplained {then}",)
        )
    if not found.new and not _is_significant(found, problem, tell):
        return News(None)
    tell("what is new")
    still = replace(model, terms=tuple(hold(term) for term in model.terms))
    diagnosis = diagnose(still, problem.masked(found.gross), known)
    return News(None if _nothing_of_machine(diagnosis, known) else diagnosis)


def size_of_new(found: Explanation) -> float:
    """Shift of the readings by what is new, in the run's own frame, rms of the vector, um."""
    off = found.system.in_mm(found.shift_of(found.new).reshape(-1, 3))
    return rms(off)["total"]


def _nothing_of_machine(diagnosis: Diagnosis, known: Library) -> bool:
    """Whether all that is missing is what happened to the set-up during the run."""
    if diagnosis.verdict != "missing":
        return diagnosis.verdict == "nothing-missing"
    return all(known[parse_key(step[0])[0]].of_run for step in diagnosis.suggested)


def _is_significant(found: Explanation, problem: Problem, tell: Tell) -> bool:
    """Whether the residual is more than noise, and more than a machine that has not changed would show."""
    system, state = found.system, found.state
    after, errors = noise_left(system, state).total, errors_of(found, problem)
    if problem.noise is not None and (
        1e3 * np.sqrt(max(after**2 - problem.noise.total**2, 0.0)) <= found.prior.left
        or errors["left"] <= errors["expected"]
    ):
        return False
    if system.errs_by_pose(state.memory) or wanders_beyond(system, state):
        return True
    if problem.noise is not None and after > NOISE_EXCESS * problem.noise.total:
        return True
    tell("rest")
    clean = problem.masked(problem.used & ~np.isin(np.arange(problem.table.rows), system.rows))
    return look_for_rest(system, state, clean).significant
