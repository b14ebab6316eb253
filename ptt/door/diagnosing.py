"""`ptt.diagnose`: which physical effect is missing."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ptt.dependence.said import by_chance
from ptt.diagnosis.diagnose import diagnose_run
from ptt.diagnosis.long import chunk_size
from ptt.diagnosis.search.find import MOST_ADDED
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.words import doubt_in_words
from ptt.door.given import require_number
from ptt.door.handed import RowsLike
from ptt.door.model import as_model
from ptt.door.next_command import Given, given_in
from ptt.door.opened import Opened, open_checked
from ptt.door.result import Note, NoteCollector, Result, ignore_note
from ptt.door.words import as_run
from ptt.effects.phrases import capital, listed
from ptt.effects.prefilled import can_write
from ptt.errors import SetupError
from ptt.fitting.opening import told_aside
from ptt.machine import MachineFile
from ptt.plan.again import plan_again
from ptt.progress import Progress, unwatched
from ptt.run.named import named_rows
from ptt.run.noise import source_in_words
from ptt.run.problem import Problem
from ptt.run.table import Table
from ptt.run.taken import frames_said, set_up
from ptt.run.written import write_table
from ptt.setup import Check, setup_verdict

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

DOUBT_SHARE = 0.1  # ratio to the held-out error, below which the doubt adds nothing to the root sum of squares
STREAK = 5  # rows left out one after another: of readings of which one in twenty is gross, not once in a thousand runs
LEAST_CHUNK = 1000  # rows: smaller chunks cost more time than they save memory
USAGE = "diagnose(model, run)"
PLACEHOLDERS = Given()
# Of the table of candidates.
TO_ADD = "+ marks the effects to add; each of the others explains part of the same error, on the model as given."
NONE_TO_ADD = "Each of these effects explains part of the error by itself, on the model as given; none is to be added."
HELD_OUT = (
    "Held out: each block of travel predicted from a fit without it, linearised at the final model. `ptt add` refits",
    "at each step, so its held-out figures differ: slightly for effects to add, more for the others.",
)


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosed(Result):
    """What the run says about the model.

    Attributes:
        result: the diagnosis; None where the set-up has to be corrected first.
        opened: run and model; None in the same case.
        check: findings about the set-up.
        file: the machine as it was given.
        notes: what was left aside, a line each.
    """

    result: Diagnosis | None
    opened: Opened | None
    check: Check
    file: MachineFile
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """'missing', 'nothing-missing', 'unknown' or 'setup'."""
        return "setup" if self.result is None else self.result.verdict

    @property
    def suggested(self) -> tuple[tuple[str, ...], ...]:
        """For each step the effects that fit equally well, the pick first."""
        return () if self.result is None else self.result.suggested

    @property
    def words(self) -> str:
        """The verdict for a machinist."""
        return str(self.check) if self.result is None else self.result.words

    @property
    def measure_next(self) -> tuple[str, ...]:
        """What to measure next, in words."""
        return () if self.result is None else self.result.measure_next

    def _figures(self) -> Mapping[str, Any]:
        if self.result is None or self.opened is None:
            return setup_verdict(self.check)
        return self.result.to_dict() | self.opened.set_up

    def __str__(self) -> str:
        """What the command prints."""
        if self.result is None:
            return f"verdict: setup\n\n{self.check}"
        problem = None if self.opened is None else self.opened.problem
        return format_diagnosis(self.result, problem, given_in(self.opened))

    def to_frame(self) -> "pd.DataFrame":
        """One row for each candidate: share, p-value, held-out error before and after in um, ties."""
        import pandas as pd

        rows = self.to_dict()["candidates"]
        held = [{f"heldout_{key}_um": value for key, value in row.pop("heldout_rms_um").items()} for row in rows]
        return pd.DataFrame([{**row, **more} for row, more in zip(rows, held, strict=True)])

    def plot(self) -> "Figure":
        """Draw the held-out error that each candidate takes away; the machine where the set-up comes first."""
        if self.result is None:
            from ptt.door.checking import draw

            return draw(self.file)
        from ptt.show.plots.diagnosis import draw_candidates

        return draw_candidates(self.result)

    def poses(self) -> Table | None:
        """Poses that would tell tied effects apart, or show an unknown better, in driving order; None for none."""
        return None if self.result is None or self.opened is None else poses_of(self.result, self.opened.problem)

    def write_poses(self, out: str | Path) -> int:
        """Write poses that would tell tied effects apart, or show an unknown better.

        Args:
            out: CSV to write.

        Returns:
            How many; 0, and nothing written, where there are none.
        """
        table = self.poses()
        if table is None:
            return 0
        write_table(table, out)
        return int(table.rows)


def diagnose(
    model: Any,
    run: RowsLike,
    *,
    steps: int = MOST_ADDED,
    chunk_rows: int | None = None,
    anyway: bool = False,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Diagnosed:
    """Say what is missing from the model, or that nothing is, or that none of the effects fits.

    Args:
        model: the model; a network is left aside.
        run: the run.
        steps: how many effects the path may add, from 1 on.
        chunk_rows: rows per chunk, from 1,000 on; None: no chunks up to 20,000 rows, of an arm 2,000.
        anyway: whether to go on although the set-up looks mistaken.
        progress: told what is done, how much of how much.
        note: told what is left aside.

    Returns:
        The diagnosis; verdict 'setup' where the set-up has to be corrected first.

    Raises:
        InputError: the run does not fit this machine, or a number is out of its range.
    """
    require_number(steps, 1, "steps", whole=True)
    require_number(chunk_rows, LEAST_CHUNK, "chunk_rows", whole=True)
    machine = as_model(model, USAGE)
    rows = as_run(run, machine, USAGE)
    tell = NoteCollector(note)
    try:
        opened = open_checked(machine, rows, anyway=anyway, note=tell)
    except SetupError as error:
        return Diagnosed(None, None, error.check, machine.file, tuple(tell.lines))
    if opened.compensator.network is not None:
        tell("the compensator's network is left aside: the physics alone is diagnosed")
    size = chunk_size(opened.problem, chunk_rows)
    if size is not None:
        tell(f"{opened.table.rows} rows are processed in chunks of {size}")
    result = diagnose_run(
        opened.model, opened.problem, opened.library,
        steps=steps, chunk_rows=size, progress=lambda what: progress(what, 0, 0),
    ).with_unexplained(opened.check.unexplained)  # fmt: skip
    return Diagnosed(result, opened, opened.check, machine.file, tuple(tell.lines))


def poses_of(result: Diagnosis, problem: Problem) -> Table | None:
    """Poses that would tell tied effects apart; else, of an unknown that poses would show better, a further run.

    Args:
        result: the diagnosis.
        problem: the run; a further one stays where its tool and joints went, under its loads.

    Returns:
        Targets in driving order; None where poses would tell no more.
    """
    if result.separation is not None and result.separation.targets is not None:
        return result.separation.targets
    return plan_again(result.model, problem) if result.asks_for_poses else None


def format_diagnosis(result: Diagnosis, problem: Problem | None = None, given: Given = PLACEHOLDERS) -> str:
    """The diagnosis as text.

    Args:
        result: the diagnosis.
        problem: the run, for its frame and the lines of rows that were left out; None without these.
        given: run and model as they were given, for the next command.

    Returns:
        Lines.
    """
    lines = [f"verdict: {result.verdict}", "", result.words, ""]
    lines += [*_candidates(result), ""] if result.candidates else []
    lines += _meanings(result)
    lines += [*_dependences(result), ""] if result.depends_on else []
    if result.measure_next:
        lines += ["measure next:", *(f"  {line}" for line in result.measure_next)]
        poses = result.asks_for_poses or (result.separation is not None and result.separation.targets is not None)
        lines += ["  `--measure-next OUT.csv` writes poses to measure.", ""] if poses else [""]
    lines += [*_next(result, given), ""] if result.verdict != "nothing-missing" and result.is_settled else []
    if result.not_testable:
        lines.append("not testable on this run:")
        lines += [f"  {name} needs {lack}" for name, lack in result.not_testable.items()]
    noise, left = result.noise.to_dict(), int(result.outliers.sum())
    where = "" if problem is None or not left else f": {named_rows(problem.table, result.outliers)}"
    where += "" if problem is None else _streak(result.outliers, problem)
    opens = int(result.opening.sum())
    aside = f"; {told_aside(opens)}" if opens else ""
    lines += [] if problem is None else frames_said(set_up(problem)["frame_taken"])
    lines.append(
        f"noise floor {noise['total']:.2f} um from {source_in_words(noise['source'])}; {result.rows} readings, "
        f"{left} left out as gross errors{where}{aside}"
    )
    return "\n".join(lines)


def _streak(left_out: np.ndarray, problem: Problem) -> str:
    """A clause on rows that were left out one after another, which is no scatter; '' for fewer than `STREAK`."""
    read = problem.used | left_out
    rows = np.flatnonzero(read)
    ends = np.flatnonzero(np.diff(left_out[read].astype(int), prepend=0, append=0)).reshape(-1, 2)
    first, behind = max(ends.tolist(), key=lambda pair: pair[1] - pair[0], default=(0, 0))
    if behind - first < STREAK:
        return ""
    begin, end = (problem.table.line[rows[place]] for place in (first, behind - 1))
    return (
        f"; those of lines {begin} to {end} come one after another, which is no scatter: look for what happened there"
    )


def _next(result: Diagnosis, given: Given) -> list[str]:
    """Lines on the next step after the verdict."""
    lines, names = list[str](), result.to_add
    if names:
        sizes = result.names_size
        lines.append(f"next: {given.add(names, sizes=sizes)}")
        if sizes:
            lines.append("--sizes also fits all other sizes of the drawing, which improves commands at other poses")
    said = any(can_write(each.on, each.acts_on, each.together) for each in result.depends_on)
    if result.verdict == "unknown" and said:
        lines.append(
            "to describe it yourself, save the output of --json as D.json, then: ptt effects new NAME --like D.json"
        )
    return lines


def _candidates(result: Diagnosis) -> list[str]:
    """A line for each effect, the steps of the path first, and what the columns mean."""
    width = max(20, *(len(candidate.effect) for candidate in result.candidates))
    lines = [f"{'effect':<{width + 2}} {'p-value':>9} {'share':>7} {'held-out um':>18}  cannot be told from"]
    for candidate in result.candidates:
        mark = "+" if any(candidate.effect == step[0] for step in result.suggested) else " "
        fall = f"{candidate.heldout_before:.1f} -> {candidate.heldout_after:.1f}"
        ties = ", ".join(candidate.indistinguishable_from)
        chance = by_chance(candidate.p_value).removeprefix("p ").removeprefix("= ")
        figures = f"{chance:>9} {candidate.explained_share:>7.1%} {fall:>18}"
        lines.append(f"{mark} {candidate.effect:<{width}} {figures}  {ties}".rstrip())
    lines += ["", TO_ADD if result.suggested else NONE_TO_ADD, *HELD_OUT]
    last = result.candidates[len(result.suggested) - 1] if result.suggested else None
    if last is not None and (doubt := doubt_in_words(last.heldout_after, last.tool_doubt, DOUBT_SHARE)):
        lines += [f"{capital(doubt)}: other models that fit equally well place it elsewhere."]
    return lines


def _meanings(result: Diagnosis) -> list[str]:
    """What each step means, unless the words of the verdict say it."""
    steps = result.candidates[: len(result.suggested)]
    if all(step.words in result.words for step in steps):
        return []
    return ["what each step means:", *(f"  {step.words}" for step in steps), ""]


def _dependences(result: Diagnosis) -> list[str]:
    """What the remaining error depends on, a line or two each."""
    lines = ["the remaining error depends on:"]
    for item in result.depends_on:
        period = f", period {item.period_mm:.3g} {item.unit}".rstrip() if item.period_mm else ""
        place = f", {item.how()}" if item.place or item.moments else ""
        place = f", varying with {item.with_}" if item.with_ and item.shape != "gradual" else place
        acts = f", acting on {item.acts_on}" if item.acts_on not in (None, item.residual) else ""
        share = f"{item.share:.0%} ({by_chance(item.p_value)}{period}{place})"
        on = f"{listed(item.together)} together" if item.together else item.on
        share += "" if item.alone_share is None else f", {item.on} alone {item.alone_share:.0%}"
        lines += [f"  {item.residual} on {on}: {share}{acts}", *([f"    {item.words}"] if item.words else [])]
    return lines
