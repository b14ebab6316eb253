"""Command lines that reproduce a report, with file names without folders."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass

from ptt.judge.history import HistoryEntry
from ptt.model.model import Model
from ptt.show.report.source import MadeOf

DRAWING = "drawing.toml"
FLAGS = {"also": "--also", "targets": "--targets", "map": "--map", "effects": "--effects"}


@dataclass(frozen=True)
class Command:
    """One command line, and what it shows."""

    line: str
    tells: str


def commands_of(source: MadeOf, model: Model, network: bool) -> tuple[Command, ...]:
    """The commands that give the figures of a report.

    Args:
        source: names of files, and options.
        model: the model.
        network: whether there is a network.

    Returns:
        The commands in the order of the report.
    """
    run, file = source.one("run", "run.csv"), source.one("model", "model.toml")
    folder = source.one("compensator", file)
    named = ["--compensator", folder] if folder != file else []
    options = options_of(source)
    steps: list[Command] = []
    drawing = file
    if model.terms:
        drawing = DRAWING
        words = ["ptt", "remove", run, *model.keys, "--model", file, *options, "--out", DRAWING]
        steps.append(Command(shlex.join(words), "the machine as drawn, without the model's effects"))
    steps += [
        Command(shlex.join(["ptt", verb, run, "--model", drawing, *options]), tells)
        for verb, tells in (("compare", "the machine as drawn"), ("diagnose", "what is missing from the drawing"))
    ]
    if model.terms:
        steps += [
            Command(shlex.join(["ptt", verb, run, "--model", file, *options]), tells)
            for verb, tells in (
                ("compare", "what the model leaves"),
                ("diagnose", "what is missing from the model"),
                ("fit", "parameters, standard errors, what this run cannot tell"),
            )
        ]
    if model.terms or network:
        steps.append(Command(shlex.join(["ptt", "evaluate", run, "--model", folder, *options]), "before and after"))
    iso = shlex.join(["ptt", "iso", run, "--model", file, *options_of(source, without=("effects",))])
    later = ["--after", source.one("after", "")] if "after" in source.names else []
    if later:
        words = ["ptt", "compare", run, *later, "--model", file, *options]
        steps.append(Command(shlex.join(words), "both runs side by side"))
    whole = ["ptt", "report", run, "--model", file, *later, *named, *options, "--out", "report.html"]
    return (*steps, Command(iso, "ISO 9283 figures"), Command(shlex.join(whole), "this report"))


def options_of(source: MadeOf, without: Sequence[str] = ()) -> list[str]:
    """The options of a command line that say how runs are read.

    Args:
        source: names of files, and settings.
        without: roles of files to leave out.

    Returns:
        The words.
    """
    words: list[str] = []
    for role, flag in FLAGS.items():
        for name in source.names.get(role, ()) if role not in without else ():
            words += [flag, name]
    for setting in source.settings:
        words += ["--set", setting]
    return words


def ladder_command(ladder: Sequence[HistoryEntry]) -> str:
    """The command that made a ladder, with placeholders for model files, whose names the history does not have.

    Args:
        ladder: its steps.

    Returns:
        For example 'ptt add run.csv backlash --model BEFORE.toml --out AFTER.toml'.
    """
    first, *more = (item["file"] for item in ladder[0].files) if ladder[0].files else ("RUN.csv",)
    effects = [entry.effect for entry in ladder if entry.kind != "refit"]
    also = [word for name in more for word in ("--also", name)]
    words = ["ptt", ladder[0].command, first, *effects, "--model", "BEFORE.toml", *also, "--out", "AFTER.toml"]
    return shlex.join(words)
