"""`ptt simulate`: run the virtual machine through targets, or through commands that were corrected."""

from pathlib import Path
from typing import Annotated

import typer

from ptt.commands.common import Json, Map, ReadOptions, asker, note, show


def simulate(
    rig: Annotated[Path, typer.Argument(metavar="RIG.toml", help="Faults and conditions of the virtual machine.")],
    targets: Annotated[Path, typer.Argument(metavar="TARGETS.csv", help="Tool positions to visit, in travel order.")],
    out: Annotated[Path, typer.Option("--out", metavar="RUN.csv", help="Tracker run to write.")],
    sliders: Annotated[
        Path | None, typer.Option("--sliders", metavar="SLIDERS.csv", help="Commands to send, from `ptt predict`.")
    ] = None,
    noise: Annotated[bool, typer.Option("--noise/--no-noise", help="Add random noise.")] = True,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of this run's noise; the machine is unchanged.")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option("--truth", metavar="FILE", help="Also write where tool and sliders really were.")
    ] = None,
    map_: Map = None,
    json: Json = False,
) -> None:
    """Run the virtual machine: targets or corrected commands in, a tracker run out."""
    from ptt.door.simulating import simulate_path
    from ptt.rig import load_rig, write_run

    reading = ReadOptions(map_=map_, json=json)
    result = simulate_path(
        load_rig(rig), targets, sliders, reading, noise=noise, seed=seed, ask=asker(reading), note=note
    )
    result.to_csv(out)
    if truth is not None:
        write_run(result.truth, truth)
        note(f"truth in {truth}")
    show(result.to_dict(), str(result), json)
