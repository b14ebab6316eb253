"""What all verbs share: options, reading runs, output.

A verb is a file `ptt/commands/<verb>.py` with a function of that name (or a `typer.Typer` called `app` where it has
verbs of its own). `ptt.commands.main` finds it by its file name; nothing else is registered anywhere. At module level
it imports nothing heavier than typer, because `ptt --help` imports them all::

    def compare(
        run: Run, model: ModelPath, also: Also = None, targets: Targets = None, set_: Set = None, map_: Map = None,
        effects: Effects = None, json: Json = False,
    ) -> None:
        '''Compare a run with a model.'''
        from ptt.door.comparing import compare as held_against

        loaded, rows = load_both(run, model, ReadOptions(also, targets, set_, map_, effects, json))
        with progress() as tell:
            result = held_against(loaded, rows, progress=tell, note=note)
        show(result.to_dict(), str(result), json)

What a verb does, and what it refuses, is in `ptt.door`; here words are parsed and results printed.

Errors are raised as `ptt.errors.InputError` and not caught: `main` prints one line and exits with the error's code.
Standard output belongs to the result; notes, understood columns and progress go to standard error by `note`.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.output import note, progress, show
from ptt.door.options import ReadOptions, parse_settings

if TYPE_CHECKING:
    from ptt.door.model import Model
    from ptt.door.run import Run as Rows
    from ptt.machine import MachineFile
    from ptt.run.readers import Ask
    from ptt.run.table import Table

Run = Annotated[Path, typer.Argument(metavar="RUN.csv", help="Tracker run: targets or joint commands, and readings.")]
ModelPath = Annotated[Path, typer.Option("--model", metavar="M", help="machine.toml or compensator folder.")]
Also = Annotated[list[Path] | None, typer.Option("--also", metavar="RUN2.csv", help="Another run; repeatable.")]
Targets = Annotated[
    Path | None, typer.Option("--targets", metavar="T.csv", help="Targets, for an export that holds only readings.")
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="One value for all rows, as payload_kg=2; order=time sorts the rows."
    ),
]
Map = Annotated[
    Path | None, typer.Option("--map", metavar="FILE.toml", help="Saved answers to questions about columns and units.")
]
Context = Annotated[
    list[str] | None,
    typer.Option("--context", metavar="COLUMN", help="A column of your own that the error may depend on; repeatable."),
]
Effects = Annotated[
    list[Path] | None, typer.Option("--effects", metavar="FILE.py", help="Effects of your own; the file is run.")
]
Anyway = Annotated[bool, typer.Option("--anyway", help="Continue although the set-up looks wrong.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else; never ask.")]

__all__ = [
    "Also", "Anyway", "Context", "Effects", "Json", "Map", "ModelPath", "ReadOptions", "Run", "Set", "Targets",
    "asker", "load_both", "note", "parse_settings", "progress", "read_rows", "refuse_idle", "show",
]  # fmt: skip


def load_both(run: Path, model: Path, reading: ReadOptions) -> "tuple[Model, Rows]":
    """Read a model (machine.toml or compensator folder) and a run (tracker CSV) for it.

    Raises:
        InputError: whatever cannot be read.
    """
    from ptt.door.model import load
    from ptt.door.run import read_path

    loaded = load(model, effects=reading.effects or ())
    return loaded, read_path(run, loaded, reading, ask=asker(reading), note=note)


def read_rows(
    path: Path, file: "MachineFile | None", reading: ReadOptions, purpose: str = "run", *, checked: bool = False
) -> "Table":
    """`ptt.door.reading.read_rows`, asking and telling on the terminal."""
    from ptt.door.reading import read_rows as understood

    return understood(path, file, reading, purpose, checked=checked, ask=asker(reading), note=note)


def refuse_idle(given: Mapping[str, object], what: str, fix: str) -> None:
    """Refuse options that have no effect in this call, instead of ignoring them.

    Args:
        given: option -> its value.
        what: why it has no effect here, for the message.
        fix: the way out, for the message.

    Raises:
        InputError: one of them was given.
    """
    from ptt.errors import InputError

    for option, value in given.items():
        if value:
            raise InputError(what, where=option, fix=fix)


def asker(reading: ReadOptions) -> "Ask | None":
    """A questioner on the terminal; None with --json, or without a terminal."""
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
