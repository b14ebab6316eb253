"""A model beside a run: effects of one run apply to the rows of that run, and to no others."""

from dataclasses import replace

import numpy as np

from ptt.effects.dated import RunPlace, at_place, has_date, is_dated
from ptt.model.model import Model, Term
from ptt.run.problem import Problem
from ptt.run.table import Table
from ptt.run.target_frame import kept_frame


def for_runs(model: Model, problem: Problem) -> tuple[Model, tuple[str, ...]]:
    """The model as it holds for the runs of a problem.

    An effect of the set-up (a frame, a drift, a knock) is set aside for runs that it was not fitted on. A change of the
    machine at some moment of one run (a slip) holds for later runs from their first row on. How warm a body was when a
    run began is of that run. The frame in which the targets were stated is kept for targets to come.

    Args:
        model: as read.
        problem: the rows.

    Returns:
        The model, and one line for the user on each effect that is left out or applied in part.
    """
    terms, aside, lines = [], list(model.aside), []
    for term in model.terms:
        if not has_date(term.effect, term.theta) or not len(term.theta):
            terms.append(term)
            continue
        place = _find(term, problem)
        if not term.runs:
            lines.append(f"{term.effect.key}: the model does not say of which run it is; taken to be of this one")
            terms.append(term)
        elif place is None:
            terms.append(term)
        elif place.runs or not term.effect.of_run:
            terms.append(replace(term, effect=at_place(term.effect, place)))
            lines.append(_partly(term, place))
        else:
            aside.append(term)
            lines.append(f"{term.effect.key} is left out: it belongs to another run ({term.runs[0][:12]})")
    file = replace(model.file, targets=kept_frame(model.file.targets, problem.stated_in))
    return replace(model, file=file, terms=tuple(terms), aside=tuple(aside)), tuple(lines)


def _partly(term: Term, place: RunPlace) -> str:
    """To which rows an effect is applied, in words."""
    if term.effect.of_run:
        return f"{term.effect.key} applies to the rows of its own run alone ({term.runs[0][:12]})"
    if not is_dated(term.effect):
        return f"{term.effect.key}: how warm its body began is of its own run alone ({term.runs[0][:12]})"
    when = "from the first row of the runs behind it" if place.runs else "from the first row"
    return f"{term.effect.key} happened in run {term.runs[0][:12]}: it holds {when}"


def _find(term: Term, problem: Problem) -> RunPlace | None:
    """Where the runs of an effect lie in the table; None where they are the whole table."""
    files, codes = _files(problem.table)
    if files == term.runs:
        return None
    if not term.runs or term.runs[0] not in files:
        return RunPlace(())
    first = last = files.index(term.runs[0])
    while last + 1 < len(files) and files[first : last + 2] == term.runs[: last + 2 - first]:
        last += 1
    runs = tuple(code for at in range(first, last + 1) for code in codes[at])
    row = int(np.argmax(np.isin(problem.table.run, runs)))
    return RunPlace(runs, float(problem.view.time[row]), float(row))


def _files(table: Table) -> tuple[tuple[str, ...], list[list[int]]]:
    """Files of a table in their order, and the codes of the runs in each."""
    files: list[str] = []
    codes: list[list[int]] = []
    for code, digest in enumerate(table.run_sha256):
        if not files or digest != files[-1]:
            files.append(digest)
            codes.append([])
        codes[-1].append(code)
    return tuple(files), codes
