"""The verdict: what is missing, that nothing is, or that something is which no known effect describes."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import torch

from ptt.dependence.dependence import Dependence
from ptt.diagnosis.atoms import Atom
from ptt.diagnosis.depends import dependences, rest_of, unknowns_of, with_suspect
from ptt.diagnosis.find import STEPS, Found, Progress, find
from ptt.diagnosis.mimic import find_sum
from ptt.diagnosis.noise import LEAST_FREEDOM, noise_after, noise_left, too_few
from ptt.diagnosis.probability import VERDICTS, Probability, weigh_sets
from ptt.diagnosis.rest import Rest, look_for_rest
from ptt.diagnosis.score import State
from ptt.diagnosis.search import without
from ptt.diagnosis.steps import Step, held_out, name_steps, share_of
from ptt.diagnosis.wander import Wander
from ptt.diagnosis.words import explain_step, explain_verdict
from ptt.effects import Effect, Library, library
from ptt.errors import TableError
from ptt.fitting.chunks import numbers
from ptt.fitting.result import FitResult
from ptt.fitting.solve import rms
from ptt.model.model import Model, Term, parameter_names
from ptt.plan.separation import Separation, plan_separation
from ptt.run.noise import Noise
from ptt.run.problem import Problem

Verdict = Literal["missing", "nothing-missing", "unknown", "setup"]
MOST_SHOWN = 10  # candidates, beyond the steps, that are worth a line
LEAST = 12  # readings: twice what a rigid motion alone takes
EXCESS = 1.5  # times a stated noise from which an error is not nothing
MEASURED = 0.5  # share of its prior's variance below which a value is measured


@dataclass(frozen=True)
class Candidate:
    """One effect as an explanation of the run.

    Attributes:
        effect: key of the effect.
        probability: that it is part of what is missing.
        p_value: chance that the data would ask for it as much without it: at most the inverse of its Bayes factor
            (Ville's inequality), every candidate and shape counted.
        explained_share: of the residual's variance after the frame that it takes by itself.
        heldout_before: error on hidden blocks without it, um.
        heldout_after: error on hidden blocks with it, um.
        parameters: (name, unit, value, standard deviation or None where the data do not tell it); of what is no step,
            only those that they tell.
        indistinguishable_from: effects that would do as well.
        sum_of: two or more effects that would do the same together.
        words: why, for a machinist.
    """

    effect: str
    probability: float
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
            "probability": self.probability,
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
        verdict_probability: of each of these.
        suggested: for each step the effects that fit equally well, the pick first.
        candidates: the steps, then what else the data would ask for on the model as given, best first.
        not_testable: effect -> what the data lack.
        depends_on: what the unknown depends on, largest share first.
        rest: tests of what the whole explanation leaves.
        separation: what to measure to part what cannot be told apart; None where nothing is confused.
        noise: the noise floor.
        wander: memory of the noise, if it has one.
        rms_um: error before and after the steps.
        rows: readings that counted.
        outliers: rows left out as gross errors, (n,) bool.
        model: the model as given with the steps at their values.
        fitted: the fit that everything was linearised at.
        words: the verdict for a machinist.
    """

    verdict: Verdict
    verdict_probability: dict[str, float]
    suggested: tuple[tuple[str, ...], ...]
    candidates: tuple[Candidate, ...]
    not_testable: dict[str, str]
    depends_on: tuple[Dependence, ...]
    rest: Rest
    separation: Separation | None
    noise: Noise
    wander: Wander | None
    rms_um: dict[str, dict[str, float]]
    rows: int
    outliers: np.ndarray
    model: Model
    fitted: FitResult
    words: str

    @property
    def measure_next(self) -> tuple[str, ...]:
        """What to measure next, in words."""
        return tuple(self.separation.lines) if self.separation else ()

    def to_dict(self) -> dict[str, Any]:
        """For JSON, keys as documented."""
        return {
            "verdict": self.verdict,
            "verdict_probability": self.verdict_probability,
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
    enough(problem)
    known = library() if known is None else known
    tell = progress or (lambda what: None)
    found = find(model, problem, known, tell, steps)
    if problem.noise is None and noise_left(found.system, found.state).freedom < LEAST_FREEDOM:
        raise too_few(problem)
    tell("rest")
    rest = look_for_rest(found.system, found.state, problem, seed=seed)
    return conclude(found, rest, model, problem, known, tell, seed, steps)


def enough(problem: Problem) -> None:
    """Refuse a run of too few readings.

    Args:
        problem: the readings.

    Raises:
        TableError: too few for any verdict.
    """
    if (count := int(problem.used.sum())) < LEAST:
        fix = f"measure at least {LEAST} poses, better 100 or more; `ptt plan` lists which"
        raise TableError(f"{count} readings are too few for a verdict", where=problem.table.source, fix=fix)


def conclude(
    found: Found,
    rest: Rest,
    model: Model,
    problem: Problem,
    known: Library,
    tell: Progress,
    seed: int,
    steps: int = STEPS,
) -> Diagnosis:
    """Put together what was found.

    Args:
        found: the best explanation.
        rest: tests of what it leaves.
        model: as given.
        problem: the readings.
        known: effects by name.
        tell: told what is being done.
        seed: of the poses to measure next.
        steps: how many effects could be added.

    Returns:
        The diagnosis.
    """
    scorer, state, atoms = found.scorer, found.state, found.system.atoms
    clean = problem.masked(problem.used & ~np.isin(np.arange(problem.table.rows), found.system.rows))
    named, unproven = name_steps(scorer, state)
    shown, rows = (clean, slice(None)) if found.sample is None else (found.sample, numbers(found.sample))
    left = rest_of(scorer, state, problem)[rows]
    unknowns = unknowns_of(scorer, state, left)
    noise = noise_after(problem, found.system, state)
    chances = weigh_sets(scorer)
    terms = fitted_terms(found, model, tuple(step.key for step in named))
    fitted_model = replace(model, terms=terms)
    rms_um = _errors(found, tuple(step.key for step in named), clean)
    verdict: Verdict = "unknown" if unproven else _verdict(found, bool(named), rest, problem)
    depends = dependences(unknowns, left, shown) or rest.depends_on
    if verdict == "unknown" and not depends:
        suspect = with_suspect(scorer, scorer.score(without(state, *unproven), state.memory, state.scales))
        left = rest_of(scorer, suspect, problem)[rows]
        depends = dependences(unknowns_of(scorer, suspect, left), left, shown)
    tell("measure next")
    suggested = tuple((atoms[step.key].name, *step.others) for step in named)
    separation = None
    if any(len(step) > 1 for step in suggested):
        separation = plan_separation(found.fitted, shown, suggested, known, seed=seed)
    result = Diagnosis(
        verdict=verdict,
        verdict_probability=_verdict_probability(chances, verdict),
        suggested=suggested,
        candidates=(
            *_steps(found, named, terms, chances, noise, problem),
            *_others(found, named, chances, problem),
        ),
        not_testable=found.untestable,
        depends_on=depends if verdict == "unknown" else (),
        rest=rest,
        separation=separation,
        noise=noise,
        wander=state.memory.wander,
        rms_um=rms_um,
        rows=int(clean.used.sum()),
        outliers=found.gross,
        model=fitted_model,
        fitted=found.fitted,
        words="",
    )
    return replace(result, words=explain_verdict(result, steps))


def _verdict(found: Found, named: bool, rest: Rest, problem: Problem) -> Verdict:
    state, system = found.state, found.system
    odd = any(system.atoms[key].block is not None for key in state.keys) or state.memory.pose > 0.0
    if odd or system.clock.is_fault(state.memory.wander) or rest.significant:
        return "unknown"
    if problem.noise is not None and noise_left(system, state).total > EXCESS * problem.noise.total:
        return "unknown"
    return "missing" if named else "nothing-missing"


def _verdict_probability(chances: Probability, verdict: str) -> dict[str, float]:
    """Probabilities of the sets; where a test of the rest overrules them, the verdict has at least an even chance."""
    found = dict(chances.verdict)
    if max(found, key=lambda name: found[name]) != verdict:
        share = 0.5 / max(1.0 - found[verdict], 1e-12)
        found = {name: 0.5 if name == verdict else found[name] * share for name in VERDICTS}
    return found


def fitted_terms(found: Found, model: Model, keys: tuple[str, ...]) -> tuple[Term, ...]:
    """The given effects and the steps at the posterior's values.

    Args:
        found: the best explanation.
        model: as given.
        keys: of the steps' atoms.

    Returns:
        The terms, in the order of a model.
    """
    system, state, current = found.system, found.state, replace(model, terms=())
    for key in (*found.scorer.given, *keys):
        atom, own = system.atoms[key], state.of(key)
        term = next((t for t in found.fitted.model.terms if t.effect.key == atom.name), None)
        if term is None or atom.shape is not None:
            continue
        index = [t.effect.key for t in found.fitted.layout.terms].index(atom.name)
        free = torch.as_tensor(found.fitted.layout.free[index])
        theta, error, seen = (
            term.theta.clone(),
            torch.full_like(term.theta, torch.nan),
            torch.ones(len(term.theta), dtype=torch.bool),
        )
        theta[free] = torch.as_tensor(atom.amplitudes(state.posterior.values[own], system.scale))
        std, prior = state.errors(atom, system.scale)
        error[free] = torch.as_tensor(std)
        seen[free] = torch.as_tensor(std**2 < MEASURED * prior**2)
        current = current + replace(term, theta=theta, std=error, measured=seen)
    return current.terms


def _errors(found: Found, keys: tuple[str, ...], clean: Problem) -> dict[str, dict[str, float]]:
    """Error of the model as given, and with the steps, um."""
    system, scorer = found.system, found.scorer
    errors = {}
    for name, chosen in (("before", ()), ("after", keys)):
        state = scorer.score(chosen, found.state.memory)
        left = system.in_mm(system.left(state.columns, state.posterior.values))
        errors[name] = rms(left, np.ones(len(left), dtype=bool))
    return errors


def _steps(
    found: Found, named: tuple[Step, ...], terms: tuple[Term, ...], chances: Probability, noise: Noise, problem: Problem
) -> list[Candidate]:
    result: list[Candidate] = []
    for index, step in enumerate(named):
        name, before = found.system.atoms[step.key].name, [found.system.atoms[item.key].name for item in named[:index]]
        term = next((item for item in terms if item.effect.key == name), None)
        if term is None:
            continue
        together = find_sum(found.system, found.state, step.key)
        errors = step.before * 1e3, step.after * 1e3
        result.append(
            Candidate(
                name,
                chances.effects.get(name, 0.0),
                float(np.exp(-max(step.nats, 0.0))),
                step.share,
                *errors,
                _parameters(term, problem),
                step.others,
                together,
                explain_step(term, step.others, together, errors, noise, problem, before),
            )
        )
    return result


def _others(found: Found, named: tuple[Step, ...], chances: Probability, problem: Problem) -> list[Candidate]:
    """What else the data would ask for if nothing had been added."""
    scorer, atoms = found.scorer, found.system.atoms
    nothing = scorer.score((), found.state.memory)
    taken = {atoms[step.key].name for step in named}
    before = held_out(scorer, ()) * 1e3
    result: list[Candidate] = []
    for gain in scorer.screen(nothing, lambda atom: atom.effect is not None):
        atom = atoms[gain.key]
        if atom.name in taken or gain.nats <= 0.0 or len(result) == MOST_SHOWN:
            continue
        state = scorer.score((gain.key,), nothing.memory, {gain.key: gain.scales})
        parameters = _told(state, atom, found.system.scale, problem)
        after = held_out(scorer, (gain.key,)) * 1e3
        chance = chances.effects.get(atom.name, 0.0)
        share = share_of(scorer, gain.key)
        result.append(
            Candidate(atom.name, chance, float(np.exp(-gain.nats)), share, before, after, parameters, (), (), "")
        )
    return result


def _told(
    state: State, atom: Atom, scale: np.ndarray, problem: Problem
) -> tuple[tuple[str, str, float, float | None], ...]:
    """Values of an effect that the run tells better than the prior does, and better than the usual size.

    An effect that is not there can learn any size along what it hardly shows: a joint a foot off its place.
    """
    assert atom.effect is not None
    values = atom.amplitudes(state.posterior.values[state.of(atom.key)], scale)
    std, prior = state.errors(atom, scale)
    told = std**2 < MEASURED * np.minimum(prior, atom.sizes(scale)) ** 2
    rows = zip(_names(atom.effect, problem), values, std, told, strict=False)  # what is linear comes first
    return tuple((*name, float(value), float(error)) for name, value, error, seen in rows if seen)


def _names(effect: Effect, problem: Problem) -> list[tuple[str, str]]:
    kind, joints = problem.file.machine.kind, problem.view.joints
    names = parameter_names(effect, kind, joints)
    units = [p.on(kind).unit for p in effect.parameters for _ in range(p.size(joints))]
    return list(zip(names, units, strict=True))


def _parameters(term: Term, problem: Problem) -> tuple[tuple[str, str, float, float | None], ...]:
    rows = []
    for index, (name, unit) in enumerate(_names(term.effect, problem)):
        std = float("nan") if term.std is None else float(term.std[index])
        seen = term.measured is None or bool(term.measured[index])
        rows.append((name, unit, float(term.theta[index]), std if seen and np.isfinite(std) else None))
    return tuple(rows)
