"""Recheck: has a machine changed since its model was fitted, and in what?"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import torch

from ptt.again.another import is_another
from ptt.again.artefacts import drop_artefacts
from ptt.again.changes import CHANGED_PREFIX, Change
from ptt.again.contexts import context_notes, scatter_notes
from ptt.again.cures import with_cures
from ptt.again.explanation import Explanation, displacement_of, find_explanation
from ptt.again.extrapolation import extrapolation_notes
from ptt.again.figures import CLEAR, Moved, clear_then, errors_of, estimate_moves, every_value, tool_error_by_effect
from ptt.again.linear_problem import model_at
from ptt.again.masked_effects import MASKED_PREFIX, MaskedEffect
from ptt.again.news import News, look_for_news
from ptt.again.prior import Prior, build_prior
from ptt.again.result import ChangedValue, Recheck, Verdict
from ptt.again.words import Values, explain, say_change, say_gone, say_whole, values_of
from ptt.diagnosis.evidence.noise_level import noise_after
from ptt.diagnosis.telling.enough import require_enough
from ptt.diagnosis.telling.steps import name_steps
from ptt.diagnosis.telling.ties import ties
from ptt.effects import Library, library
from ptt.fitting.chunks import SAMPLE_ROWS, numbers, sample_stretches, take
from ptt.fitting.linear import tried_sizes
from ptt.model.model import Model, Term, start_term
from ptt.progress import Tell
from ptt.run.problem import Problem

GONE = 0.2  # share of its former size below which a value, or a whole effect, is called repaired
Made = Mapping[str, Mapping[str, float]]  # 'before' and 'now' -> effect -> tool error, um
WHOLE = 10_000  # rows, beyond which a sample is used: linearising all hypotheses takes about 0.25 MB a row


def recheck(model: Model, problem: Problem, known: Library | None = None, *, progress: Tell | None = None) -> Recheck:
    """Compare a new run with a solved model.

    The posterior of the model's fit is the prior of a machine that has not changed; against it stand changes of single
    values, effects that the model does not have, and unknown physics, all by their evidence.

    Args:
        model: solved, as it holds for the run (`ptt.model.of_run.for_runs`).
        problem: the new run, whose set-up and noise are its own.
        known: effects by name; None for the library.
        progress: told what is being done.

    Returns:
        What has changed.

    Raises:
        ModelError: nothing was fitted in the model.
        TableError: too few readings, or nothing tells their noise.
    """
    require_enough(problem)
    known = library() if known is None else known
    tell = progress or (lambda what: None)
    notes = list(_same_run(model, problem))
    if problem.table.rows > WHOLE:
        notes.append(f"of {problem.table.rows} rows, about {SAMPLE_ROWS} were used, in stretches spread over the run")
        problem = take(problem, sample_stretches(problem, SAMPLE_ROWS))
    prior = build_prior(model, problem)
    found, now, news = _explained(prior, problem, known, tell)
    made = {
        "before": tool_error_by_effect(found, prior.values),
        "now": tool_error_by_effect(found, found.prior.start + _stands(found)),
    }
    changed = _changed(found, problem, made)
    noise = noise_after(problem, found.system, found.state).to_dict()
    steps = () if news.diagnosis is None else news.diagnosis.suggested
    verdict: Verdict = "new" if news.diagnosis is not None else "changed" if changed else "same"
    result = Recheck(
        verdict=verdict,
        changed=changed,
        new=news.diagnosis,
        parameters=every_value(found),
        error_um=errors_of(found, problem),
        made_um=made,
        other_machine=is_another(found, changed, made["before"], len(steps), noise["total"]),
        noise_um=noise,
        since=prior.since,
        rows=len(found.system.rows),
        outlier_rows=tuple(int(row) for row in numbers(problem)[found.gross]),
        notes=(
            *notes,
            *prior.notes,
            *news.notes,
            *_masked_notes(found),
            *_set_up(found),
            *scatter_notes(prior, noise["total"]),
            *context_notes(prior, problem),
            *extrapolation_notes(prior, problem),
        ),
        words="",
        model=replace(model, terms=_merged(model, now)),
    )
    return replace(result, words=explain(result))


def _explained(prior: Prior, problem: Problem, known: Library, tell: Tell) -> tuple[Explanation, Model, News]:
    """The best explanation, the model with the values of this run, and what is new beside it."""
    found = with_cures(find_explanation(prior, problem, known, tell), problem, known, tell)
    now, news = _with_news(found, problem, known, tell)
    if news.diagnosis is not None and found.changed:
        sure = drop_artefacts(found, news.diagnosis, problem, known, tell)
        if sure is not found:
            then = _with_news(sure, problem, known, tell)
            if then[1].diagnosis is not None:  # else nothing is new without the changes: keep them
                return sure, *then
    return found, now, news


def _with_news(found: Explanation, problem: Problem, known: Library, tell: Tell) -> tuple[Model, News]:
    """The model with the values of this run, and what is new beside it."""
    now = model_at(found.prior, _stands(found))
    whole = replace(now, terms=(*now.terms, *(_term_of(masked, found, problem) for masked in found.masked)))
    return now, look_for_news(found, whole, problem, known, tell)


def _term_of(masked: MaskedEffect, found: Explanation, problem: Problem) -> Term:
    values = found.state.posterior.values[found.state.of(masked.key)]
    term = start_term(masked.effect, problem.view)
    term.theta[: len(values)] = torch.as_tensor(values * tried_sizes(masked.effect, problem))
    return term


def _same_run(model: Model, problem: Problem) -> tuple[str, ...]:
    """A note where the model was fitted on this very run."""
    steps = model.file.steps
    files = {item["sha256"] for item in steps[-1].get("files", ())} if steps else set()
    if files & {digest for digest in problem.table.run_sha256 if digest}:
        return ("this is the run the model was fitted to: it cannot show whether the machine has changed since",)
    return ()


def _stands(found: Explanation) -> np.ndarray:
    """Displacement of the model's values from `Prior.start` by changes and their uncertainty, (w,) in usual sizes."""
    uncertain = np.flatnonzero(found.state.owner < 0)[len(found.frame) :][: found.prior.root.shape[1]]
    return displacement_of(found) + found.prior.root_now @ found.state.posterior.values[uncertain]


def _merged(model: Model, now: Model) -> tuple[Term, ...]:
    own = {term.effect.key: term for term in now.terms}
    return tuple(replace(t, theta=own[t.effect.key].theta) if t.effect.key in own else t for t in model.terms)


def _named(found: Explanation) -> tuple[Change, ...]:
    """Changes that may be named: beside unknown physics only those that pass the tests of a diagnosis.

    Without unknown physics the evidence suffices. Held-out readings say nothing of a change: the uncertainty of the
    model's values predicts them as well, only with a lower prior probability.
    """
    if all(found.system.atoms[key].effect for key in found.state.keys):
        return found.changed
    named = {step.key for step in name_steps(found.scorer, found.state).steps}
    return tuple(c for c in found.changed if c.key in named or c.effect.key in found.prior.cured)


def _changed(found: Explanation, problem: Problem, made: Made) -> tuple[ChangedValue, ...]:
    """Values that have changed, the largest |z| first."""
    changes = _named(found)
    if not changes:
        return ()
    places = [(change.effect.key, int(place)) for change in changes for place in change.at]
    every = list(zip(places, estimate_moves(found, changes), strict=True))
    rows, at = list[ChangedValue](), 0
    for change in changes:
        key = change.effect.key
        (term,) = (term for term in found.prior.layout.terms if term.effect.key == key)
        values = values_of(term, [(place, moved) for (effect, place), moved in every if effect == key])
        own = every[at : at + len(change.names)]
        at += len(own)
        # A value that changes by itself beside its whole effect has a row of its own.
        others = [other for other in changes if other.effect.key == key and change.whole and not other.whole]
        alone = {name for other in others for name in other.names}
        pairs = [(moved, place) for (_, place), moved in own if moved.name not in alone]
        rows += _rows_of(found, change, values, pairs, problem, made) if pairs else []
    return tuple(sorted(rows, key=lambda row: -abs(row.moved.z)))


def _alike(found: Explanation, change: Change) -> tuple[str, ...]:
    """Changes, or new effects, that explain the run as well as a change."""
    if change.effect.key in found.prior.cured:
        return found.alike.get(change.effect.key, ())
    others = ties(found.scorer, found.state, change.key)
    return tuple(_plainly(name) for name in others if name != change.key)


def _plainly(name: str) -> str:
    return (
        f"{name.removeprefix(MASKED_PREFIX)}, then already"
        if name.startswith(MASKED_PREFIX)
        else name.removeprefix(CHANGED_PREFIX)
    )


def _rows_of(
    found: Explanation, change: Change, values: Values, pairs: Sequence[tuple[Moved, int]], problem: Problem, made: Made
) -> list[ChangedValue]:
    """Values of one change that differ clearly, each with its words; those of a whole effect share one sentence."""
    since, alike, known = found.prior.since, _alike(found, change), clear_then(found, change)
    was, now = (made[when][change.effect.key] for when in ("before", "now"))
    gone = now < GONE * was
    clear = [pair for pair in pairs if abs(pair[0].z) > CLEAR and pair[0].before != pair[0].now]
    sure = [pair for pair in clear if pair[0].name in known]
    clear = sure or clear or [max(pairs, key=lambda pair: abs(pair[0].z))]
    if change.whole:
        cures = [gone or is_repaired(abs(value.before), abs(value.now), value.std) for value, _ in clear]
        words = say_whole(values, [value for value, _ in pairs], problem.view, since, repaired=all(cures))
        return [ChangedValue(value, cured, alike, words) for (value, _), cured in zip(clear, cures, strict=True)]
    rows = []
    for value, place in clear:
        told = values.told(place, problem.view)
        sizes = (told[0].size, told[1].size, told[1].error) if told else (abs(value.before), abs(value.now), value.std)
        back = is_repaired(*sizes)
        # Values of an effect may count against each other: the error may be gone though one is far on the other side.
        beyond = gone and not back and value.before * value.now < 0.0 and abs(value.now) > CLEAR * value.std
        words = say_change(change.effect, told, value, problem.view, since, repaired=(gone or back) and not beyond)
        words = say_gone(words, change.effect, was, now) if beyond else words
        rows.append(ChangedValue(value, (gone or back) and not beyond, alike, words))
    return rows


def is_repaired(was: float, now: float, std: float) -> bool:
    """Whether an error that was clearly there is back near zero.

    Args:
        was: size in the model.
        now: size in this run.
        std: standard error of the difference.

    Returns:
        Whether it is.
    """
    return was > CLEAR * std and (now < GONE * was or (now < CLEAR * std and now < 0.5 * was))


def _masked_notes(found: Explanation) -> tuple[str, ...]:
    """A note on each masked effect in the best set."""
    return tuple(
        f"{masked.effect.key} is not in the model, because the model's run could hardly tell it from the effects that "
        "are; both runs are explained best if it was present then as now: diagnose them together "
        "(ptt diagnose THEN.csv --also NOW.csv)"
        for masked in found.masked
    )


def _set_up(found: Explanation) -> tuple[str, ...]:
    names = (found.system.atoms[key].name for key in found.set_up)
    return tuple(f"the set-up moved during this run: {name}; this is subtracted" for name in names)
