"""Processing one run: check its set-up, diagnose or recheck it, refit, and give its normal equations for trends."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ptt.diagnosis.diagnose import diagnose_run
from ptt.effects.registry import make_effect, parse_key
from ptt.errors import PttError
from ptt.fitting.result import left_um
from ptt.fitting.solve import FitResult, fit, hold, residual_of
from ptt.fleet.again import recheck_or_diagnose
from ptt.fleet.runs import Opened, open_task, read_task
from ptt.fleet.task import Outcome, Task
from ptt.fleet.told import told_by
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.machine import format_machine
from ptt.model.entries import write_model
from ptt.model.model import Model, Term
from ptt.progress import Tell


def work(task: Task, tell: Tell | None = None, effects: Sequence[str] = ()) -> Outcome:
    """Process one run.

    Args:
        task: the run.
        tell: told what is being done.
        effects: paths, as this process sees them, of Python files with effects of the user's own.

    Returns:
        The outcome; any error becomes one with the verdict 'failed'.
    """
    start, tell = time.perf_counter(), tell or (lambda what: None)
    try:
        outcome = _work(task, tell, effects)
    except PttError as error:
        outcome = Outcome(task.run, task.machine, "nothing", "failed", str(error), 0.0)
    except Exception as error:
        # An error that nobody foresaw in one run must not stop the others; `ptt fleet run --again` retries it.
        words = f"unexpected {type(error).__name__}: {error}"
        outcome = Outcome(task.run, task.machine, "nothing", "failed", words, 0.0)
    return replace(outcome, seconds=time.perf_counter() - start)


def refit(task: Task, effects: Sequence[str] = ()) -> str:
    """Fit the model that a run is compared with to that run.

    Args:
        task: the run.
        effects: as of `work`.

    Returns:
        Text of the machine.toml, with its history.
    """
    table, _ = read_task(task)
    opened = open_task(task, table, effects)
    return _add(opened.model, opened, [], task)[0]


def _work(task: Task, tell: Tell, effects: Sequence[str]) -> Outcome:
    tell("check")
    table, check = read_task(task)
    if check.sure:
        return Outcome(task.run, task.machine, "check", "setup", str(check), 0.0, check=check.to_dict())
    opened = open_task(task, table, effects)
    outcome = (_diagnose if task.solved is None else _recheck)(task, opened, check.unexplained, tell)
    return replace(outcome, check=check.to_dict())


def _diagnose(task: Task, opened: Opened, unexplained: str, tell: Tell) -> Outcome:
    """Process a machine's first run: diagnose it, add what it says to add, and keep that as the model."""
    model, problem, known = opened.model, opened.problem, opened.known
    found = diagnose_run(model, problem, known, progress=tell).with_unexplained(unexplained)
    tell("add")
    solved, fitted, noise = _add(model, opened, found.to_add, task)
    return Outcome(
        task.run, task.machine, "diagnosis", found.verdict, found.words, 0.0, left_um(fitted, problem), None, noise,
        diagnosis=found.to_dict(), solved=solved, refit=solved, told=told_by(fitted),
    )  # fmt: skip


def _recheck(task: Task, opened: Opened, unexplained: str, tell: Tell) -> Outcome:
    """Process a later run: recheck it, add new physics to the model if there is any, and refit the values to it."""
    model, problem = opened.model, opened.problem
    tell("recheck")
    again = recheck_or_diagnose(model, problem, opened.known, tell, unexplained)
    tell("refit")
    solved, fitted = None, fit(_testable(model, opened), problem)
    if again.added:
        solved, fitted, _ = _add(model, opened, again.added, task)
    refit = solved or format_machine(write_model(fitted.model, [task.run]))
    return Outcome(
        task.run, task.machine, "recheck", again.verdict, again.words, 0.0, again.now_um, again.expected_um,
        1e3 * fitted.noise.total, recheck=again.result, solved=solved, refit=refit, told=told_by(fitted),
    )  # fmt: skip


def _add(model: Model, opened: Opened, keys: list[str], task: Task) -> tuple[str, FitResult, float]:
    """Add effects to a model and fit it: its TOML with history, the last fit, and the noise floor in um."""
    effects = [make_effect(opened.known, *parse_key(key)) for key in keys]
    ladder = climb(model, opened.problem, effects)
    sources: list[dict[str, Any]] = [{"file": task.file, "sha256": task.run}]
    written = record(ladder, "add" if keys else "fit", sources, date=task.date)
    fitted = ladder.steps[-1].fitted
    if not keys and not model.terms:
        fitted = residual_of(model, opened.problem)
    return format_machine(written), fitted, float(ladder.noise_um["total"])


def _testable(model: Model, opened: Opened) -> Model:
    """The model with effects that this run cannot test held fixed, and all shapes, so that sizes can be compared."""
    view = opened.problem.view
    return replace(
        model, terms=tuple(hold(t) if t.effect.lacks(t.theta, view) else _hold_shape(t) for t in model.terms)
    )


def _hold_shape(term: Term) -> Term:
    """A term whose searched parameters (a period, a settling length) are held fixed."""
    searched = {parameter.stem for parameter in term.effect.parameters if parameter.role == "searched"}
    return replace(term, fixed=term.fixed | searched)
