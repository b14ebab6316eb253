"""What all verbs share: options, reading runs, output.

A verb is a file `ptt/commands/<verb>.py` with a function of that name (or a `typer.Typer` called `app` where it has
verbs of its own). `ptt.commands.main` finds it by its file name; nothing else is registered anywhere. At module level
it imports nothing heavier than typer, because `ptt --help` imports them all::

    def compare(
        run: Run, model: ModelPath, also: Also = None, targets: Targets = None, set_: Set = None, map_: Map = None,
        effects: Effects = None, json: Json = False,
    ) -> None:
        '''Compare a run with a model.'''
        from ptt.judge.compare.comparison import compare_run

        opened = open_run(run, model, Reading(also, targets, set_, map_, effects, json))
        with progress() as tell:
            result = compare_run(opened.model, opened.problem, progress=tell)
        show(result.to_dict(), format_result(result), json)

Errors are raised as `ptt.errors.InputError` and not caught: `main` prints one line and exits with the error's code.
Standard output belongs to the result; notes, understood columns and progress go to standard error by `note`.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ptt.commands.output import Progress, note, plain, progress, show, tell_notes

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator
    from ptt.effects.registry import Library
    from ptt.machine import MachineFile
    from ptt.model.model import Model
    from ptt.run.problem import Problem
    from ptt.run.readers import Ask
    from ptt.run.table import Table
    from ptt.setup import Check

Run = Annotated[Path, typer.Argument(metavar="RUN.csv", help="Tracker run: targets or joint commands, and readings.")]
ModelPath = Annotated[Path, typer.Option("--model", metavar="M", help="machine.toml or compensator folder.")]
Also = Annotated[list[Path] | None, typer.Option("--also", metavar="RUN2.csv", help="Another run; repeatable.")]
Targets = Annotated[
    Path | None, typer.Option("--targets", metavar="T.csv", help="Targets of an export that holds readings only.")
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="One value for all rows: payload_kg=2; order=time sorts the rows."),
]
Map = Annotated[Path | None, typer.Option("--map", metavar="FILE.toml", help="Saved answers on columns and units.")]
Effects = Annotated[
    list[Path] | None, typer.Option("--effects", metavar="FILE.py", help="Effects of your own; the file is run.")
]
Anyway = Annotated[bool, typer.Option("--anyway", help="Go on although the set-up looks mistaken.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else; never ask.")]

__all__ = [
    "Also", "Anyway", "Effects", "Json", "Map", "ModelPath", "Opened", "Progress", "Reading", "Run", "Set", "Targets",
    "check_rows", "note", "open_library", "open_model", "open_problem", "open_run", "parse_settings", "plain",
    "progress", "read_rows", "refuse_readings", "show", "tell_notes",
]  # fmt: skip


@dataclass(frozen=True)
class Reading:
    """The options that say how runs are read, as typer hands them over.

    Attributes:
        also: further runs.
        targets: file with the targets of an export.
        set_: 'column=value' each.
        map_: saved answers on columns and units.
        effects: Python files with effects of the user's own.
        json: whether a program, not a person, is listening.
        anyway: whether to go on although the set-up looks mistaken.
    """

    also: Sequence[Path] | None = None
    targets: Path | None = None
    set_: Sequence[str] | None = None
    map_: Path | None = None
    effects: Sequence[Path] | None = None
    json: bool = False
    anyway: bool = False


@dataclass(frozen=True)
class Opened:
    """A run and the model it is held against.

    Attributes:
        compensator: model, and the network where a compensator folder was named.
        table: the rows.
        problem: the same, seen through the machine.
        files: the run files, in the order given.
        library: effects by name, the user's own included.
        check: what was found in the set-up.
    """

    compensator: "Compensator"
    table: "Table"
    problem: "Problem"
    files: tuple[str, ...] = field(default=())
    library: "Library | None" = None
    check: "Check | None" = None

    @property
    def model(self) -> "Model":
        """The physics."""
        return self.compensator.model

    @property
    def set_up(self) -> dict[str, Any]:
        """What the frames of targets and tracker took, and effects of other runs that are left out, for JSON."""
        from ptt.run.taken import set_up

        return set_up(self.problem) | {"other_runs": [term.effect.key for term in self.model.aside]}


def open_run(run: Path, model: Path, reading: Reading) -> Opened:
    """Read a run and a model and bring them together.

    Args:
        run: tracker CSV.
        model: machine.toml or compensator folder.
        reading: how.

    Returns:
        Both.

    Raises:
        InputError: whatever cannot be read or used.
        SetupError: a mistake in the set-up that makes the rest worthless, unless `reading.anyway`.
    """
    from dataclasses import replace

    from ptt.errors import SetupError
    from ptt.model.of_run import for_runs
    from ptt.run.taken import set_up_lines
    from ptt.run.target_frame import kept_frame

    library = open_library(reading)
    compensator = open_model(model, library)
    file = compensator.model.file
    table = read_rows(run, file, reading, checked=True)
    setup = check_rows(file, table, reading)
    files = tuple(str(path) for path in (run, *(reading.also or ())))
    try:
        problem = open_problem(file, table)
    except Exception as error:
        if not setup.sure:
            raise
        raise SetupError(f"{_told(table, setup)}; nothing more can be said before that ({error})", setup) from error
    fitting, lines = for_runs(compensator.model, problem)
    for line in (*set_up_lines(problem), *lines):
        note(line)
    targets = kept_frame(fitting.file.targets, problem.stated_in)  # for targets to come
    fitting = replace(fitting, file=replace(fitting.file, targets=targets))
    return Opened(replace(compensator, model=fitting), table, problem, files, library, setup)


def check_rows(file: "MachineFile", table: "Table", reading: Reading) -> "Check":
    """Look for set-up mistakes before any physics; what is not sure is a note.

    Args:
        file: the machine.
        table: a run or targets.
        reading: whether a mistake that is sure is a note as well, and whether the order of the rows was said.

    Returns:
        What was found.

    Raises:
        SetupError: a mistake that is sure.
    """
    from ptt.errors import SetupError
    from ptt.setup import check_setup

    ordered = any(text.startswith("order=") for text in reading.set_ or ())
    setup = check_setup(file, table, ordered=ordered, units_said=states_units(reading.map_))
    if setup.sure and not reading.anyway:
        raise SetupError(f"{_told(table, setup)}. `ptt check` writes cured files, --anyway goes on", setup)
    for finding in setup.findings:
        if finding.mistake == "target-frame":
            continue  # found, said and followed by whoever sees the run through its machine
        note(f"set-up: {'' if finding.sure else 'perhaps '}{finding.mistake}: {finding.words}; {finding.fix}")
    return setup


def open_library(reading: Reading) -> "Library":
    """The effects that are known, the user's own files included."""
    from ptt.effects.registry import library

    return library(*(reading.effects or ()))


def open_model(path: Path, library: "Library | None" = None) -> "Compensator":
    """Read a machine.toml or a compensator folder.

    Args:
        path: file or folder.
        library: effects by name; None for the library.

    Returns:
        Model and network.
    """
    from ptt.correct.training.compensator import load_compensator

    return load_compensator(path, library)


def read_rows(
    path: Path,
    file: "MachineFile | None",
    reading: Reading,
    purpose: str = "run",
    *,
    checked: bool = False,
    ordered: bool = True,
) -> "Table":
    """Read a table for a machine, and tell what was understood of it.

    Args:
        path: the file.
        file: the machine; None where none is known.
        reading: how.
        purpose: 'run', 'targets' or 'sliders'.
        checked: whether the set-up is checked after, which finds other units by itself.
        ordered: whether time that goes back is refused until the order of the rows was said.

    Returns:
        The table.

    Raises:
        TableError: it cannot be read, or looks as if it were in another unit.
    """
    from ptt.run.table import read_table

    joints = 3 if file is None or file.machine.kind == "three-ptt" else len(file.machine.joint)
    table = read_table(
        path,
        joints,
        joint_prefix="b" if file is None or file.machine.kind == "three-ptt" else "q",
        also=tuple(reading.also or ()),
        targets=reading.targets,
        set_values=parse_settings(reading.set_ or ()),
        mapping=reading.map_,
        purpose=purpose,
        ask=_asker(reading),
        judge_scale=not checked,
        judge_order=ordered,
    )
    for line in table.understood.lines:
        note(line)
    if file is not None and not checked:
        _check_unit(table, file, reading)
    return table


def open_problem(file: "MachineFile", table: "Table") -> "Problem":
    """See a table through its machine.

    Args:
        file: the machine.
        table: the rows.

    Returns:
        The problem.

    Raises:
        WorkspaceError: commands at which the mechanism does not close, targets out of reach.
    """
    from ptt.run.problem import build_problem

    _check_commands(file, table)
    return build_problem(file, table)


def _told(table: "Table", setup: "Check") -> str:
    told = "; ".join(f"{item.mistake}: {item.words}. Cure: {item.fix}" for item in setup.sure)
    return f"{table.source}: {told}"


def parse_settings(pairs: Sequence[str]) -> dict[str, float | str]:
    """Read `payload_kg=2`, and `order=time`.

    Args:
        pairs: as typed after --set.

    Returns:
        Column -> value.

    Raises:
        InputError: not of that form.
    """
    from ptt.errors import InputError

    values: dict[str, float | str] = {}
    for pair in pairs:
        name, _, value = (part.strip() for part in pair.partition("="))
        try:
            values[name] = value if name == "order" else float(value)
        except ValueError:
            raise InputError(f"cannot read '{pair}'", where="--set", fix="write it as payload_kg=2") from None
    return values


def refuse_readings(out: Path) -> None:
    """Refuse to write targets or commands over a tracker run, which nothing brings back.

    Args:
        out: the file about to be written; an earlier list of targets or commands may be replaced.

    Raises:
        InputError: a file of that name has a column x_meas.
    """
    from ptt.errors import InputError

    if not out.is_file():
        return
    with out.open("rb") as file:
        head = file.read(8192).replace(b"\0", b"").lower()  # without the zeros, UTF-16 too shows its titles
    if b"x_meas" in head:
        raise InputError("holds readings; nothing was written", where=str(out), fix="name another file")


def _asker(reading: Reading) -> "Ask | None":
    """Who answers what a file leaves open: nobody where a program is listening or no terminal is there."""
    if reading.json or not sys.stdin.isatty():
        return None

    def ask(question: str, choices: Sequence[str]) -> str:
        note(question)
        for number, choice in enumerate(choices, 1):
            note(f"  {number}  {choice}")
        number = 0
        while not 1 <= number <= len(choices):
            number = typer.prompt("number", type=int, err=True)
        return choices[number - 1]

    return ask


def _check_unit(table: "Table", file: "MachineFile", reading: Reading) -> None:
    """Refuse metres in a mm column; a person who answered on units with --map knows better."""
    from ptt.errors import TableError
    from ptt.run.readers.scale import scale_fix
    from ptt.run.table import unit_hint

    spec = file.machine
    size = (
        spec.link_length_mm
        if spec.kind == "three-ptt"
        else sum(math.hypot(joint.a_mm, joint.d_mm) for joint in spec.joint)
    )
    hint = unit_hint(table, size)
    if hint and not states_units(reading.map_):
        fix = f"{scale_fix(hint)}, or give their unit in a file for --map"
        raise TableError(hint, where=table.source, fix=fix)


def states_units(path: Path | None) -> bool:
    """Whether a person said in a file for --map which units the columns are in."""
    if path is None or not path.exists():
        return False
    from ptt.run.readers import load_mapping

    return bool(load_mapping(path).units)


def _check_commands(file: "MachineFile", table: "Table") -> None:
    """Refuse joint commands at which the drawing does not close, by line."""
    if table.command is None:
        return
    import numpy as np
    import torch

    from ptt.mechanisms import build_mechanism, require_assembled

    rows = np.isfinite(table.command).all(axis=1)
    lines = [int(line) for line in table.line[rows]]
    require_assembled(build_mechanism(file.machine), torch.tensor(table.command[rows]), table.source, lines=lines)
