"""Candidates: one line for each named effect, then for other effects that would improve the model as given."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, is_effect
from ptt.diagnosis.evidence.candidates import first_of
from ptt.diagnosis.evidence.held_out import held_out_rms
from ptt.diagnosis.evidence.possible import beyond_machines
from ptt.diagnosis.evidence.probability import Probability, with_lapse
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.witness import own_drift, unwitnessed
from ptt.diagnosis.search.fits import without_carried
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.telling.coincidence import coincidences
from ptt.diagnosis.telling.exchange import Exchange, exchanged_doubt
from ptt.diagnosis.telling.mimic import EITHER, find_sum, growth_doubt, is_growth, kept_warm
from ptt.diagnosis.telling.steps import Named, Step, share_of
from ptt.diagnosis.telling.words import explain_step
from ptt.effects import Effect
from ptt.effects.phrases import listed
from ptt.fitting.linear import tried_sizes
from ptt.fitting.result import MEASURED_SHARE, FitResult
from ptt.fitting.turns import like_play, like_windup, marked, with_turns
from ptt.model.model import Term, parameter_names, told_values
from ptt.record import Record
from ptt.run.noise import Noise
from ptt.run.problem import Problem

MOST_SHOWN = 10  # candidates listed beyond the steps
# Most probability of an effect that is found and not named: held-out readings or an unknown speak against it
MOST_UNNAMED = 0.5


class Estimate(NamedTuple):
    """One parameter: its value and its standard error, None where the data do not determine it."""

    name: str
    unit: str
    value: float
    std: float | None


@dataclass(frozen=True)
class Candidate(Record):
    """One effect as an explanation of the run.

    Attributes:
        effect: key of the effect.
        probability: that it is part of what is missing.
        p_value: upper bound of the probability of as much evidence for it if it were absent: the inverse of its Bayes
            factor (Ville's inequality), with prior odds for every candidate and shape.
        explained_share: share of the residual variance after the frame that it explains by itself.
        heldout_before: error on held-out blocks without it, um.
        heldout_after: error on held-out blocks with it, um.
        parameters: its values; of candidates that are no steps only those that the data determine.
        indistinguishable_from: effects that would do as well.
        sum_of: two or more effects that would do as well together.
        words: why, for a machinist.
        tool_doubt: of the last step, root mean square doubt in the tool's position that no reading shows, um; None for
            the others.
    """

    keys: ClassVar[str] = (
        "effect, probability, p_value, explained_share, heldout_rms_um.before: heldout_before, "
        "heldout_rms_um.after: heldout_after, tool_doubt_um: tool_doubt, parameters, indistinguishable_from, sum_of, "
        "words"
    )

    effect: str
    probability: float
    p_value: float
    explained_share: float
    heldout_before: float
    heldout_after: float
    parameters: tuple[Estimate, ...]
    indistinguishable_from: tuple[str, ...]
    sum_of: tuple[str, ...]
    words: str
    tool_doubt: float | None = None


def candidates_of_steps(
    found: Found, told: Named, terms: tuple[Term, ...], others: tuple[Exchange, ...], chances: Probability,
    noise: Noise, problem: Problem,
) -> list[Candidate]:  # fmt: skip
    """Candidates of the steps.

    Args:
        found: the best explanation.
        told: the effects that it names.
        terms: these at their values.
        others: its model with moments of a slip and a knock exchanged.
        chances: probabilities from the scored sets.
        noise: the noise floor.
        problem: the readings.

    Returns:
        One for each step.
    """
    result: list[Candidate] = []
    named = told.steps
    sums = {found.system.atoms[step.key].name: find_sum(found.scorer, found.state, step.key) for step in named}
    grown = {name for name, together in sums.items() if is_growth(name, together)}
    parts = [told.doubt, own_drift(terms, problem, noise), exchanged_doubt(found, others, problem)]
    parts += [growth_doubt(term, problem) for term in terms if term.effect.key in grown]
    doubt = 1e3 * float(np.linalg.norm(parts))
    # Of a long run stretches would have to say what no reading shows.
    bare = without_carried(problem, found) if found.sample is None else None
    turned = found.fitted if bare is None else with_turns(found.fitted, bare)
    terms = tuple(marked(turned, term) for term in terms)
    for index, step in enumerate(named):
        name, before = found.system.atoms[step.key].name, [found.system.atoms[item.key].name for item in named[:index]]
        term = next((item for item in terms if item.effect.key == name), None)
        if term is None:
            continue
        own, beside = doubt if index == len(named) - 1 else None, [other for other in terms if other is not term]
        errors = step.before * 1e3, step.after * 1e3
        extra = found.fitted.unnamed_covariance
        play = "" if bare is None else like_play(turned, term, bare)
        alike = [like for like in (like_windup(turned, term), play, _beside_size(found.fitted, term)) if like]
        exceptions = f", except {' and '.join(alike)}" if alike else ""
        words = explain_step(
            term, step.others, sums[name], errors, noise, problem, before, own, beside, extra, exceptions
        )
        result.append(
            Candidate(
                name,
                with_lapse(min(chances.effects.get(name, 0.0), step.sure)) * (EITHER if name in grown else 1.0),
                float(np.exp(-max(step.nats, 0.0))),
                step.share,
                *errors,
                _parameters(term, problem),
                step.others,
                sums[name],
                " ".join(
                    [words, *coincidences(term, problem), *unwitnessed(term, problem, noise), *kept_warm(term, beside)]
                ),
                own,
            )
        )
    return result


def other_candidates(
    found: Found, named: tuple[Step, ...], chances: Probability, problem: Problem, oversized: Sequence[str] = ()
) -> list[Candidate]:
    """Other effects that would improve the model as given, each by itself, on held-out readings too.

    An effect that would need values that no machine has is left out: its columns hold only near the fitted model.

    Args:
        found: the best explanation.
        named: its steps.
        chances: probabilities from the scored sets.
        problem: the readings.
        oversized: names that are listed whatever their values.

    Returns:
        At most `MOST_SHOWN`, the best first.
    """
    scorer, atoms = found.scorer, found.system.atoms
    nothing = scorer.score((), found.state.memory)
    taken = {atoms[step.key].name for step in named}
    unnamed = {atoms[key].name for key in found.state.keys} - taken
    before = held_out_rms(scorer, ()) * 1e3
    result: list[Candidate] = []
    for gain in scorer.screen(nothing, is_effect):
        atom = atoms[gain.key]
        if atom.name in taken or gain.nats <= 0.0 or len(result) == MOST_SHOWN:
            continue
        if first_of(atom.name, {atom.name, *(atoms[given].name for given in scorer.given)}) != atom.name:
            continue  # on the model as given a second knock is the same as the first
        state = scorer.score((gain.key,), nothing.memory, {gain.key: gain.variances})
        after = held_out_rms(scorer, (gain.key,)) * 1e3
        wild = atom.name not in oversized and beyond_machines(state, atoms, found.system.scale)
        if wild or not after < before:
            continue
        parameters = _told(state, atom, found.system.scale, problem)
        chance = min(chances.effects.get(atom.name, 0.0), MOST_UNNAMED if atom.name in unnamed else 1.0)
        share = share_of(scorer, gain.key)
        result.append(
            Candidate(
                atom.name, with_lapse(chance), float(np.exp(-gain.nats)), share, before, after, parameters, (), (), ""
            )
        )
    return result


def _told(state: State, atom: Atom, scale: np.ndarray, problem: Problem) -> tuple[Estimate, ...]:
    """Values of an effect that the run determines better than both its learned prior and its usual size.

    An absent effect may learn any prior variance along directions that it hardly shows: a joint a foot off its place.
    """
    assert atom.effect is not None
    values = atom.amplitudes(state.posterior.values[state.of(atom.key)], scale)
    std, prior = state.errors(atom, scale)
    usual = tried_sizes(atom.effect, problem)
    told = std[: len(usual)] ** 2 < MEASURED_SHARE * np.minimum(prior[: len(usual)], usual) ** 2
    rows = zip(_names(atom.effect, problem), values, std, told, strict=False)  # what is linear comes first
    return tuple(Estimate(*name, float(value), float(error)) for name, value, error, seen in rows if seen)


def _names(effect: Effect, problem: Problem) -> list[tuple[str, str]]:
    kind, joints = problem.file.machine.kind, problem.view.joints
    names = parameter_names(effect, kind, joints)
    units = [p.on(kind).unit for p in effect.parameters for _ in range(p.size(joints))]
    return list(zip(names, units, strict=True))


def _parameters(term: Term, problem: Problem) -> tuple[Estimate, ...]:
    rows, told = [], told_values(term.effect, term.theta, problem.view.joints)
    for index, (name, unit) in enumerate(_names(term.effect, problem)):
        if not told[index]:
            continue
        std = float("nan") if term.std is None else float(term.std[index])
        seen = term.measured is None or bool(term.measured[index])
        rows.append(Estimate(name, unit, float(term.theta[index]), std if seen and np.isfinite(std) else None))
    return tuple(rows)


def _beside_size(fitted: FitResult, term: Term) -> str:
    """Words on sizes of the drawing beside which quite other values of an effect would fit as well; '' for none."""
    pairs = () if fitted.unnamed is None else fitted.unnamed.otherwise
    sizes = [size for effect, size in pairs if effect == term.effect.key]
    return f"other values of it together with {listed(sizes, ' or ')}" if sizes else ""
