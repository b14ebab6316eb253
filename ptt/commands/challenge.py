"""`ptt challenge`: a run with a sealed hidden effect, and the score."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from ptt.commands.common import Effects, Json, ModelPath, Reading, note, open_library, open_model, show

app = typer.Typer(
    help="A run with hidden faults that you find; then open the seal and see how well you did.",
    add_completion=False,
    rich_markup_mode=None,
)


class LevelName(StrEnum):
    """How much is hidden."""

    single = "single"
    multi = "multi"
    unknown = "unknown"
    none = "none"
    any = "any"


Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the challenge.")]


@app.command()
def new(
    folder: Folder,
    level: Annotated[LevelName, typer.Option("--level", help="One effect, several, one that is in no library, none.")],
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Draw the same one again; else nobody knows.")
    ] = None,
    rows: Annotated[int, typer.Option("--rows", help="About how many readings.")] = 300,
    machine: Annotated[
        Path | None, typer.Option("--machine", metavar="M.toml", help="Drawing; else the bench.")
    ] = None,
    foreign: Annotated[
        bool, typer.Option("--foreign", help="A machine, a path and a tracker drawn by the seed instead of the bench.")
    ] = False,
    json: Json = False,
) -> None:
    """Draw a machine with hidden faults, measure it, and seal what is wrong with it."""
    from ptt.challenge.challenge import new_challenge
    from ptt.machine import load_machine

    file = None if machine is None else load_machine(machine)
    made = new_challenge(folder, level.value, seed=seed, rows=rows, machine=file, foreign=foreign)
    data = made.to_dict()
    lines = [
        f"{data['run']}: {made.rows} rows; {data['machine']}: the drawing; {data['targets']}: where the tool should be",
        f"find out what is missing:  ptt diagnose {data['run']} --model {data['machine']}",
        f"then open the seal:        ptt challenge reveal {folder} --model YOUR_MODEL.toml",
    ]
    show(data, "\n".join(lines), json)


@app.command()
def reveal(
    folder: Folder,
    model: ModelPath,
    rig: Annotated[Path | None, typer.Option("--rig", metavar="RIG.toml", help="Write the opened rig.")] = None,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Open the seal: what was hidden, what the model says, and where its commands put the real tool."""
    from ptt.challenge.challenge import open_challenge
    from ptt.challenge.score import score
    from ptt.challenge.truth import find_truth
    from ptt.correct.training.train import correction_of
    from ptt.files import write_text
    from ptt.rig import format_rig

    library = open_library(Reading(effects=effects, json=json))
    compensator = open_model(model, library)
    sealed = open_challenge(folder)
    truth = find_truth(sealed.drawn, library)
    network = compensator.network
    result = score(compensator.model, truth, None if network is None else correction_of(network))
    if rig is not None:
        write_text(rig, format_rig(sealed.drawn.rig))
        note(f"opened rig in {rig}")
    data = {"level": sealed.level, "protocol": sealed.drawn.protocol, **result.to_dict()}
    show(data, _text(data), json)


def _text(data: dict[str, Any]) -> str:
    noise = data["noise_um"]["total"]
    lines = [f"hidden ({data['level']}, measured as {data['protocol']}); noise of one reading {noise:.1f} um"]
    if not data["hidden"]:
        lines.append("  nothing")
    for item in data["hidden"]:
        lines += _hidden(item, noise)
    lines += [f"  {item['effect']}: {_WORDS[item['is']]}" for item in data["named"] if item["is"] != "right"]
    lines.append(f"the model's effects leave {data['left_um']:.1f} um of the run without noise")
    lines += _tool(data["tool_error_um"], noise)
    lines.append("RIGHT" if data["right"] else "NOT RIGHT")
    return "\n".join(lines)


_WORDS = {
    "fair": "fair: on this run nobody could tell it from what is hidden",
    "partial": "helps, but is not what is hidden",
    "wrong": "WRONG, nothing of the kind is hidden",
}


def _hidden(item: dict[str, Any], noise: float) -> list[str]:
    status = item["is"].upper() if item["is"] == "missed" else item["is"]
    if item["instead"]:
        status += f" by {', '.join(item['instead'])}"
    elif item["is"] == "explained":
        status += " by the other effects of the model"
    size = item["size_um"]
    lines = [f"  {item['effect']}: {status}; by itself it makes {size:.1f} um, {size / noise:.1f} x noise"]
    lines.append(f"    truth  {', '.join(f'{key} = {_short(value)}' for key, value in item['truth'].items())}")
    if item["model"]:
        lines.append(f"    model  {', '.join(_parameter(one) for one in item['model'])}")
    return lines


def _parameter(one: dict[str, Any]) -> str:
    std = "" if one["std"] is None else f" +- {one['std']:.2g}"
    return f"{one['name']} = {one['value']:.4g}{std}"


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_short(item) for item in value)}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _tool(error: dict[str, dict[str, float] | None], noise: float) -> list[str]:
    """True error before and after, re-measured."""
    lines = ["true tool error, re-measured on the machine without noise after the best rigid motion, rms in um:"]
    for word, row in error.items():
        if row is None:
            lines.append(f"  {word:<7}the machine cannot follow the model's commands")
        else:
            figures = "  ".join(f"{axis} {row[axis]:.1f}" for axis in ("x", "y", "z", "total"))
            lines.append(f"  {word:<7}{figures}  ({row['total'] / noise:.2f} x noise)")
    return lines
