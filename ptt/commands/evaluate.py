"""`ptt evaluate`: error before and after, measured on two runs or computed on rows that were held out of one."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import (
    Also,
    Anyway,
    Effects,
    Json,
    Map,
    ReadOptions,
    Run,
    Set,
    Targets,
    asker,
    load_both,
    note,
    progress,
    show,
)

if TYPE_CHECKING:
    from ptt.door.evaluating import Frame as Policy


class Frame(StrEnum):
    """How readings are brought into the base frame."""

    fitted = "fitted"
    per_run = "fitted-per-run"
    trusted = "trusted"
    measured = "measured"


class ZDatum(StrEnum):
    """What z errors are counted from."""

    absolute = "absolute"
    first = "first"


def evaluate(
    run: Run,
    after: Annotated[Path | None, typer.Argument(metavar="AFTER.csv", help="The same poses, compensated.")] = None,
    model: Annotated[Path | None, typer.Option("--model", metavar="M", help="machine.toml or compensator.")] = None,
    frame: Annotated[
        Frame | None, typer.Option("--frame", help="Alignment to use instead of the machine file's.")
    ] = None,
    z_datum: Annotated[ZDatum, typer.Option("--z-datum", help="Count z errors from the first pose.")] = ZDatum.absolute,
    goal: Annotated[
        str | None, typer.Option("--goal", metavar="X,Y,Z", help="Required reduction of each axis's error, percent.")
    ] = None,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Show how far the error fell: between two measured runs, BEFORE and AFTER, or with a model on held-out rows."""
    from ptt.door.evaluated import Evaluated
    from ptt.door.evaluating import computed, measured, read_goals, run_rows
    from ptt.door.model import load
    from ptt.errors import InputError

    goals = None if goal is None else read_goals(_numbers(goal), "--goal")
    reading = ReadOptions(also, targets, set_, map_, effects, json, anyway)
    result: Evaluated
    if after is not None:
        machine = None if model is None else load(model, effects=effects or ())
        second = ReadOptions(None, targets, set_, map_, None, json)
        before_rows, after_rows = (
            run_rows(path, machine, how, asker(how), note) for path, how in ((run, reading), (after, second))
        )
        way: Policy | None = None if frame is None else frame.value
        result = measured(
            before_rows, after_rows, machine, frame=way, z_datum=z_datum.value, goals=goals, note=note
        )  # fmt: skip
    elif model is None:
        raise InputError("one run and nothing to hold it against", fix="name AFTER.csv, or --model M")
    elif frame is not None:
        raise InputError("--frame is for two runs", where="--frame", fix="the machine file's policy counts here")
    else:
        loaded, rows = load_both(run, model, reading)
        with progress() as tell:
            result = computed(loaded, rows, z_datum=z_datum.value, goals=goals, anyway=anyway, progress=tell, note=note)
    for warning in result.warnings:
        note(f"warning: {warning}")
    show(result.to_dict(), str(result), json)


def _numbers(text: str) -> tuple[float, ...]:
    """Read `90,90,80`, or one number."""
    from ptt.errors import InputError

    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"cannot read '{text}'", where="--goal", fix="write it as 90,90,80 (percent)") from None
