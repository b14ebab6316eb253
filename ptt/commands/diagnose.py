"""`ptt diagnose`: which physical effect is missing."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import (
    Also,
    Anyway,
    Context,
    Effects,
    Json,
    Map,
    ModelPath,
    ReadOptions,
    Run,
    Set,
    Targets,
    load_both,
    note,
    progress,
    show,
)  # fmt: skip

if TYPE_CHECKING:
    from ptt.door.diagnosing import Diagnosed

Next = Annotated[
    Path | None,
    typer.Option(
        "--measure-next",
        metavar="OUT.csv",
        help="Write poses that would tell tied effects apart, or show better what is unknown.",
    ),
]
ChunkRows = Annotated[
    int | None,
    typer.Option(
        "--chunk-rows",
        min=1000,
        help="Rows per chunk; by default a run of up to 20,000 rows (arm: 2,000) is not divided.",
    ),
]
Steps = Annotated[int, typer.Option("--steps", min=1, help="Largest number of effects to add.")]


def diagnose(
    run: Run,
    model: ModelPath,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    context: Context = None,
    effects: Effects = None,
    steps: Steps = 12,
    measure_next: Next = None,
    chunk_rows: ChunkRows = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Rank what is missing from the model, step by step, or say that nothing is missing or that no effect fits."""
    from ptt.door import diagnosing

    reading = ReadOptions(also, targets, set_, map_, effects, json, anyway, context)
    loaded, rows = load_both(run, model, reading)
    with progress() as tell:
        result = diagnosing.diagnose(
            loaded, rows, steps=steps, chunk_rows=chunk_rows, anyway=anyway, progress=tell, note=note
        )
    if measure_next is not None:
        _write_poses(result, measure_next)
    show(result.to_dict(), str(result), json)


def _write_poses(result: "Diagnosed", out: Path) -> None:
    if result.verdict == "setup":
        return
    poses = result.write_poses(out)
    if poses:
        note(f"{out}: {poses} poses to measure; then diagnose both runs together with --also")
    else:
        note("no poses to write: nothing is tied or unknown that other poses would tell more about")
