"""Climb a ladder: add or remove effects one by one, refit, and measure training and held-out errors after each."""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from itertools import pairwise
from operator import add

import numpy as np

from ptt.effects import Effect
from ptt.errors import PosesError, UntestedError
from ptt.fitting.beside_unnamed import beside_unnamed
from ptt.fitting.chunks import LONG
from ptt.fitting.held_frame import with_frame_doubt
from ptt.fitting.long import held_out_residual
from ptt.fitting.masked import masked_effects
from ptt.fitting.opening import entering_rows, told_aside, untold_rows, without_opening
from ptt.fitting.report import report_fit
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit, hold, hold_to_base, residual_of
from ptt.fitting.turns import with_turns
from ptt.judge.ladder.ladder import Ladder, LadderStep
from ptt.judge.ladder.rung import fit_rung, log_density, with_frames_of_base
from ptt.model.model import Model, Term, require_fits
from ptt.progress import Progress, unwatched
from ptt.run.axes import rms
from ptt.run.given_noise import given_noise
from ptt.run.holdout import blocks_beside, folds, pose_groups
from ptt.run.noise import REPEATS, Noise
from ptt.run.problem import Problem
from ptt.run.ranges import ranges_of
from ptt.run.smooth import LIKELIER, SMOOTHLY, smoothly

FOLDS = 5
FRAME_ROWS = 4  # readings of a frame that must stay in the fit for its held-out ones to count
QUIETER = 0.8  # ratio to the noise from repeats, below which the model is taken to explain part of their scatter
GIVEN, REFIT = "as given", "refit"


def climb(model: Model, problem: Problem, effects: Sequence[Effect], *, progress: Progress = unwatched) -> Ladder:
    """Add effects one after the other and refit everything jointly after each.

    Args:
        model: as given.
        problem: the readings.
        effects: in the order in which they are added; none refits only.
        progress: told what is done, how much of how much.

    Returns:
        The ladder.

    Raises:
        ModelError: an effect is there already, does not fit the machine, or cannot be tested on this run.
    """
    for effect in effects:
        require_fits(model, effect)
    for effect in effects:
        _require(effect, problem)
    given = problem
    model, problem = _with_smooth_path(model, effects, problem)
    base, notes = _hold_untestable(model, problem)
    if problem is not given:
        notes = (*notes, SMOOTHLY)
    rungs = _first_rungs(model, base)
    for effect in effects:
        base = base + effect
        rungs.append((effect.key, "added", base))
    return _measure(rungs, problem, notes, progress)


def descend(model: Model, problem: Problem, keys: Sequence[str], *, progress: Progress = unwatched) -> Ladder:
    """Remove effects one after the other and refit everything jointly after each.

    Args:
        model: as given.
        problem: the readings.
        keys: names, with [label] where there is one.
        progress: told what is done, how much of how much.

    Returns:
        The ladder.

    Raises:
        ModelError: an effect is not there.
    """
    for key in keys:
        model.without(key)
    base, notes = _hold_untestable(model, problem)
    rungs = _first_rungs(model, base)
    for key in keys:
        base = base.without(key)
        rungs.append((key, "removed", base))
    return _measure(rungs, problem, notes, progress)


def _with_smooth_path(model: Model, effects: Sequence[Effect], problem: Problem) -> tuple[Model, Problem]:
    """Model and run with joints that reverse between rows, where effects of reversal fit clearly better so."""
    new = any(effect.reverses for effect in effects)
    other = smoothly(problem) if new and problem.table.rows <= LONG else None
    if other is None:
        return model, problem
    smooth, early = replace(model, file=other.file), entering_rows(problem)
    before, after = (
        log_density(fit(reduce(add, effects, given), rows, lean=True, coarse=True), rows)
        for given, rows in ((model, without_opening(problem, early)), (smooth, without_opening(other, early)))
    )
    return (smooth, other) if after > before + LIKELIER else (model, problem)


def _require(effect: Effect, problem: Problem) -> None:
    lack = effect.needs(problem.view)
    if lack:
        raise UntestedError(f"this run cannot test '{effect.key}'", where=problem.table.source, fix=f"it needs {lack}")


def _hold_untestable(model: Model, problem: Problem) -> tuple[Model, tuple[str, ...]]:
    """Hold effects that this run cannot test at their values; else their prior would pull them to zero."""
    terms, notes = [], []
    for term in model.terms:
        lack = term.effect.lacks(term.theta, problem.view) if len(term.theta) else term.effect.needs(problem.view)
        if lack is None:
            terms.append(term)
        elif not len(term.theta):
            _require(term.effect, problem)
        else:
            terms.append(hold(term))
            notes.append(f"{term.effect.key} is kept as it was: this run cannot test it (it needs {lack})")
    return replace(model, terms=tuple(terms)), tuple(notes)


def _first_rungs(model: Model, base: Model) -> list[tuple[str, str, Model]]:
    rungs = [(GIVEN, "given", model)]
    if any(not _is_held(term) for term in base.terms):
        rungs.append((REFIT, "refit", base))
    return rungs


def _measure(
    rungs: Sequence[tuple[str, str, Model]], problem: Problem, notes: tuple[str, ...], tell: Progress
) -> Ladder:
    """Fit every rung on all rows and on all but each fold, and score both on the same sound rows."""
    hidden = folds(problem.table, FOLDS, blocks_beside(problem.frames))
    early = _entering_rows(rungs[-1][2], problem)
    fits, held_out = _fitted(rungs, without_opening(problem, early), None, hidden, tell)
    aside = _rows_of_unknown_side(fits, problem)
    if aside.any():
        problem, notes = without_opening(problem, aside), (*notes, told_aside(int(aside.sum())))
    if aside.any() or early.any():
        fits, held_out = _fitted(rungs, problem, None, hidden, tell)
    narrower = _quieter_noise(fits[-1], problem)
    if narrower is not None:
        fits, held_out = _fitted(rungs, problem, narrower, hidden, tell)
    tell("report", 1, 1)
    held = hold_to_base(fits[-1].model, problem)
    if rungs[-1][1] != "given":  # the uncertainties of the last step are reported
        fits[-1] = with_turns(beside_unnamed(with_frame_doubt(fits[-1], problem), held), held)
    rows = problem.used & ~fits[-1].outliers
    for residual in (*(item.residual for item in fits), *held_out):
        rows = rows & np.isfinite(residual).all(axis=1)
    if not rows.any():
        raise PosesError(
            f"{problem.table.source}: no reading can be held out: too few different poses, or their frame would be "
            "held out too; measure more poses"
        )
    falls = [0.0, *(_fall(a, b, rows, problem) for a, b in pairwise(held_out))]
    steps = tuple(
        LadderStep(name, kind, rms(fitted.residual, rows), rms(out, rows), fall, _with_given_terms(fitted, rungs[0][2]))
        for (name, kind, rung), fitted, out, fall in zip(rungs, fits, held_out, falls, strict=True)
    )
    report = report_fit(fits[-1], held, fits[0])
    protocol = f"{len(hidden)} sets of whole blocks of travel held out in turn, all repeats of a pose together"
    if any(value.measured == "searched" for value in report.values):
        protocol += "; moments, ranges and periods were found on all rows"
    masked = masked_effects(steps[-1].fitted, held)
    return Ladder(steps, report, fits[-1].noise.to_dict(), protocol, notes, ranges_of(held), masked)


def _entering_rows(model: Model, problem: Problem) -> np.ndarray:
    """Rows that a first fit leaves out because a joint may stand on either side; none without effects of reversal."""
    asked = problem.table.rows <= LONG and any(term.effect.reverses for term in model.terms)
    return entering_rows(problem) if asked else np.zeros(problem.table.rows, dtype=bool)


def _rows_of_unknown_side(fits: Sequence[FitResult], problem: Problem) -> np.ndarray:
    """Rows on which, for any of the fits, the side of a joint's play is unknown, (n,) bool; none in long runs.

    All steps are compared on the same rows. In a long run a few such rows change nothing.
    """
    if problem.table.rows > LONG:
        return np.zeros(problem.table.rows, dtype=bool)
    return np.any([untold_rows(each.model.terms, problem, each.noise) for each in fits], axis=0)


def _quieter_noise(fitted: FitResult, problem: Problem) -> Noise | None:
    """Noise from the residuals of repeats, where the model explains part of their scatter; else None.

    A knock between two rounds makes the repeats differ; counted as noise, that difference would hide the knock.
    """
    given, view = problem.noise, problem.view
    if given is None or given.source != REPEATS:
        return None
    left = np.where(problem.used[:, None], fitted.residual, np.nan)
    sigma, turns = problem.file.tracker.sigma_mm, (problem.rotation, problem.frame)
    again = given_noise(problem.table, left, view.direction.numpy(), sigma, *turns)
    return again if again is not None and again.total < QUIETER * given.total else None


def _fitted(
    rungs: Sequence[tuple[str, str, Model]], problem: Problem, noise: Noise | None, hidden: Sequence[np.ndarray],
    tell: Progress,
) -> tuple[list[FitResult], list[np.ndarray]]:  # fmt: skip
    """Fit of every step to all rows, and its held-out residuals, (n, 3) mm each."""
    total, fits, held_out = len(rungs) * (len(hidden) + 1), list[FitResult](), list[np.ndarray]()
    for number, (name, kind, rung) in enumerate(rungs):
        tell(name, number * (len(hidden) + 1), total)
        last = fits[-1] if fits else None
        there = with_frames_of_base(rung, problem, noise, last)
        fits.append(residual_of(rung, problem, noise=noise) if kind == "given" else fit_rung(rung, there, noise, last))
        # Searched values (the moment of a knock) are kept: a held-out block may hold all that shows them.
        if problem.table.rows > LONG:
            held_out.append(_only_judged(held_out_residual(fits[-1], there, hidden), there, hidden))
        else:
            given = rung if kind == "given" else fits[-1].model
            held_out.append(_held_out(given, kind, there, fits[-1].noise, hidden))
    return fits, held_out


def _held_out(model: Model, kind: str, problem: Problem, noise: Noise, hidden: Sequence[np.ndarray]) -> np.ndarray:
    """Residual of every row by a fit without its block, (n, 3) mm; NaN where too little of its frame is left."""
    residual = np.full_like(problem.measured, np.nan)
    for part in hidden:
        rest, judged = problem.masked(part), _judged_rows(part, problem)
        if rest.used.sum() < FRAME_ROWS:
            continue
        fitted = residual_of(model, rest, noise) if kind == "given" else fit(model, rest, noise=noise, lean=True)
        residual[judged] = fitted.residual[judged]
    return residual


def _only_judged(residual: np.ndarray, problem: Problem, hidden: Sequence[np.ndarray]) -> np.ndarray:
    """Held-out residuals, (n, 3) mm; NaN where too little of the frame stays in the fit."""
    judged = np.any([_judged_rows(part, problem) for part in hidden], axis=0)
    return np.where(judged[:, None], residual, np.nan)


def _judged_rows(part: np.ndarray, problem: Problem) -> np.ndarray:
    """Those of some held-out rows whose frame enough of the other readings determine, (n,) bool."""
    if problem.frames == 0 or problem.base is not None:
        return part
    visible = np.bincount(problem.frame[problem.used & ~part], minlength=problem.frames)
    return np.asarray(part & (visible >= FRAME_ROWS)[problem.frame])


def _fall(before: np.ndarray, after: np.ndarray, rows: np.ndarray, problem: Problem) -> float:
    """Fall of the sum of squared errors, in its standard errors; a pose counts once, since its rows share an error."""
    group = np.unique(pose_groups(problem.table)[rows], return_inverse=True)[1].reshape(-1)
    gain = np.bincount(group, (before[rows] ** 2 - after[rows] ** 2).sum(axis=1))
    scatter = float(np.std(gain)) * np.sqrt(len(gain))
    return float(gain.sum() / scatter) if scatter > 0 else 0.0


def _with_given_terms(fitted: FitResult, given: Model) -> FitResult:
    """The fit with terms that the run could not test as they were given, instead of held."""
    own = {term.effect.key: term for term in given.terms if len(term.theta)}
    terms = tuple(own.get(t.effect.key, t) if _is_held(t) else t for t in fitted.model.terms)
    return replace(fitted, model=replace(fitted.model, terms=terms))


def _is_held(term: Term) -> bool:
    return len(term.fixed) == len(term.effect.parameters)
