"""Computing the contents of a report, by the same functions as the other verbs."""

import platform
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import TypeVar

from ptt.correct.training.compensator import Compensator
from ptt.correct.training.heldout import evaluate_heldout
from ptt.correct.training.protocols import PROTOCOLS
from ptt.diagnosis.diagnose import diagnose_run
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.floor import noise_floor
from ptt.effects.registry import Library, library
from ptt.errors import InputError, ModelError
from ptt.judge.before_after import compare_pair
from ptt.judge.compare.comparison import compare_run
from ptt.judge.evaluation import Evaluation
from ptt.judge.history import read_entries, runs_of
from ptt.judge.iso.figures import iso_of_problem
from ptt.judge.ladder.climb import climb
from ptt.machine import MachineFile
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.progress import Progress, Tell, unwatched
from ptt.run.problem import Problem, build_problem
from ptt.run.table import Table
from ptt.show.report.commands import commands_of
from ptt.show.report.contents import Contents, ModelLook
from ptt.show.report.facts import facts_of
from ptt.show.report.network import network_facts
from ptt.show.report.source import MadeOf, shown_table
from ptt.version import __version__, installed

PACKAGES = ("torch", "numpy", "scipy", "pandas", "matplotlib", "safetensors", "jinja2")
STAGES = 6  # of the progress that is reported
NOTHING_TO_JUDGE = "the model has no effects and no network, so there is no 'after' to compare with"
Found = TypeVar("Found")


def gather(
    table: Table,
    machine: MachineFile | Compensator,
    source: MadeOf | None = None,
    *,
    known: Library | None = None,
    problem: Problem | None = None,
    after: Table | None = None,
    found_drawing: Diagnosis | None = None,
    found_given: Diagnosis | None = None,
    unexplained: str = "",
    progress: Progress = unwatched,
) -> Contents:
    """Compute the contents of a report.

    Args:
        table: the run.
        machine: machine file with its model, or a compensator with its network.
        source: files and options; None where there are no files to name.
        known: effects by name; None for the library.
        problem: problem of the same table and machine; None to build it.
        after: a later run of the same machine to compare this one with.
        found_drawing: diagnosis of the bare drawing, if it is known already; None to make it.
        found_given: diagnosis of the model, if it is known already; None to make it.
        unexplained: words on errors of the set-up that nothing explains; '' for none.
        progress: told what is done, how much of how much.

    Returns:
        The contents.

    Raises:
        InputError: run and machine cannot be brought together.
    """
    source, known = source or MadeOf(), known or library()
    compensator = machine if isinstance(machine, Compensator) else Compensator(read_model(machine, known), None, {})
    model, shown = compensator.model, shown_table(table, source)
    problem = replace(problem or build_problem(model.file, table), table=shown)
    why: dict[str, str] = {}
    look = partial(_look, problem=problem, known=known, source=source, unexplained=unexplained)
    drawing = look(
        Model(model.file), found=found_drawing, tell=lambda what: progress(f"the drawing: {what}", 0, STAGES)
    )
    given = drawing
    if model.terms:
        given = look(model, found=found_given, tell=lambda what: progress(f"the model: {what}", 1, STAGES))
    progress("fit", 2, STAGES)
    noisy = problem if given.comparison.noise is None else problem.with_noise(given.comparison.noise)
    refit = _unless("fit", why, lambda: climb(model, noisy, [], progress=progress), source)
    progress("evaluate", 3, STAGES)
    evaluation = _unless("evaluate", why, lambda: _evaluate(compensator, problem, progress), source) or {}
    progress("iso", 4, STAGES)
    iso = _unless("iso", why, lambda: iso_of_problem(problem), source)
    entries = _unless("history", why, lambda: read_entries(model.file), source) or ()
    ladders = tuple(tuple(ladder) for ladder in runs_of(entries))
    progress("write", 5, STAGES)
    return Contents(
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        source=source,
        facts=facts_of(problem),
        problem=problem,
        known=known,
        drawing=drawing,
        given=given,
        ladders=ladders,
        refit=refit,
        evaluation=evaluation,
        network=None if compensator.network is None else network_facts(compensator, problem, source),
        iso=iso,
        why_not=why,
        versions=_versions(),
        commands=commands_of(source, model, compensator.network is not None),
        pair=None if after is None else compare_pair(shown, shown_table(after, source), model.file),
    )


def with_network(model: Compensator, trained: Compensator, where: str) -> Compensator:
    """Add to a model the network that was trained on its residual.

    Args:
        model: the model.
        trained: compensator with the network.
        where: name of its folder, for messages.

    Returns:
        The model with the network.

    Raises:
        ModelError: the folder has no network, or it was trained on another model.
    """
    if trained.network is None:
        raise ModelError("no network in it", where=where, fix="name the folder that train.py wrote")
    if trained.model.keys != model.model.keys or trained.model.file.machine != model.model.file.machine:
        theirs, ours = (", ".join(one.model.keys) or "no effects" for one in (trained, model))
        what = f"trained on another model ({theirs}) than the one given ({ours})"
        raise ModelError(what, where=where, fix="train it again on this model, or name it as --model")
    return replace(model, network=trained.network, notes=trained.notes)


def _look(
    model: Model,
    problem: Problem,
    known: Library,
    source: MadeOf,
    found: Diagnosis | None,
    unexplained: str,
    tell: Tell,
) -> ModelLook:
    why: dict[str, str] = {}
    noise = _unless("noise", why, lambda: noise_floor(model, problem, known), source)
    if found is None:
        learned = _unless("diagnose", why, lambda: diagnose_run(model, problem, known, progress=tell), source)
        found = learned and learned.with_unexplained(unexplained)
    tell("compare")
    return ModelLook(model, compare_run(model, problem, noise=noise), found, why.get("diagnose", ""))


def _unless(what: str, why: dict[str, str], action: Callable[[], Found], source: MadeOf) -> Found | None:
    """The result of an action; None where it raises InputError, whose message is then kept in `why`."""
    try:
        return action()
    except InputError as error:
        why[what] = source.clean(str(error))
        return None


def _evaluate(compensator: Compensator, problem: Problem, tell: Progress) -> dict[str, Evaluation]:
    if not compensator.model.terms and compensator.network is None:
        raise ModelError(NOTHING_TO_JUDGE)
    return {
        name: evaluate_heldout(compensator, problem, make(problem), progress=tell) for name, make in PROTOCOLS.items()
    }


def _versions() -> tuple[tuple[str, str], ...]:
    there = ((name, number) for name, number in installed(PACKAGES).items() if number)
    return (("ptt", __version__), ("python", platform.python_version()), *there)
