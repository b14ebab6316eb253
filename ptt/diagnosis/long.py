"""Diagnosis of a long run: the path is found on stretches of it, then everything is fitted and tested on all rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from torch import Tensor

from ptt.chunks import CHUNK, LONG, SAMPLE, cut, sample_stretches, take
from ptt.diagnosis.bins import follow_in_all_rows
from ptt.diagnosis.columns import Trial
from ptt.diagnosis.design import BLOCKS, present_candidates
from ptt.diagnosis.path import Path
from ptt.diagnosis.rest import Rest
from ptt.diagnosis.screen import Finding, screen, significant
from ptt.diagnosis.summed import Chunks, SummedDesign, at_all_rows, refit, sum_up
from ptt.diagnosis.verdict import STEPS, Diagnosis, describe_candidates, diagnose
from ptt.diagnosis.walker import Progress, State
from ptt.diagnosis.words import explain_verdict
from ptt.effects import Effect, Library, library
from ptt.effects.sudden import Sudden
from ptt.fit.solve import FitResult, fit, rms
from ptt.holdout import blocks
from ptt.model import Model
from ptt.problem import Problem

WORTH = 5e-4  # share of the noise's variance that a further effect must take: 10,000 rows would show as much
PASSES = 3
BENT = 1e-5  # share of chi-squared by which a linear step may miss before all rows are linearised again
LONG_SEARCH = 12  # shapes from which only the sample's best is taken to all rows


def choose_diagnosis(rows: int, size: int | None = None) -> Callable[..., Diagnosis]:
    """Which diagnosis suits a run: all rows at once, or summed up in chunks.

    Args:
        rows: of the run.
        size: rows of a chunk; None leaves it to the run, which is then cut only beyond `LONG` rows.

    Returns:
        `diagnose`, or `diagnose_long` with its chunks.
    """
    if size is None and rows <= LONG:
        return diagnose
    return partial(diagnose_long, size=size or CHUNK)


def diagnose_long(
    model: Model,
    problem: Problem,
    known: Library | None = None,
    *,
    steps: int = STEPS,
    progress: Progress | None = None,
    seed: int = 0,
    size: int = CHUNK,
    sample_rows: int = SAMPLE,
) -> Diagnosis:
    """Learn which physical effects are missing from a run whose columns do not fit into memory.

    The path, with its searched shapes and its exact comparisons, is found on stretches of travel that are spread over
    the run and entered as the run enters them. Parameters, the screen, gross errors, held-out errors and the verdict
    are of all rows.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name; None for the library.
        steps: how many may be added.
        progress: told what is being done.
        seed: of the permutation tests.
        size: rows of a chunk.
        sample_rows: about how many rows the path is found on.

    Returns:
        The diagnosis.

    Raises:
        TableError: nothing tells the noise floor.
    """
    known = library() if known is None else known
    tell = progress or (lambda what: None)
    sample = take(problem, sample_stretches(problem, sample_rows))
    told = diagnose(model, sample, known, steps=steps, progress=tell, seed=seed)
    run = _Run(problem, sample, size, known, told, tell)
    fitted, design = run.weigh(told.path.end.fitted)
    added = list(told.path.added)
    while told.wander is None and len(added) < steps and (more := run.worth_adding(design)):
        added.append(more.trial.effect.key)
        fitted, design = run.weigh(run.with_effect(fitted, more.trial.effect))
    given = run.weigh_given(told.path.start.fitted, design.rows)
    return _conclude(run, told, added, given, fitted, design, steps)


class _Run:
    """A long run, its sample and its chunks; holds what does not change from model to model."""

    def __init__(
        self, problem: Problem, sample: Problem, size: int, known: Library, told: Diagnosis, tell: Progress
    ) -> None:
        self.problem, self.sample, self.size, self.known, self.tell = problem, sample, size, known, tell
        self.chunks = cut(problem, size)
        self.noise = told.noise
        self.block = blocks(problem.table, BLOCKS)
        self.tried = {finding.trial.effect.key: finding.trial for finding in told.path.end.screened.findings}

    def weigh(self, fitted: FitResult) -> tuple[FitResult, SummedDesign]:
        """Fit a model on all rows, with all candidates summed up beside it."""
        candidates, _ = present_candidates(fitted, self.sample, self.known)
        trials = {effect.key: list(effect.search(self.sample.view)) for effect in candidates}
        shapes = {
            key: [self.tried[key].shape] if len(found) >= LONG_SEARCH and key in self.tried else found
            for key, found in trials.items()
        }
        fitted = self._place_knocks(replace(fitted, noise=self.noise))
        after, design = self._fit(fitted, candidates, shapes, self.problem, self.chunks)
        counted = tuple(replace(trial, trials=len(trials[trial.effect.key])) for trial in design.trials)
        return after, replace(design, trials=counted)

    def weigh_given(self, fitted: FitResult, rows: np.ndarray) -> FitResult:
        """Fit the model as given on the rows that count."""
        sound = self.problem.masked(~rows)
        return self._fit(replace(fitted, noise=self.noise), [], {}, sound, cut(sound, self.size))[0]

    def worth_adding(self, design: SummedDesign) -> Finding | None:
        """The best candidate that all rows show and that takes a part of the noise worth naming."""
        screened = screen(design)
        found = [item for item in significant(screened) if item.net > WORTH * screened.count]
        return max(found, key=lambda item: item.net) if found else None

    def with_effect(self, fitted: FitResult, effect: Effect) -> FitResult:
        """A start for the model with one more effect, from the sample."""
        return fit(fitted.model + effect, self.sample, noise=self.noise, robust=False, coarse=True)

    def _fit(
        self,
        fitted: FitResult,
        candidates: Sequence[Effect],
        shapes: Mapping[str, Sequence[Mapping[str, Tensor]]],
        problem: Problem,
        chunks: Chunks,
    ) -> tuple[FitResult, SummedDesign]:
        for number in range(PASSES):
            self.tell(f"all rows, pass {number + 1}")
            sift = bool(candidates)
            design = sum_up(problem, chunks, fitted, candidates, shapes, self.noise, self.block, sift=sift)
            linear = refit(fitted, design)
            fitted = at_all_rows(linear, chunks, design.rows)
            if abs(fitted.chi2 - linear.chi2) <= BENT * linear.chi2:
                break
        return replace(fitted, outliers=problem.used & ~design.rows), design

    def _place_knocks(self, fitted: FitResult) -> FitResult:
        """Knocks to the row: the sample knows them only to a gap between its stretches."""
        for index, term in enumerate(fitted.layout.terms):
            if isinstance(term.effect, Sudden):
                after = self._moment(fitted, index, term.effect)
                terms = list(fitted.layout.terms)
                theta = term.theta.clone()
                theta[-1] = after
                terms[index] = replace(term, theta=theta)
                fitted = replace(fitted, layout=replace(fitted.layout, terms=tuple(terms)))
        return fitted

    def _moment(self, fitted: FitResult, index: int, effect: Sudden) -> float:
        """The moment up to which the readings are better without a knock, and from which on with it."""

        def squares(after: float) -> np.ndarray:
            terms = list(fitted.layout.terms)
            theta = terms[index].theta.clone()
            theta[-1] = after
            terms[index] = replace(terms[index], theta=theta)
            moved = replace(fitted, layout=replace(fitted.layout, terms=tuple(terms)))
            everywhere = at_all_rows(moved, self.chunks, self.problem.used).residual
            left = np.square(everywhere @ self.noise.whitener.T).sum(axis=1)
            return np.where(self.problem.used, np.nan_to_num(left), 0.0)

        clock = effect.clock(self.problem.view).numpy()
        gain = np.cumsum(squares(np.inf) - squares(-np.inf))
        return float(clock[int(np.argmin(gain))])


def _conclude(
    run: _Run,
    told: Diagnosis,
    added: list[str],
    given: FitResult,
    fitted: FitResult,
    design: SummedDesign,
    steps: int,
) -> Diagnosis:
    """The sample's diagnosis with everything that all rows tell in its place."""
    problem, rows = run.problem, design.rows
    clean = problem.masked(problem.used & ~rows)
    path = _path(told, added, given, fitted, design)
    run.tell("rest")
    rest = told.rest
    more = follow_in_all_rows(problem, fitted.residual, run.noise, rows)
    if more and not rest.significant:
        reasons = tuple(f"over all rows the rest follows {name} ({share:.1%} of its variance)" for name, share in more)
        rest = Rest(rest.lack_p, rest.field_p, rest.depends_on, True, reasons)
    result = replace(
        told,
        verdict="unknown" if rest.significant else "missing" if added else "nothing-missing",
        suggested=tuple((key, *others) for key, others in zip(path.added, path.alternatives, strict=True)),
        candidates=describe_candidates(path, clean, run.noise),
        rest=rest,
        rms_um={"before": rms(given.residual, rows), "after": rms(fitted.residual, rows)},
        rows=int(rows.sum()),
        outliers=problem.used & ~rows,
        path=path,
    )
    how = (
        f"Path, noise, ties and the tests of the rest against repeats and position are of {run.sample.table.rows} rows "
        f"in stretches of travel; parameters, screen, held-out errors, gross rows and what the rest follows are of all "
        f"rows, summed up in chunks of {run.size}."
    )
    return replace(result, words=f"{explain_verdict(result, steps)} {how}")


def _path(told: Diagnosis, added: list[str], given: FitResult, fitted: FitResult, design: SummedDesign) -> Path:
    """The path's states as all rows see them: choices of columns of the last design."""
    before = tuple(key for key in fitted.model.keys if key not in added)
    gross = fitted.outliers
    states = []
    for count in range(len(added) + 1):
        part = _with_fewer(design, fitted, (*before, *added[:count]))
        own = given if count == 0 else fitted
        states.append(State(own, part, screen(part), gross))
    others = (*told.path.alternatives, *((),) * (len(added) - len(told.path.alternatives)))
    return Path(states[0], tuple(states[1:]), tuple(added), others, told.path.untestable)


def _with_fewer(design: SummedDesign, fitted: FitResult, keys: Sequence[str]) -> SummedDesign:
    """The design with some effects of the model as candidates instead."""
    present = {key: columns for key, columns in design.present.items() if key in keys}
    freed = tuple(
        Trial(term.effect, {}, design.present[term.effect.key], 1)
        for term in fitted.model.terms
        if term.effect.key not in keys
    )
    return replace(design, present=present, trials=(*freed, *design.trials))
