"""What is to be explained and with what, and linearised problems of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.candidates import present_candidates
from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.search.turn import Turn, shapes_of
from ptt.diagnosis.unknown.span import Span
from ptt.effects import Effect, Library
from ptt.fitting.linear import Linear
from ptt.fitting.result import FitResult
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem


@dataclass(frozen=True)
class Asked:
    """What is to be explained, and with what.

    Attributes:
        model: the model as given.
        problem: the readings.
        known: effects by name.
        tell: callback for progress.
        steps: how many effects may be added.
        span: of the run that the rows are a part of; None where they are all of it.
        freedom: degrees of freedom behind the noise floor.
    """

    model: Model
    problem: Problem
    known: Library
    tell: Tell
    steps: int
    span: Span | None
    freedom: float


def open_turn(
    asked: Asked, turn: Turn, problem: Problem, fitted: FitResult, candidates: Sequence[Effect], gross: np.ndarray,
    linear: Linear | None = None, *, unknown: bool = True,
) -> Scorer:  # fmt: skip
    """Linearise at a fit with all candidates and blocks, nothing scored yet.

    Args:
        asked: what is to be explained.
        turn: the turn of the search, for its noise, moments, periods and barred names.
        problem: the readings without those that open a run.
        fitted: fit of the turn's model.
        candidates: effects that may be missing.
        gross: rows left out, (n,) bool.
        linear: columns of all effects, where they were linearised already.
        unknown: with blocks; else effects alone.

    Returns:
        A scorer of the system.
    """
    rows = problem.used & ~gross & np.isfinite(fitted.residual).all(axis=1)
    shapes = {effect.key: shapes_of(effect, problem.view, turn.moments) for effect in candidates}
    system = build_row_system(
        fitted, problem, candidates, turn.noise, asked.freedom, rows, turn.periods, shapes, asked.span, linear,
        unknown=unknown,
    )  # fmt: skip
    return Scorer(system, asked.model.keys, asked.steps, turn.barred)


def scorer_at(asked: Asked, found: Found, fitted: FitResult, problem: Problem) -> tuple[Scorer, dict[str, str]]:
    """Linearise the rows of an explanation at another fit, nothing scored yet.

    Args:
        asked: what is to be explained.
        found: the explanation.
        fitted: the fit.
        problem: the readings without those that open a run.

    Returns:
        A scorer, and effect -> what the data lack for it.
    """
    candidates, untestable = present_candidates(fitted, problem, asked.known, found.seen)
    rows = problem.used & ~found.gross & np.isfinite(fitted.residual).all(axis=1)
    system = build_row_system(
        fitted, problem, candidates, found.noise, asked.freedom, rows, found.periods, span=asked.span
    )
    scorer = Scorer(system, asked.model.keys, asked.steps, found.scorer.barred, fields=found.scorer.fields)
    return scorer, untestable
