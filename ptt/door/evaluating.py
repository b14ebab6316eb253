"""`ptt.evaluate`: error before and after, measured on two runs or computed on rows that were held out of one."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Any, Literal, get_args

from ptt.correct.training.heldout import evaluate_heldout
from ptt.correct.training.protocols import PROTOCOLS
from ptt.door.evaluated import SHOWN_ROWS, Evaluated
from ptt.door.given import require_word
from ptt.door.handed import RowsLike
from ptt.door.model import Model, as_model
from ptt.door.opened import open_checked
from ptt.door.options import ReadOptions
from ptt.door.reading import read_rows, require_mm
from ptt.door.result import Note, NoteCollector, ignore_note
from ptt.door.run import Rows, Run
from ptt.door.words import as_run, read_for
from ptt.errors import InputError
from ptt.judge.aimed import lent_in_words
from ptt.judge.alike import hints_on
from ptt.judge.evaluate import evaluate_pair
from ptt.judge.evaluation import GOALS, Evaluation, compare_errors
from ptt.judge.run_errors import Datum
from ptt.progress import Progress, unwatched
from ptt.run.readers import Ask
from ptt.run.table import Table

Frame = Literal["fitted", "fitted-per-run", "trusted", "measured"]
SHIFTING = ("tracker-frame", "tracker-scale")  # effects that shift all readings of a trusted frame
USAGE = "evaluate(before, after) or evaluate(model, run)"
NO_SEAT = (
    "without --model it is not known whether the reflector sits at the arm's tool point; if it does not, its rotation "
    "with the tool counts as error before and after"
)
WORSE = 1.5  # ratio of the error after to that before, from which the two runs may be interchanged
HELD_OUT = ("blocks", "random")


def evaluate(
    first: Any,
    second: RowsLike,
    *,
    model: Any = None,
    frame: Frame | None = None,
    z_datum: Datum = "absolute",
    goal: float | tuple[float, float, float] | None = None,
    anyway: bool = False,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Evaluated:
    """Say how much error is gone: two runs as measured, or one run and a model on held-out rows.

    Args:
        first: a run before, or a model: one that was loaded, or the path of a machine.toml or compensator folder.
        second: a run after of the same poses, or the run.
        model: of two runs, the machine, where its tracker policy counts.
        frame: of two runs, how readings are brought into the base frame, instead of the machine's policy.
        z_datum: 'absolute', or 'first': z errors are counted from the first pose.
        goal: percent by which the error should fall; one for each axis, or one for all. `to_dict()` has `goal_percent`
            and `goal_met` in any case, of 90, 90, 80 as in the source paper where no goal is set; where
            `rest_is_noise` is true, a `goal_met` that is false says only that no more can be measured. The text judges
            a goal that was set.
        anyway: whether to go on although the set-up looks mistaken.
        progress: told what is done, how much of how much.
        note: told what was found on the way.

    Returns:
        Errors before and after.

    Raises:
        InputError: a file that cannot be read, no rows in common, or a word that is none of these.
    """
    require_word(frame, get_args(Frame), "frame")
    require_word(z_datum, get_args(Datum), "z_datum")
    goals = read_goals(goal)
    if _is_model(first):
        if frame is not None:
            raise InputError("frame is for two runs", where="frame", fix="the machine file's policy counts here")
        machine = as_model(first, USAGE)
        return computed(
            machine, as_run(second, machine, USAGE), z_datum=z_datum, goals=goals, anyway=anyway,
            progress=progress, note=note,
        )  # fmt: skip
    if _is_model(second):
        raise InputError(f"{USAGE}: got a run first and the model after it", fix="exchange them")
    machine_file = None if model is None else as_model(model, USAGE)
    before, after = (_rows_of(each, machine_file) for each in (first, second))
    return measured(before, after, machine_file, frame=frame, z_datum=z_datum, goals=goals, note=note)


def measured(
    before: Table,
    after: Table,
    model: Model | None,
    *,
    frame: Frame | None = None,
    z_datum: Datum = "absolute",
    goals: Mapping[str, float] | None = None,
    note: Note = ignore_note,
) -> Evaluated:
    """Compare two runs as they were measured; arguments as `evaluate`."""
    file, tell = None if model is None else model.file, NoteCollector(note)
    known = None if model is None else model.library
    result = evaluate_pair(before, after, file, frame=frame, z_datum=z_datum, known=known)
    data = result.to_dict()
    if lent := lent_in_words(data["protocol"]["targets_from_before"]):
        tell(lent)
    said = [_few_matched(data), _interchanged(data), _frame_known_false(model, frame), *_gross(before, after, result)]
    said += [NO_SEAT] if file is None and "q" in (before.joint_prefix, after.joint_prefix) else []
    hints = hints_on(before, after, result, told=file is not None or frame is not None)
    warnings = (*(one for one in said if one), *hints)
    return Evaluated(replace(result, goals=goals or GOALS), {}, goals is not None, tuple(tell.lines), warnings)


def computed(
    model: Model,
    run: Run,
    *,
    z_datum: Datum = "absolute",
    goals: Mapping[str, float] | None = None,
    anyway: bool = False,
    progress: Progress = unwatched,
    note: Note = ignore_note,
) -> Evaluated:
    """Errors on held-out blocks, and with the source paper's random split; arguments as `evaluate`."""
    tell = NoteCollector(note)
    opened = open_checked(model, run, anyway=anyway, note=tell)
    results = {}
    for name in HELD_OUT:
        protocol = PROTOCOLS[name](opened.problem)
        result = evaluate_heldout(opened.compensator, opened.problem, protocol, z_datum, progress=progress)
        results[name] = replace(result, goals=goals or GOALS)
    return Evaluated(results[HELD_OUT[0]], results, goals is not None, tuple(tell.lines), set_up=opened.set_up)


def run_rows(
    path: RowsLike, model: Model | None, reading: ReadOptions, ask: Ask | None = None, note: Note = ignore_note
) -> Table:
    """Read one of two runs as the command line does. The set-up is not checked, so wrong units are refused here."""
    return read_rows(path, None if model is None else model.file, reading, ask=ask, note=note)


def _is_model(given: Any) -> bool:
    if isinstance(given, Rows):
        return False
    if isinstance(given, Model) or isinstance(getattr(given, "model", None), Model):
        return True
    return isinstance(given, str | Path) and (Path(given).suffix == ".toml" or Path(given).is_dir())  # no run is either


def _rows_of(given: RowsLike, model: Model | None) -> Table:
    if isinstance(given, Run):
        table = given.table if model is None else read_for(given, model).table
        require_mm(table, None if model is None else model.file, given.reading)
        return table
    if isinstance(given, Rows):
        raise InputError(f"{USAGE}: got {type(given).__name__}, which hold no readings", fix="give two measured runs")
    return run_rows(given, model, ReadOptions(json=True))


def read_goals(goal: float | Iterable[float] | None, where: str = "goal") -> dict[str, float] | None:
    """Goals by axis.

    Args:
        goal: percent by which the error should fall, one for each axis, or one for all; None for none.
        where: what it is called, for messages.

    Returns:
        Percent by axis; None for none.

    Raises:
        InputError: not numbers, or another count of them.
    """
    if goal is None:
        return None
    values = tuple(goal) if isinstance(goal, Iterable) else (goal,)
    for value in values:
        if not isinstance(value, Real) or not math.isfinite(value):
            raise InputError(f"{value!r} is not a finite number", where=where, fix="give percent, as 90,90,80")
    if len(values) not in (1, 3):
        raise InputError(f"{len(values)} goals", where=where, fix="give one for each axis, or one for all")
    return dict(zip("xyz", map(float, values * (3 // len(values))), strict=True))


def _few_matched(data: dict[str, Any]) -> str:
    """Warning where less than half of a run has a counterpart in the other; else ''."""
    matched = data["protocol"]["rows"]
    rows = {side: matched + len(left) for side, left in data["unmatched"].items()}
    few = [f"{count} rows of {side.upper()}" for side, count in rows.items() if 2 * matched < count]
    return f"only {matched} of {' and of '.join(few)} count; the others have no counterpart" if few else ""


def _interchanged(data: dict[str, Any]) -> str:
    """Warning where the error after a compensation is far larger than before it; else ''."""
    before, after = (data["length"][f"{side}_um"] for side in ("before", "after"))
    if after < WORSE * before:
        return ""
    return f"AFTER is worse than BEFORE, {after:.1f} um against {before:.1f}: are the two interchanged?"


def _gross(before: Table, after: Table, result: Evaluation) -> list[str]:
    """Warning on gross readings: which they are, and the error reduction without them; empty without any."""
    runs = {"before": before, "after": after}
    places = [runs[side].place(row) for side, rows in result.gross.items() for row in rows]
    if not places:
        return []
    would, more = "", f" and {len(places) - SHOWN_ROWS} more" if len(places) > SHOWN_ROWS else ""
    if result.without is not None:
        pairs = (result.before, result.after), result.without
        counted, rest = (compare_errors(*pair)["length"]["reduction_percent"] for pair in pairs)
        if counted is not None and rest is not None:
            would = f"; without them the error falls by {rest:.1f} %, not {counted:.1f}"
    return [f"gross readings count: {', '.join(places[:SHOWN_ROWS])}{more}{would}"]


def _frame_known_false(model: Model | None, frame: Frame | None) -> str:
    """Warning where the frame is trusted although the model has effects that shift all readings; else ''."""
    if model is None or (frame or model.file.tracker.frame) != "trusted":
        return ""
    off = [name for name in SHIFTING if name in model.effects]
    told = f"the model says that the trusted frame is off ({' and '.join(off)}), which no command can correct: readings"
    return f"{told} are taken as they are; register the tracker anew, or give --frame fitted" if off else ""
