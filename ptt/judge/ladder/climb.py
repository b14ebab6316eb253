"""Add, refit, watch the error fall: errors after each step, on training rows and on rows that no parameter saw."""

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
from ptt.fitting.opening import told_aside, untold_rows, without_opening
from ptt.fitting.report import report_fit
from ptt.fitting.result import FitResult
from ptt.fitting.solve import acts_on_base, fit, hold, hold_to_base, residual_of, rms
from ptt.fitting.turns import with_turns
from ptt.judge.ladder.ladder import Ladder, LadderStep
from ptt.judge.ladder.rung import fit_rung, log_density
from ptt.model.model import Model, Term, require_fits
from ptt.progress import Progress, unwatched
from ptt.run.holdout import blocks_beside, folds, pose_groups
from ptt.run.noise import Noise, given_noise
from ptt.run.problem import Problem
from ptt.run.ranges import ranges_of
from ptt.run.smooth import LIKELIER, SMOOTHLY, smoothly

FOLDS = 5
FRAME_ROWS = 4  # readings of a frame that must stay visible for its hidden ones to be judged
QUIETER = 0.8  # of what repeats scatter by, below which a model has explained a part of that
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
    model, problem = _as_it_turns(model, effects, problem)
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


def _as_it_turns(model: Model, effects: Sequence[Effect], problem: Problem) -> tuple[Model, Problem]:
    """The same with joints that turn between rows, where an effect of reversals fits a smooth way clearly better."""
    new = any(effect.reverses for effect in effects)
    other = smoothly(problem) if new and problem.table.rows <= LONG else None
    if other is None:
        return model, problem
    smooth = replace(model, file=other.file)
    before, after = (
        fit(reduce(add, effects, given), rows, lean=True, coarse=True)
        for given, rows in ((model, problem), (smooth, other))
    )
    return (smooth, other) if log_density(after, other) > log_density(before, problem) + LIKELIER else (model, problem)


def _require(effect: Effect, problem: Problem) -> None:
    lack = effect.needs(problem.view)
    if lack:
        raise UntestedError(f"this run cannot test '{effect.key}'", where=problem.table.source, fix=f"it needs {lack}")


def _hold_untestable(model: Model, problem: Problem) -> tuple[Model, tuple[str, ...]]:
    """Keep what an earlier run told of effects that this run says nothing of; a prior would pull them to zero."""
    terms, notes = [], []
    for term in model.terms:
        lack = term.effect.needs(problem.view)
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
    fits, held_out = _fitted(rungs, problem, None, hidden, tell)
    aside = _untold(fits, problem)
    if aside.any():
        problem, notes = without_opening(problem, aside), (*notes, told_aside(int(aside.sum())))
        fits, held_out = _fitted(rungs, problem, None, hidden, tell)
    narrower = _noise_beside(fits[-1], problem)
    if narrower is not None:
        fits, held_out = _fitted(rungs, problem, narrower, hidden, tell)
    tell("report", 1, 1)
    held = hold_to_base(fits[-1].model, problem)
    if rungs[-1][1] != "given":  # the last is what is stated
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
        LadderStep(name, kind, rms(fitted.residual, rows), rms(out, rows), fall, _restored(fitted, rungs[0][2]))
        for (name, kind, rung), fitted, out, fall in zip(rungs, fits, held_out, falls, strict=True)
    )
    report = report_fit(fits[-1], held, fits[0])
    protocol = f"{len(hidden)} sets of whole blocks of travel held out in turn, all repeats of a pose together"
    if any(value.measured == "searched" for value in report.values):
        protocol += "; moments, ranges and periods were found on all rows"
    masked = masked_effects(steps[-1].fitted, held)
    return Ladder(steps, report, fits[-1].noise.to_dict(), protocol, notes, ranges_of(held), masked)


def _untold(fits: Sequence[FitResult], problem: Problem) -> np.ndarray:
    """Rows at which any of some fits has a joint lie on nobody knows which side, (n,) bool; of long runs none.

    Every rung is held to the same rows, and a few of ten thousands move none of them.
    """
    if problem.table.rows > LONG:
        return np.zeros(problem.table.rows, dtype=bool)
    return np.any([untold_rows(each.model.terms, problem, each.noise) for each in fits], axis=0)


def _noise_beside(fitted: FitResult, problem: Problem) -> Noise | None:
    """What repeats scatter by beside what a model explains between them; None where they are no quieter so.

    A knock between two rounds makes their repeats differ, and held as noise it would hide itself.
    """
    given, view = problem.noise, problem.view
    if given is None or given.source != "repeats":
        return None
    left = np.where(problem.used[:, None], fitted.residual, np.nan)
    again = given_noise(problem.table, left, view.direction.numpy(), problem.file.tracker.sigma_mm)
    return again if again is not None and again.total < QUIETER * given.total else None


def _fitted(
    rungs: Sequence[tuple[str, str, Model]], problem: Problem, noise: Noise | None, hidden: Sequence[np.ndarray],
    tell: Progress,
) -> tuple[list[FitResult], list[np.ndarray]]:  # fmt: skip
    """Every rung on all rows, and the residual of every row, (n, 3) mm, by a fit that did not see it."""
    total, fits, held_out = len(rungs) * (len(hidden) + 1), list[FitResult](), list[np.ndarray]()
    for number, (name, kind, rung) in enumerate(rungs):
        tell(name, number * (len(hidden) + 1), total)
        last = fits[-1] if fits else None
        there = _held_to_base(rung, problem, noise, last)
        fits.append(residual_of(rung, problem, noise=noise) if kind == "given" else fit_rung(rung, there, noise, last))
        # What was searched (the moment of a knock, a time constant) is kept: a hidden block would hide it with itself.
        if problem.table.rows > LONG:
            held_out.append(_judged(held_out_residual(fits[-1], there, hidden), there, hidden))
        else:
            given = rung if kind == "given" else fits[-1].model
            held_out.append(_held_out(given, kind, there, fits[-1].noise, hidden))
    return fits, held_out


def _held_to_base(rung: Model, problem: Problem, noise: Noise | None, last: FitResult | None) -> Problem:
    """The frame where base reflectors put it beside a rung: a moved frame would pass for what an effect took."""
    if problem.base is not None and any(acts_on_base(term) for term in rung.terms):
        rung = fit_rung(rung, problem, noise, last).model  # with the readings: they tell what the tracker does as well
    return hold_to_base(rung, problem)


def _held_out(model: Model, kind: str, problem: Problem, noise: Noise, hidden: Sequence[np.ndarray]) -> np.ndarray:
    """Residual of every row from a fit that did not see it, (n, 3) mm; NaN where its frame was hidden with it."""
    residual = np.full_like(problem.measured, np.nan)
    for part in hidden:
        rest, judged = problem.masked(part), _seen_beside(part, problem)
        if rest.used.sum() < FRAME_ROWS:
            continue
        fitted = residual_of(model, rest, noise) if kind == "given" else fit(model, rest, noise=noise, lean=True)
        residual[judged] = fitted.residual[judged]
    return residual


def _judged(residual: np.ndarray, problem: Problem, hidden: Sequence[np.ndarray]) -> np.ndarray:
    """Residuals of held-out rows, NaN where their frame was held out with them."""
    judged = np.any([_seen_beside(part, problem) for part in hidden], axis=0)
    return np.where(judged[:, None], residual, np.nan)


def _seen_beside(part: np.ndarray, problem: Problem) -> np.ndarray:
    """Rows of a hidden part whose frame enough other readings show, (n,) bool."""
    visible = np.bincount(problem.frame[problem.used & ~part], minlength=max(problem.frames, 1))
    told = (visible >= FRAME_ROWS)[problem.frame] | (problem.frames == 0) | (problem.base is not None)
    return np.asarray(part & told)


def _fall(before: np.ndarray, after: np.ndarray, rows: np.ndarray, problem: Problem) -> float:
    """Fall of the squared error in standard errors; rows of one pose count as one, because their errors go together."""
    group = np.unique(pose_groups(problem.table)[rows], return_inverse=True)[1].reshape(-1)
    gain = np.bincount(group, (before[rows] ** 2 - after[rows] ** 2).sum(axis=1))
    scatter = float(np.std(gain)) * np.sqrt(len(gain))
    return float(gain.sum() / scatter) if scatter > 0 else 0.0


def _restored(fitted: FitResult, given: Model) -> FitResult:
    """Terms that this run could not test as they were given, not as fixed by the user."""
    own = {term.effect.key: term for term in given.terms if len(term.theta)}
    terms = tuple(own.get(t.effect.key, t) if _is_held(t) else t for t in fitted.model.terms)
    return replace(fitted, model=replace(fitted.model, terms=terms))


def _is_held(term: Term) -> bool:
    return len(term.fixed) == len(term.effect.parameters)
