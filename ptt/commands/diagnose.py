"""`ptt diagnose`: which physical effect is missing."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import (
    Also,
    Anyway,
    Effects,
    Json,
    Map,
    ModelPath,
    Reading,
    Run,
    Set,
    Targets,
    note,
    open_run,
    progress,
    show,
)  # fmt: skip

if TYPE_CHECKING:
    from ptt.diagnosis.verdict import Diagnosis

Next = Annotated[
    Path | None, typer.Option("--measure-next", metavar="OUT.csv", help="Write poses that part what is confused.")
]
ChunkRows = Annotated[
    int | None, typer.Option("--chunk-rows", min=1000, help="Rows summed up at a time; by itself beyond 50,000 rows.")
]
Steps = Annotated[int, typer.Option("--steps", min=1, help="How many effects the path may add.")]


def diagnose(
    run: Run,
    model: ModelPath,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    steps: Steps = 12,
    measure_next: Next = None,
    chunk_rows: ChunkRows = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Rank what is missing from the model, step by step, or say that nothing is or that none of the effects fits."""
    from ptt.diagnosis.long import choose_diagnosis
    from ptt.diagnosis.verdict import diagnose as learn_whole
    from ptt.errors import SetupError
    from ptt.fitting.chunks import CHUNK
    from ptt.setup import setup_verdict

    try:
        opened = open_run(run, model, Reading(also, targets, set_, map_, effects, json, anyway))
    except SetupError as error:
        show(setup_verdict(error.check), f"verdict: setup\n\n{error.check}", json)
        return
    if opened.compensator.network is not None:
        note("the compensator's network is left aside: the physics alone is diagnosed")
    learn = choose_diagnosis(opened.table.rows, chunk_rows)
    if learn is not learn_whole:
        note(f"{opened.table.rows} rows are summed up in chunks of {chunk_rows or CHUNK}")
    with progress() as tell:
        result = learn(
            opened.model, opened.problem, opened.library, steps=steps, progress=lambda what: tell(what, 0, 0)
        )
    if measure_next is not None:
        _write_poses(result, measure_next)
    show(result.to_dict() | opened.set_up, format_diagnosis(result), json)


def _write_poses(result: "Diagnosis", out: Path) -> None:
    from ptt.run.table import write_table

    poses = result.separation.targets if result.separation else None
    if poses is None:
        note("no poses to write: nothing is confused that poses could part")
        return
    write_table(poses, out)
    note(f"{out}: {poses.rows} poses to measure; then diagnose both runs together with --also")


def format_diagnosis(result: "Diagnosis") -> str:
    """The diagnosis as text.

    Args:
        result: the diagnosis.

    Returns:
        Lines.
    """
    lines = [f"verdict: {result.verdict}", "", result.words, ""]
    if result.candidates:
        lines.append(f"{'effect':<22} {'p-value':>9} {'share':>7} {'held-out um':>18}  cannot be told from")
        for candidate in result.candidates:
            mark = "+" if any(candidate.effect == step[0] for step in result.suggested) else " "
            fall = f"{candidate.heldout_before:.1f} -> {candidate.heldout_after:.1f}"
            ties = ", ".join(candidate.indistinguishable_from)
            figures = f"{candidate.p_value:>9.1e} {candidate.explained_share:>7.1%} {fall:>18}"
            lines.append(f"{mark} {candidate.effect:<20} {figures}  {ties}")
        lines += ["", "+ is a step of the path; the others explain a part of the same, on the model as given", ""]
    if result.depends_on:
        lines.append("what is left depends on:")
        for item in result.depends_on:
            period = f", period {item.period_mm:.3g} mm" if item.period_mm else ""
            place = f", {item.shape} between {item.place[0]:.4g} and {item.place[1]:.4g}" if item.place else ""
            place = f", varying with {item.with_}" if item.with_ else place
            lines.append(f"  {item.residual} on {item.on}: {item.share:.0%} (p = {item.p_value:.1g}{period}{place})")
        lines.append("")
    if result.verdict == "unknown" and result.depends_on:
        lines += [
            "to describe it yourself, keep what --json prints in D.json, then: ptt effects new NAME --like D.json",
            "",
        ]
    if result.measure_next:
        lines += ["measure next:", *(f"  {line}" for line in result.measure_next), ""]
    if result.not_testable:
        lines.append("not testable on this run:")
        lines += [f"  {name} needs {lack}" for name, lack in result.not_testable.items()]
    noise = result.noise.to_dict()
    lines.append(
        f"noise floor {noise['total']:.2f} um from {noise['source']}; {result.rows} readings, "
        f"{int(result.outliers.sum())} left out as gross errors"
    )
    return "\n".join(lines)
