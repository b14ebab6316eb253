"""`ptt plan`: poses to measure first."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ptt.commands.common import Effects, Json, ReadOptions, note, progress, read_rows, refuse_idle, show

if TYPE_CHECKING:
    from ptt.door.model import Model
    from ptt.plan.expected import ExpectedKind
    from ptt.plan.first_run import FirstRun

REPEATS = 30  # degrees of freedom


def plan(
    machine: Annotated[Path, typer.Argument(metavar="M.toml", help="machine.toml or compensator folder.")],
    out: Annotated[Path, typer.Option("--out", metavar="TARGETS.csv", help="Targets to write.")],
    rows: Annotated[
        int, typer.Option("--rows", max=1_000_000, help="Approximate number of rows, base reflectors not counted.")
    ] = 200,
    payloads: Annotated[
        str, typer.Option("--payloads", metavar="KG,KG,...", help="Payloads to measure with, in turn: 0,2.5,5.")
    ] = "",
    repeats: Annotated[
        int, typer.Option("--repeats", min=0, help="Degrees of freedom wanted from repeated poses.")
    ] = REPEATS,
    box: Annotated[
        str,
        typer.Option(
            "--box",
            metavar="X,Y,Z",
            help="Half the size of the volume to stay within, mm: 60,60,50; about the home pose, or an arm's reach.",
        ),
    ] = "",
    seed: Annotated[int, typer.Option("--seed", min=0, help="Random seed of poses and order.")] = 0,
    candidates: Annotated[
        Path | None,
        typer.Option(
            "--candidates", metavar="T.csv", help="Choose from this list the rows that tell most about the geometry."
        ),
    ] = None,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Plan a first run: volume, both directions of arrival, repeats, datum revisits; and show what it will tell."""
    from ptt.door.model import load
    from ptt.door.options import parse_numbers
    from ptt.plan.first_run import plan_first_run
    from ptt.plan.space import build_space
    from ptt.run.written import write_table

    model = load(machine, effects=effects or ())
    if candidates is not None:
        idle = {"--payloads": payloads, "--box": box, "--repeats": repeats != REPEATS}
        refuse_idle(idle, "says how poses are drawn, but --candidates lists them", "leave one of the two out")
        _choose(candidates, rows, out, model, ReadOptions(json=json), seed)
        return
    loads = parse_numbers(payloads, "--payloads")
    half = parse_numbers(box, "--box", 3)
    size = None if not half else (half[0], half[1], half[2])
    with progress() as tell:
        result = plan_first_run(
            model.physics, rows=rows, payloads=loads, freedom=repeats, space=build_space(model.physics.file, size),
            seed=seed, known=model.library, progress=tell,
        )  # fmt: skip
    write_table(result.targets, out)
    show({**result.to_dict(), "out": str(out)}, format_plan(result, str(out)), json)


def _choose(candidates: Path, rows: int, out: Path, model: "Model", reading: ReadOptions, seed: int) -> None:
    """Choose D-optimal rows of a list and say how observable they make the geometry."""
    from ptt.plan.arm import choose_from
    from ptt.run.table import take_rows
    from ptt.run.written import write_table

    table = read_rows(candidates, model.file, reading, "targets")
    chosen = choose_from(model.physics, table, rows, model.library, seed)
    if aside := chosen.left_aside:
        some = "1 pose that cannot be driven is" if aside == 1 else f"{aside} poses that cannot be driven are"
        note(f"{candidates}: {some} left aside; `ptt predict` says why")
    write_table(take_rows(table, chosen.rows), out)
    sets = {"chosen": chosen.indices, "at random": chosen.drawn, "whole list": chosen.whole}
    lines = [f"{out}: {rows} of {table.rows} rows, D-optimal for {', '.join(chosen.effects)}"]
    lines += [f"  {name:<12} {found.poses:>5} poses, {found.text}" for name, found in sets.items()]
    data = {name.replace(" ", "_"): found.to_dict() for name, found in sets.items()}
    told = {"rows": rows, "out": str(out), "effects": list(chosen.effects), "left_aside": chosen.left_aside}
    show(told | data, "\n".join(lines), reading.json)


def format_plan(result: "FirstRun", out: str) -> str:
    """The plan as text.

    Args:
        result: the plan.
        out: where it was written.

    Returns:
        Lines.
    """
    from ptt.plan.expected import by_kind

    lines = [f"{out}: {result.targets.rows} rows", result.words, ""]
    own = any(effect.in_model for effect in result.effects)
    lines.append(f"{'effect':<20} {'seen':>8}  expected standard errors at {result.sigma * 1e3:g} um noise")
    for effect in result.effects:
        title = f"{'= ' if effect.in_model else '  ' if own else ''}{effect.effect}"
        if effect.needs:
            lines.append(f"{title:<20} {'-':>8}  needs {effect.needs}")
            continue
        parts = "; ".join(map(_in_words, by_kind(effect.parameters)))
        lines.append(f"{title:<20} {f'{effect.seen} of {effect.size}':>8}  {parts}")
    lines += ["= already in the model: how well this run would determine it again"] if own else []
    lines.append("each effect alone, added to the model; effects fitted together are determined less well")
    return "\n".join(lines)


def _in_words(kind: "ExpectedKind") -> str:
    """The largest standard error of one kind of parameter."""
    if kind.std is None:
        return f"{kind.name} {kind.unseen}"
    return ", ".join(filter(None, (f"{kind.name} {kind.std:.2g}", kind.unseen)))
