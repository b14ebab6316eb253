"""`ptt evaluate`: error before and after, measured on two runs or computed on rows that were held out of one."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ptt.commands.common import (
    Also,
    Anyway,
    Effects,
    Json,
    Map,
    Reading,
    Run,
    Set,
    Targets,
    note,
    open_library,
    open_model,
    open_run,
    progress,
    read_rows,
    show,
)

if TYPE_CHECKING:
    from ptt.judge.evaluate import Evaluation


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


SHOWN = 5
HELD_OUT = ("blocks", "random")
UNALIGNED = (
    "without frame alignment (readings as they come: where the tracker was set up anew, its place counts as error):"
)


def evaluate(
    run: Run,
    after: Annotated[Path | None, typer.Argument(metavar="AFTER.csv", help="The same poses, compensated.")] = None,
    model: Annotated[Path | None, typer.Option("--model", metavar="M", help="machine.toml or compensator.")] = None,
    frame: Annotated[Frame | None, typer.Option("--frame", help="Instead of the machine file's policy.")] = None,
    z_datum: Annotated[ZDatum, typer.Option("--z-datum", help="Count z errors from the first pose.")] = ZDatum.absolute,
    goal: Annotated[
        str | None, typer.Option("--goal", metavar="X,Y,Z", help="Judge it: percent by which each axis should fall.")
    ] = None,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Say how much error is gone: BEFORE and AFTER as measured, or one run and a model on held-out rows."""
    from dataclasses import replace

    from ptt.errors import InputError
    from ptt.judge.evaluate import GOALS

    goals = GOALS if goal is None else _goals(goal)
    reading = Reading(also, targets, set_, map_, effects, json, anyway)
    if after is not None:
        data = replace(_measured(run, after, model, frame, z_datum, reading), goals=goals).to_dict()
    elif model is None:
        raise InputError("one run and nothing to hold it against", fix="name AFTER.csv, or --model M")
    else:
        data = _computed(run, model, frame, z_datum, reading, goals)
    warning = _few_matched(data)
    if warning:
        note(f"warning: {warning}")
    show(
        data,
        "\n".join(
            [f"WARNING: {warning}", _text(data, goal is not None)] if warning else [_text(data, goal is not None)]
        ),
        json,
    )


def _measured(
    run: Path, after: Path, model: Path | None, frame: Frame | None, z_datum: ZDatum, reading: Reading
) -> "Evaluation":
    from ptt.judge.evaluate import evaluate_pair

    file = None if model is None else open_model(model, open_library(reading)).model.file
    before_table = read_rows(run, file, reading)
    after_table = read_rows(after, file, Reading(None, reading.targets, reading.set_, reading.map_, None, reading.json))
    policy = None if frame is None else frame.value
    return evaluate_pair(before_table, after_table, file, frame=policy, z_datum=z_datum.value)


def _goals(text: str) -> dict[str, float]:
    """Read `90,90,80`, or one figure for all axes."""
    from ptt.errors import InputError

    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (1, 3):
        raise InputError(f"cannot read '{text}'", where="--goal", fix="write it as 90,90,80 (percent), or one for all")
    return dict(zip("xyz", values * (3 // len(values)), strict=True))


def _computed(
    run: Path, model: Path, frame: Frame | None, z_datum: ZDatum, reading: Reading, goals: dict[str, float]
) -> dict[str, Any]:
    """Figures of whole blocks held out, and beside them those of the source paper's random split."""
    from dataclasses import replace

    from ptt.correct.training.heldout import evaluate_heldout
    from ptt.correct.training.train import PROTOCOLS
    from ptt.errors import InputError

    if frame is not None:
        raise InputError("--frame is for two runs", where="--frame", fix="the machine file's policy counts here")
    opened = open_run(run, model, reading)
    data: dict[str, Any] = {}
    with progress() as tell:
        for name in HELD_OUT:
            protocol = PROTOCOLS[name](opened.problem)
            result = evaluate_heldout(opened.compensator, opened.problem, protocol, z_datum.value, progress=tell)
            result = replace(result, goals=goals)
            data = data or result.to_dict()
            data.setdefault("protocols", {})[name] = _short(result)
    return data


def _short(result: "Evaluation") -> dict[str, Any]:
    data = result.to_dict()
    return {key: data[key] for key in ("axes", "total", "length", "rest_is_noise", "protocol")}


def _few_matched(data: dict[str, Any]) -> str:
    """What to say where less than half of a run has a counterpart in the other; '' where there is no such thing."""
    matched = data["protocol"]["rows"]
    rows = {side: matched + len(left) for side, left in data["unmatched"].items()}
    few = [f"{count} rows of {side.upper()}" for side, count in rows.items() if 2 * matched < count]
    return f"only {matched} of {' and of '.join(few)} count, the others have no counterpart" if few else ""


def _text(data: dict[str, Any], judged: bool) -> str:
    protocol = data["protocol"]
    kind = "measured" if protocol["measured"] else "computed, not measured"
    lines = [f"{kind}; {protocol['rows']} rows, {protocol['poses']} poses; frame {protocol['frame']}"]
    lines[0] += f"; z from {'the first pose' if protocol['z_datum'] == 'first' else 'the base'}"
    if "protocols" in data:
        for name, one in data["protocols"].items():
            lines += ["", f"{name}: {one['protocol']['held_out']}", *_table(one, judged)]
    else:
        lines += _table(data, judged)
        lines += ["", UNALIGNED, *_table(data["unaligned"], judged=False)]
    if data["noise_um"]:
        noise = data["noise_um"]
        figures = ", ".join(f"{axis} {noise[axis]:.1f}" for axis in ("x", "y", "z", "total"))
        lines += ["", f"noise floor, one standard deviation in um: {figures} (from {noise['source']})"]
    for side, rows in data["unmatched"].items():
        if rows:
            more = f" and {len(rows) - SHOWN} more" if len(rows) > SHOWN else ""
            lines.append(f"without counterpart in {side}: {', '.join(rows[:SHOWN])}{more}")
    return "\n".join(lines)


def _table(data: dict[str, Any], judged: bool) -> list[str]:
    lines = [f"  {'mean |error|':<12} {'before um':>10} {'after um':>10} {'less %':>8}"]
    for name, row in (*data["axes"].items(), ("length", data["length"])):
        gained = row["reduction_percent"]
        line = f"  {name:<12} {row['before_um']:>10.1f} {row['after_um']:>10.1f}"
        line += f" {'-' if gained is None else f'{gained:.1f}':>8}"
        noise = bool(data.get("rest_is_noise", {}).get(name))
        lines.append("  ".join([line, *_remarks(row, noise, judged and "goal_met" in row)]))
    return lines


def _remarks(row: dict[str, Any], is_noise: bool, judged: bool) -> list[str]:
    """What is to be said of an axis: the goal where one was set, and where nothing but noise is left."""
    noise = ["what is left is noise"] if is_noise else []
    if not judged:
        return noise
    if row["goal_met"]:
        return [f"goal {row['goal_percent']:.0f} met"]
    return [f"goal {row['goal_percent']:.0f} {'not measurable:' if noise else 'missed'}", *noise]
