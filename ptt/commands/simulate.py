"""`ptt simulate`: run the virtual machine through targets, or through commands that were corrected."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import Json, Map, Reading, note, read_rows, show

if TYPE_CHECKING:
    import pandas as pd

    from ptt.rig import RunResult
    from ptt.run.table import Table


def simulate(
    rig: Annotated[Path, typer.Argument(metavar="RIG.toml", help="Faults and conditions of the virtual machine.")],
    targets: Annotated[Path, typer.Argument(metavar="TARGETS.csv", help="Tool positions to visit, in travel order.")],
    out: Annotated[Path, typer.Option("--out", metavar="RUN.csv", help="Tracker run to write.")],
    sliders: Annotated[
        Path | None, typer.Option("--sliders", metavar="SLIDERS.csv", help="Commands to send, from `ptt predict`.")
    ] = None,
    noise: Annotated[bool, typer.Option("--noise/--no-noise", help="With or without everything random.")] = True,
    seed: Annotated[int | None, typer.Option("--seed", help="Of the noise of this run; the machine stays.")] = None,
    truth: Annotated[
        Path | None, typer.Option("--truth", metavar="FILE", help="Where tool and sliders really were.")
    ] = None,
    map_: Map = None,
    json: Json = False,
) -> None:
    """Run the virtual machine: targets or corrected commands in, a tracker run out."""
    from ptt.rig import load_rig, write_run
    from ptt.rig import simulate as run_rig

    machine = load_rig(rig)
    reading = Reading(map_=map_, json=json)
    wanted = read_rows(targets, machine.machine, reading, "targets")
    if sliders is None and _holds_commands(wanted):
        sliders = targets
        note(f"driven by the commands {wanted.joint_prefix}1.. in {targets}, as with --sliders {targets}")
    sent = (
        None if sliders is None else _sliders(sliders, wanted, read_rows(sliders, machine.machine, reading, "sliders"))
    )
    result = run_rig(machine, _commands(wanted), sliders=sent, noise=noise, seed=seed)
    write_run(result.frame, out)
    if truth is not None:
        write_run(_truth(result), truth)
        note(f"truth in {truth}")
    poses = int((result.frame["role"] != "base").sum())
    data = {"rows": len(result.frame), "poses": poses, "cycles": machine.conditions.cycles, "out": str(out)}
    data |= {"sliders": "given" if sent is not None else "controller", "outliers": int(result.outlier.sum())}
    show(data, f"{out}: {len(result.frame)} rows, {poses} of them poses", json)


def _commands(table: "Table") -> "pd.DataFrame":
    """The targets as the rig reads them; every pose keeps its role."""
    from ptt.run.table import table_to_frame

    frame = table_to_frame(table)
    frame["role"] = table.role
    return frame


def _holds_commands(table: "Table") -> bool:
    """Whether commands to send stand beside the targets, as `ptt predict` writes them."""
    beside = {title.strip().lower() for title in table.understood.ignored}
    return {f"{table.joint_prefix}{joint}" for joint in (1, 2, 3)} <= beside


def _sliders(path: Path, wanted: "Table", sent: "Table") -> "pd.DataFrame":
    """Columns b1..b3, refused where they were made for other targets."""
    import numpy as np
    import pandas as pd

    from ptt.errors import TableError

    if sent.rows != wanted.rows:
        fix = f"predict the commands from {wanted.source}"
        raise TableError(f"{sent.rows} rows for {wanted.rows} targets of {wanted.source}", where=str(path), fix=fix)
    apart = np.abs(sent.target - wanted.target).max(axis=1) > 1e-6
    if apart.any():
        row = int(np.argmax(apart))
        fix = f"predict the commands from {wanted.source}"
        raise TableError(f"made for another target than {wanted.place(row)}", where=sent.place(row), fix=fix)
    return pd.DataFrame(sent.command, columns=[f"b{leg}" for leg in (1, 2, 3)])


def _truth(result: "RunResult") -> "pd.DataFrame":
    frame = result.frame[["name", "role", "repeat"]].copy()
    frame[["x_true", "y_true", "z_true"]] = result.truth
    frame[["b1_true", "b2_true", "b3_true"]] = result.slider_actual
    return frame.assign(outlier=result.outlier)
