"""The verdict: `missing`, `nothing-missing` or `unknown`, and the whole diagnosis put together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ptt.dependence.dependence import Dependence
from ptt.dependence.following import dependence_of
from ptt.diagnosis.evidence.atoms import is_block, is_effect
from ptt.diagnosis.evidence.noise_level import noise_after, stated_noise, visit_left, wanders_beyond
from ptt.diagnosis.evidence.possible import UNUSUAL_NATS, is_oversized
from ptt.diagnosis.evidence.probability import VERDICTS, Probability, weigh_sets, with_lapse
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import holds_unknown
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.noise.slow import SECONDS, Slow
from ptt.diagnosis.search.excess import Objections, is_open, too_much_left
from ptt.diagnosis.search.fits import without_carried
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.search.improve import climb
from ptt.diagnosis.search.moves import droppable
from ptt.diagnosis.search.rest import Rest
from ptt.diagnosis.telling.aside import against_gross
from ptt.diagnosis.telling.depends import LEAST_SHARE, MOST_LINES, dependences, wandering, with_suspect
from ptt.diagnosis.telling.diagnosis import Diagnosis, Verdict
from ptt.diagnosis.telling.explanation import Candidate, candidates_of_steps, other_candidates
from ptt.diagnosis.telling.naming import Naming, naming_of
from ptt.diagnosis.telling.sizes import sized
from ptt.diagnosis.telling.terms import sent_state
from ptt.diagnosis.telling.unknowns import unnamed_of
from ptt.diagnosis.telling.verdict_words import explain_verdict
from ptt.effects import Library
from ptt.fitting.beside_unnamed import beside_unnamed
from ptt.fitting.chunks import numbers
from ptt.model.model import Model
from ptt.plan.elsewhere import elsewhere
from ptt.plan.separation import plan_separation
from ptt.progress import Tell
from ptt.run.axes import AXES, rms
from ptt.run.problem import Problem

MICRO = 1e3  # um in a mm
LIKELIER_THAN_NOT = 0.5


def conclude(
    found: Found,
    rest: Rest,
    model: Model,
    problem: Problem,
    known: Library,
    tell: Tell,
    steps: int,
) -> Diagnosis:
    """Put the diagnosis together from the explanation and the residual tests.

    Args:
        found: the best explanation.
        rest: tests of its residuals.
        model: the model as given.
        problem: the readings.
        known: effects by name.
        tell: callback for progress.
        steps: how many effects could be added.

    Returns:
        The diagnosis.
    """
    if found.state.keys and found.sample is None:
        found = replace(found, fitted=beside_unnamed(found.fitted, without_carried(problem, found)))
    scorer, state, atoms = found.scorer, found.state, found.system.atoms
    clean = problem.masked(problem.used & ~np.isin(np.arange(problem.table.rows), found.system.rows))
    shown = clean if found.sample is None else found.sample
    naming = naming_of(found, model, problem, shown)
    named = naming.named.steps
    rms_um = _errors(found, tuple(step.key for step in named))
    error = rms_um["after"]["total"] / MICRO
    rest = _objected(rest, found, naming, problem, error)
    noise, chances = noise_after(problem, found.system, state), weigh_sets(scorer)
    verdict = _verdict(found, bool(named), rest)
    depends = _depends_on(found, naming, rest, shown, problem) if verdict == "unknown" else ()
    tell("measure next")
    suggested = tuple((atoms[step.key].name, *step.others) for step in named)
    tied = any(len(step) > 1 for step in suggested)
    oversized = _oversized(found, suggested, verdict)
    steps_told = candidates_of_steps(found, naming.named, naming.terms, naming.others, chances, noise, problem)
    others = other_candidates(found, named, chances, problem, oversized)
    result = Diagnosis(
        verdict=verdict,
        verdict_probability=_verdict_probability(found, chances, verdict, error, problem),
        suggested=suggested,
        candidates=(*steps_told, *others),
        not_testable=found.untestable,
        depends_on=depends,
        rest=rest,
        separation=plan_separation(found.fitted, shown, suggested, known) if tied else None,
        noise=noise,
        wander=_slow(found, problem),
        rms_um=rms_um,
        rows=int(clean.used.sum()),
        outliers=found.gross,
        model=replace(model, terms=naming.sent),
        fitted=found.fitted,
        words="",
        elsewhere=elsewhere(found.fitted, problem) if named else None,
        perhaps=_perhaps(found, suggested, others, verdict, oversized),
        oversized=oversized,
    )
    return replace(result, words=explain_verdict(result, steps))


def _perhaps(
    found: Found, suggested: Sequence[tuple[str, ...]], others: Sequence[Candidate], verdict: str,
    oversized: Sequence[str],
) -> tuple[str, ...]:  # fmt: skip
    """Names that are not suggested: of the best set's effects beside an unknown, else of what is likelier than not.

    Without an unknown these are effects that bring too little for one name more.
    """
    atoms, said = found.system.atoms, {name for step in suggested for name in step}
    if verdict == "unknown":
        names = [atoms[key].name for key in droppable(found.scorer, found.state) if atoms[key].effect is not None]
        names += oversized
    elif verdict == "missing":
        names = [other.effect for other in others if other.probability > LIKELIER_THAN_NOT]
    else:
        names = []
    return tuple(dict.fromkeys(name for name in names if name not in said))


def _oversized(found: Found, suggested: Sequence[tuple[str, ...]], verdict: str) -> tuple[str, ...]:
    """Effects that would do as well as the unknown terms, were it not for values that their cause has never reached."""
    if verdict != "unknown":
        return ()
    scorer, state, atoms = found.scorer, found.state, found.system.atoms
    said, kept = {name for step in suggested for name in step}, tuple(k for k in state.keys if is_effect(atoms[k]))
    names, opens = [name for name in found.too_large if name not in said], scorer.opens(kept)
    for key, atom in atoms.items() if len(kept) < len(state.keys) else ():  # else there is no term to stand for
        limited = is_effect(atom) and not (atom.within is None and atom.largest is None)
        if limited and atom.name not in said and opens(atom):
            other = scorer.score((*kept, key), state.memory)
            if other.total + UNUSUAL_NATS > state.total and is_oversized(other, atom):
                names.append(atom.name)
    return tuple(dict.fromkeys(names))


def _objected(rest: Rest, found: Found, naming: Naming, problem: Problem, error: float) -> Rest:
    """The residual tests with all objections to the explanation; `error`: root mean square residual, mm."""
    system, state = found.system, found.state
    unproven = tuple(system.atoms[key].name for key in naming.named.unproven)
    left, stated = visit_left(system, state), stated_noise(problem, system, state)
    wanders = state.memory.wander is not None and system.clock.is_slow(state.memory.wander)
    by_visit = bool(system.by_visit and state.memory.pose)
    before, much = _verdict(found, bool(naming.named.steps), rest), None
    repeated = by_visit or (problem.noise is not None and problem.noise.stated is not None)
    if before == "nothing-missing" or (before == "missing" and repeated):
        rounding_mm = problem.rounding[1]
        much = too_much_left(error, problem.noise, wanders=wanders, by_visit=by_visit, rounding_mm=rounding_mm)
    objections = Objections(
        faithful=naming.named.faithful,
        unproven=unproven,
        impossible=naming.impossible,
        idle=naming.idle,
        backward=naming.backward,
        set_aside=against_gross(found, problem),
        unexplained_error=much,
    )
    return rest.objected(objections, left, stated)


def _depends_on(
    found: Found, naming: Naming, rest: Rest, shown: Problem, problem: Problem
) -> tuple[Dependence, ...]:  # fmt: skip
    """What the unknown depends on, in which effects that are not named have their part.

    From the blocks; else from the wander of a joint; else from the residual with the wander in it, where that is no
    tracker's or nothing is named; else from the residual tests; else from the block that would explain most.
    """
    scorer, state = found.scorer, _in_blocks(found, naming)
    rows = slice(None) if found.sample is None else numbers(found.sample)
    unnamed = unnamed_of(scorer, state, problem, rows)
    depends, left = dependences(unnamed, shown), unnamed.left
    wanders = state.memory.wander is not None
    if not depends and rest.wanders is not None:
        return (wandering(rest.wanders, left, shown),)
    if not depends and (wanders_beyond(found.system, state) or (wanders and not naming.named.steps)):
        found_in = tuple(item for item in dependence_of(shown, left) if item.residual in AXES)
        depends = sized(found_in[:MOST_LINES], left, shown)
    depends = depends or sized(rest.depends_on[:MOST_LINES], left, shown)
    if depends:
        return depends
    suspect = with_suspect(scorer, state)
    suspected = dependences(unnamed_of(scorer, suspect, problem, rows), shown)
    return tuple(item for item in suspected if item.share >= LEAST_SHARE)


def _in_blocks(found: Found, naming: Naming) -> State:
    """The best set with blocks in the place of effects that are not named: what these do is unknown to the reader."""
    scorer, state, said = found.scorer, found.state, {step.key for step in naming.named.steps}
    unsaid = [key for key in droppable(scorer, state) if found.system.atoms[key].effect is not None and key not in said]
    if not unsaid:
        return state
    other = climb(scorer, scorer.score(without(state, *unsaid), state.memory, state.variances), is_block)
    return other if said <= {*other.keys} else state


def _slow(found: Found, problem: Problem) -> Slow | None:
    wander = found.state.memory.wander
    unit = SECONDS if "time" in problem.view.varies else "readings"
    return None if wander is None else Slow(wander, found.system.clock.span, unit)


def _verdict(found: Found, named: bool, rest: Rest) -> Verdict:
    state, system = found.state, found.system
    if holds_unknown(system, state.keys, state.memory) or wanders_beyond(system, state) or rest.significant:
        return "unknown"
    return "missing" if named else "nothing-missing"


def _verdict_probability(
    found: Found, chances: Probability, verdict: str, error: float, problem: Problem
) -> dict[str, float]:
    """Probabilities from the scored sets; 0.5 for a verdict that is not the likeliest of them but was forced.

    Args:
        found: the best explanation.
        chances: from the scored sets.
        verdict: that is told, evenly with `unknown` where much that no column records may be left.
        error: root mean square residual, mm.
        problem: the readings.
    """
    told = {name: with_lapse(chance, len(VERDICTS)) for name, chance in chances.verdict.items()}
    if max(told, key=lambda name: told[name]) != verdict:
        share = 0.5 / max(1.0 - told[verdict], 1e-12)
        told = {name: 0.5 if name == verdict else told[name] * share for name in VERDICTS}
    if found.state.memory.wander is None and is_open(error, problem.noise, problem.rounding[1]):
        told |= dict.fromkeys((verdict, "unknown"), 0.5 * (told[verdict] + told["unknown"]))
    return told


def _errors(found: Found, keys: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Root mean square errors of the model as given, and with the steps as they correct a machine, um."""
    system, errors = found.system, dict[str, dict[str, float]]()
    for name, state in (("before", found.scorer.score((), WHITE)), ("after", sent_state(found, keys))):
        left = system.in_mm(system.residual(state.columns, state.posterior.values))
        errors[name] = rms(left)
    return errors
