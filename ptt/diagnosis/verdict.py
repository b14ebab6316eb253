"""The verdict: what is missing, that nothing is, or that something is which no known effect describes."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ptt.dependence.dependence import Dependence
from ptt.design.separation import Separation, plan_separation
from ptt.diagnosis.mimic import find_sum
from ptt.diagnosis.odd import weigh_oddities
from ptt.diagnosis.path import Path, path_cost, simple_part, walk, walk_plainly
from ptt.diagnosis.rest import Rest, look_for_rest
from ptt.diagnosis.saturated import confirm_noise, noise_floor, saturated_rest
from ptt.diagnosis.screen import SIMPLE, Finding, significant
from ptt.diagnosis.walker import Progress, State, Walker
from ptt.diagnosis.wander import Wander, find_wander
from ptt.diagnosis.words import explain_step, explain_verdict
from ptt.effects import Effect, Library, library
from ptt.effects.base import linear_size
from ptt.errors import TableError
from ptt.fit.solve import rms
from ptt.model import Model, Term, parameter_names
from ptt.noise import Noise
from ptt.problem import Problem
from ptt.sums import project, solve

Verdict = Literal["missing", "nothing-missing", "unknown"]
STEPS = 12
CLEARLY = 30.0  # chi-squared by which one odd dependence has to beat a path whose own rest already shows a trace
MANY = 3  # steps beyond which a path is asked whether one odd dependence would not do instead
MOST_SHOWN = 10  # candidates, beyond the steps, that are worth a line
LEAST = 12  # readings: twice what a rigid motion alone takes
OFF = 1.15  # noise floors further apart than this are worth a second walk


@dataclass(frozen=True)
class Candidate:
    """One effect as an explanation of the run.

    Attributes:
        effect: key of the effect.
        p_value: after multiplicity.
        explained_share: of the residual's variance after the frame that it takes by itself.
        heldout_before: error on hidden blocks without it, um.
        heldout_after: error on hidden blocks with it, um.
        parameters: (name, unit, value, standard deviation or None where the data do not tell it).
        indistinguishable_from: effects that would do as well.
        sum_of: two or more effects that would do the same together.
        words: why, for a machinist.
    """

    effect: str
    p_value: float
    explained_share: float
    heldout_before: float
    heldout_after: float
    parameters: tuple[tuple[str, str, float, float | None], ...]
    indistinguishable_from: tuple[str, ...]
    sum_of: tuple[str, ...]
    words: str

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        names = ("name", "unit", "value", "std")
        return {
            "effect": self.effect,
            "p_value": self.p_value,
            "explained_share": self.explained_share,
            "heldout_rms_um": {"before": self.heldout_before, "after": self.heldout_after},
            "parameters": [dict(zip(names, parameter, strict=True)) for parameter in self.parameters],
            "indistinguishable_from": list(self.indistinguishable_from),
            "sum_of": list(self.sum_of),
            "words": self.words,
        }


@dataclass(frozen=True)
class Diagnosis:
    """What the run says about the model.

    Attributes:
        verdict: 'missing', 'nothing-missing' or 'unknown'.
        suggested: for each step the effects that fit equally well, the pick first.
        candidates: the steps, then what else was significant on the model as given, best first.
        not_testable: effect -> what the data lack.
        rest: what is left after the path.
        separation: what to measure to part what cannot be told apart; None where nothing is confused.
        noise: the noise floor.
        wander: memory of the noise, if it has one.
        rms_um: error before and after the path.
        rows: readings that counted.
        outliers: rows left out as gross errors, (n,) bool.
        path: the steps with their fits.
        words: the verdict for a machinist.
    """

    verdict: Verdict
    suggested: tuple[tuple[str, ...], ...]
    candidates: tuple[Candidate, ...]
    not_testable: dict[str, str]
    rest: Rest
    separation: Separation | None
    noise: Noise
    wander: Wander | None
    rms_um: dict[str, dict[str, float]]
    rows: int
    outliers: np.ndarray
    path: Path
    words: str

    @property
    def depends_on(self) -> tuple[Dependence, ...]:
        """What the rest after the path depends on, largest share first."""
        return self.rest.depends_on

    @property
    def measure_next(self) -> tuple[str, ...]:
        """What to measure next, in words."""
        return tuple(self.separation.lines) if self.separation else ()

    def to_dict(self) -> dict[str, Any]:
        """For JSON, keys as documented."""
        return {
            "verdict": self.verdict,
            "suggested": [list(step) for step in self.suggested],
            "candidates": [candidate.to_dict() for candidate in self.candidates],
            "not_testable": [{"effect": name, "needs": lack} for name, lack in self.not_testable.items()],
            "depends_on": [item.to_dict() for item in self.depends_on],
            "measure_next": list(self.measure_next),
            "separation": self.separation and self.separation.to_dict(),
            "noise_um": self.noise.to_dict(),
            "noise_wanders": None
            if self.wander is None
            else {"share": self.wander.share, "constant_s": self.wander.constant},
            "rms_um": self.rms_um,
            "rows": self.rows,
            "outlier_rows": [int(row) for row in np.flatnonzero(self.outliers)],
            "rest": {"significant": self.rest.significant, "reasons": list(self.rest.reasons)},
            "words": self.words,
        }


def diagnose(
    model: Model,
    problem: Problem,
    known: Library | None = None,
    *,
    steps: int = STEPS,
    progress: Progress | None = None,
    seed: int = 0,
) -> Diagnosis:
    """Learn which physical effects are missing.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name; None for the library.
        steps: how many may be added.
        progress: told what is being done.
        seed: of the permutation tests.

    Returns:
        The diagnosis.

    Raises:
        TableError: nothing tells the noise floor, or too few readings for any verdict.
    """
    if (count := int(problem.used.sum())) < LEAST:
        fix = f"measure at least {LEAST} poses, better 100 or more; `ptt plan` lists which"
        raise TableError(f"{count} readings are too few for a verdict", where=problem.table.source, fix=fix)
    known = library() if known is None else known
    tell = progress or (lambda what: None)
    walker, path = _find_path(model, problem, known, steps, tell)
    tell("rest")
    rest = _rest(path, walker, seed)
    unknown = rest.significant
    if path.added and (unknown or _suspicious(path)):
        path, rest, unknown = _plainer(path, rest, walker, frozenset(model.keys), steps, seed)
    tell("measure next")
    gross = problem.used & ~path.end.design.rows
    clean = problem.masked(gross)
    suggested = tuple((key, *others) for key, others in zip(path.added, path.alternatives, strict=True))
    result = Diagnosis(
        verdict="unknown" if unknown else "missing" if path.added else "nothing-missing",
        suggested=suggested,
        candidates=describe_candidates(path, clean, walker.noise),
        not_testable=path.untestable,
        rest=rest,
        separation=plan_separation(path.end.fitted, clean, suggested, known, seed=seed),
        noise=walker.noise,
        wander=walker.wander,
        rms_um={
            "before": rms(path.start.fitted.residual, clean.used),
            "after": rms(path.end.fitted.residual, clean.used),
        },
        rows=int(clean.used.sum()),
        outliers=gross,
        path=path,
        words="",
    )
    return replace(result, words=explain_verdict(result, steps))


def _find_path(model: Model, problem: Problem, known: Library, steps: int, tell: Progress) -> tuple[Walker, Path]:
    """Walk; and walk again if the end of the path shows another noise than was thought, or one with a memory."""
    tell("noise")
    noise = noise_floor(model, problem, known)
    walker = Walker(problem, known, noise, None, tell)
    path = walk(walker, model, steps=steps)
    again = confirm_noise(problem, path.end.design, noise)
    wander = find_wander(problem, saturated_rest(path.start.design)) if path.added else None
    if wander is None and max(noise.total / again.total, again.total / noise.total) <= OFF:
        return walker, path
    walker = Walker(problem, known, again, wander, tell)
    return walker, walk(walker, model, steps=steps)


def _rest(path: Path, walker: Walker, seed: int) -> Rest:
    gross = walker.problem.used & ~path.end.design.rows
    return look_for_rest(path.end.fitted, walker.problem, walker.noise, gross, wander=walker.wander, seed=seed)


def _suspicious(path: Path) -> bool:
    """Whether a path looks as if its steps together imitated something else."""
    flexible = any(len(path.end.design.present[key]) > SIMPLE for key in path.added)
    return flexible or len(path.added) > MANY


def _plainer(
    path: Path, rest: Rest, walker: Walker, given: frozenset[str], steps: int, seed: int
) -> tuple[Path, Rest, bool]:
    """Where something unknown may be missing: the steps that help beyond doubt, and what the rest then depends on.

    One odd dependence after a few plain steps competes with the whole path; the cheaper explanation counts.
    """
    short, simple = walk_plainly(path, walker, given, steps), simple_part(path, walker)
    cuts = [part.cut(count) for part in (short, simple) for count in range(len(part.added), -1, -1)]
    plain_paths = {frozenset(plain.added): plain for plain in reversed(cuts)}  # of two alike the one that was walked
    spread, freedom = path.end.screened.spread, path.end.screened.freedom
    least, kept = path_cost(walker, path.end, path.end), (path, rest, rest.significant)
    if rest.significant and rest.depends_on:
        least -= CLEARLY  # a path that ends at a clear trace has not hidden it
    tried = [
        (plain, _rest(plain, walker, seed))
        for plain in sorted(plain_paths.values(), key=lambda plain: -len(plain.added))
    ]
    for plain, left in tried:
        misfit = walker.misfit(plain.end)
        tolls = path_cost(walker, plain.end, path.end) - misfit / spread
        for oddity in weigh_oddities(walker, plain.end, left.depends_on):
            cost = tolls + oddity.cost(misfit, spread, freedom)
            if cost < min(least, tolls + misfit / spread):  # it has to be worth its own toll, too
                least, kept = cost, (plain, left.led_by(oddity.dependence), True)
    if rest.significant and not kept[1].depends_on and _suspicious(path):
        # What such a path blurs may still show after its plain steps.
        kept = next(((plain, left, True) for plain, left in tried if left.depends_on), kept)
    return kept


def describe_candidates(path: Path, problem: Problem, noise: Noise) -> tuple[Candidate, ...]:
    """The steps in their order, then what else was significant against the model as given.

    Args:
        path: the steps.
        problem: the readings that counted.
        noise: the noise floor.

    Returns:
        The candidates.
    """
    steps = []
    before = path.start
    for key, state, others in zip(path.added, path.states, path.alternatives, strict=True):
        steps.append(_step(key, before, state, path.end, others, problem, noise))
        before = state
    more = [item for item in significant(path.start.screened) if item.trial.effect.key not in path.added]
    held = path.start.design.held_out_rms(path.start.design.base) * 1e3
    return (*steps, *(_other(finding, path.start, held, problem) for finding in more[:MOST_SHOWN]))


def _step(
    key: str, before: State, after: State, end: State, others: tuple[str, ...], problem: Problem, noise: Noise
) -> Candidate:
    finding = next((item for item in before.screened.findings if item.trial.effect.key == key), None)
    term = next(term for term in end.fitted.model.terms if term.effect.key == key)
    held = before.design.held_out_rms(before.design.base), after.design.held_out_rms(after.design.base)
    errors, together = (held[0] * 1e3, held[1] * 1e3), find_sum(end, key)
    return Candidate(
        key,
        finding.p_value if finding else 0.0,
        finding.share if finding else 0.0,
        *errors,
        _parameters(term, problem),
        others,
        together,
        explain_step(term, others, together, errors, noise, problem),
    )


def _other(finding: Finding, state: State, before: float, problem: Problem) -> Candidate:
    design, trial = state.design, finding.trial
    projected = project(*design.sums.total[:3], design.base)
    least = projected.least(trial.columns)
    solution = solve(projected.gram, projected.side, projected.left, trial.columns, least)
    values = solution.values * design.scale[trial.columns]
    chosen = np.concatenate([design.base, trial.columns]).astype(int)
    names = _linear_names(trial.effect, problem)
    parameters = tuple((name, unit, float(value), None) for (name, unit), value in zip(names, values, strict=True))
    after = design.held_out_rms(chosen) * 1e3
    return Candidate(trial.effect.key, finding.p_value, finding.share, before, after, parameters, (), (), "")


def _linear_names(effect: Effect, problem: Problem) -> list[tuple[str, str]]:
    kind, joints = problem.file.machine.kind, problem.view.joints
    names = parameter_names(effect, kind, joints)[: linear_size(effect, joints)]
    units = [p.on(kind).unit for p in effect.parameters for _ in range(p.size(joints))]
    return list(zip(names, units, strict=False))


def _parameters(term: Term, problem: Problem) -> tuple[tuple[str, str, float, float | None], ...]:
    kind, joints = problem.file.machine.kind, problem.view.joints
    names = parameter_names(term.effect, kind, joints)
    units = [p.on(kind).unit for p in term.effect.parameters for _ in range(p.size(joints))]
    rows = []
    for index, (name, unit) in enumerate(zip(names, units, strict=True)):
        std = float("nan") if term.std is None else float(term.std[index])
        seen = term.measured is None or bool(term.measured[index])
        rows.append((name, unit, float(term.theta[index]), std if seen and np.isfinite(std) else None))
    return tuple(rows)
