"""What train.py does: fit the model's effects, train the network on the rest, write the compensator."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ptt.commands.common import Also, Anyway, Effects, Json, Map, Reading, Run, Set, Targets, open_run, progress, show

if TYPE_CHECKING:
    from ptt.correct.training.train import Training


class HoldOut(StrEnum):
    """Which rows the figures and the network's settings are judged on."""

    blocks = "blocks"
    random = "random"


def train(
    run: Run,
    machine: Annotated[Path, typer.Option("--machine", metavar="M.toml", help="The machine, with the effects to fit.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder to write the compensator to.")],
    hold_out: Annotated[
        HoldOut, typer.Option("--hold-out", help="Whole parts of the path, or poses at random between measured ones.")
    ] = HoldOut.blocks,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Fit the effects of a machine file, train the RBF on what is left, and write both as a compensator folder."""
    from ptt.correct.training.compensator import require_folder, save_compensator
    from ptt.correct.training.train import PROTOCOLS
    from ptt.correct.training.train import train as train_model

    require_folder(out)
    opened = open_run(run, machine, Reading(also, targets, set_, map_, effects, json, anyway))
    protocol = PROTOCOLS[hold_out.value](opened.problem)
    with progress() as tell:
        training = train_model(opened.model, opened.problem, protocol=protocol, progress=tell)
    save_compensator(out, training, list(opened.files))
    data = _summary(training, out) | opened.set_up
    show(data, _text(data), json)


def _summary(training: "Training", out: Path) -> dict[str, Any]:
    chosen = training.rbf.chosen
    return {
        "out": str(out),
        "effects": list(training.physics.model.keys),
        "rows": len(training.physics.residual),
        "status": training.physics.status,
        "outliers": int(training.physics.outliers.sum()),
        "rms_um": training.rms_um,
        "heldout_rms_um": training.heldout_um,
        "protocol": training.protocol,
        "noise_um": training.physics.noise.to_dict(),
        "rbf": {
            "centres": chosen.centres,
            "spread": chosen.spread,
            "learned": dict(zip("xyz", training.rbf.learned.tolist(), strict=True)),
            "share": training.rbf_share,
            "inputs": training.space,
            "heldout_by_inputs_um": training.spaces_um,
        },
    }


def _text(data: dict[str, Any]) -> str:
    effects = ", ".join(data["effects"]) or "none: the drawing as it is"
    lines = [f"effects: {effects} ({data['status']}, {data['outliers']} outliers left out)"]
    learned = [axis for axis, flag in data["rbf"]["learned"].items() if flag]
    words = f"{data['rbf']['centres']} nodes, for {', '.join(learned)}" if learned else "nothing left that it can learn"
    if learned and len(data["rbf"]["heldout_by_inputs_um"]) > 1:
        words += f", over the {'joints' if data['rbf']['inputs'] == 'joints' else 'tool positions'}"
    lines += [f"network: {words}", f"  {'rms um':<34}{'x':>9}{'y':>9}{'z':>9}{'total':>9}"]
    stages = (("given", "as given"), ("physics", "after physics"), ("rbf", "after the network"))
    for key, title in (("rms_um", "training rows"), ("heldout_rms_um", "held out")):
        for stage, name in stages:
            row = data[key][stage]
            lines.append(
                f"  {title + ', ' + name:<34}" + "".join(f"{row[axis]:9.1f}" for axis in ("x", "y", "z", "total"))
            )
    noise = data["noise_um"]
    lines.append(f"  {'noise floor':<34}" + "".join(f"{noise[axis]:9.1f}" for axis in ("x", "y", "z", "total")))
    return "\n".join([*lines, f"  held out: {data['protocol']}", f"written to {data['out']}"])
