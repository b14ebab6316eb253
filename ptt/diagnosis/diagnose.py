"""Which physical effects are missing: find what explains the readings, test what it leaves, tell the verdict."""

from dataclasses import replace

from ptt.diagnosis.evidence.noise_level import LEAST_FREEDOM, noise_left
from ptt.diagnosis.evidence.saturated import too_few
from ptt.diagnosis.long import chunk_size, diagnose_long
from ptt.diagnosis.search.find import MOST_ADDED, find
from ptt.diagnosis.search.rest import look_for_rest
from ptt.diagnosis.search.smooth_way import on_smooth_way
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.given import as_free_as, prepare
from ptt.diagnosis.telling.other_setups import with_other_setups
from ptt.diagnosis.telling.verdict import conclude
from ptt.effects import Library
from ptt.fitting.opening import without_opening
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem
from ptt.run.smooth import SMOOTHLY


def diagnose_run(
    model: Model,
    problem: Problem,
    known: Library,
    *,
    steps: int = MOST_ADDED,
    chunk_rows: int | None = None,
    progress: Tell,
) -> Diagnosis:
    """`diagnose` as suits the run: as a whole, or summed up in chunks, of `chunk_rows` rows where these are given."""
    size = chunk_size(problem, chunk_rows)
    if size is None:
        return diagnose(model, problem, known, steps=steps, progress=progress)
    return diagnose_long(model, problem, known, steps=steps, progress=progress, size=size)


def diagnose(
    model: Model,
    problem: Problem,
    known: Library | None = None,
    *,
    steps: int = MOST_ADDED,
    progress: Tell | None = None,
) -> Diagnosis:
    """Learn which physical effects are missing from all rows at once.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name; None for the library.
        steps: how many may be added.
        progress: told what is being done.

    Returns:
        The diagnosis.

    Raises:
        TableError: nothing tells the noise floor, or too few readings for any verdict.
    """
    given, whole, tell = model, problem, progress or (lambda what: None)
    model, problem, known, opening = prepare(model, problem, known)
    found = find(model, problem, known, tell, steps)
    found, model, problem = on_smooth_way(found, model, problem, known, tell, steps)
    if found.opening is not None:
        opening, problem = opening | found.opening, without_opening(problem, found.opening)
    if problem.noise is None and noise_left(found.system, found.state).freedom < LEAST_FREEDOM:
        raise too_few(problem)
    tell("rest")
    rest = look_for_rest(found.system, found.state, problem)
    result = conclude(found, rest, model, problem, known, tell, steps)
    turned = f" {SMOOTHLY[0].upper()}{SMOOTHLY[1:]}." if model.file.machine.moves != given.file.machine.moves else ""
    result = replace(result, model=as_free_as(given, result.model), opening=opening)
    return with_other_setups(result, given, whole, turned)
