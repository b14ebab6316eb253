"""`ptt program`: a G-code program with corrected places."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ptt.commands.common import Effects, Json, ModelPath, Set, note, parse_settings, show

CONTEXT = ("payload_kg", "temp_c", "time_s")
Triple = tuple[float, float, float]


def program(
    source: Annotated[Path, typer.Argument(metavar="IN.ngc", help="G-code: lines and arcs in X, Y, Z.")],
    model: ModelPath,
    out: Annotated[Path, typer.Option("--out", metavar="OUT.ngc", help="Corrected program to write.")],
    chord_um: Annotated[
        float,
        typer.Option("--chord-um", min=0.01, help="Largest deviation of the written path from the corrected one, um."),
    ] = 5.0,
    offset: Annotated[
        Triple | None,
        typer.Option("--offset", metavar="X Y Z", help="Position of the program's zero in the base frame, mm."),
    ] = None,
    start: Annotated[
        Triple | None, typer.Option("--start", metavar="X Y Z", help="Where the tool is before the first move, mm.")
    ] = None,
    limit_mm: Annotated[
        float, typer.Option("--limit-mm", min=0.0, help="Largest correction to send, mm at the tool.")
    ] = 5.0,
    set_: Set = None,
    effects: Effects = None,
    json: Json = False,
) -> None:
    """Correct a G-code program for a controller that runs Cartesian programs on nominal kinematics.

    Lines and arcs are cut where the correction or the arc requires it; words, comments, feed and modes are kept. If the
    machine cannot run a line, nothing is written (exit code 3).
    """
    import numpy as np

    from ptt.correct.program.program import correct_program
    from ptt.door.model import load
    from ptt.files import write_bytes

    compensator = load(model, effects=effects or ()).compensator
    text, encoding, end = _read(source)
    result = correct_program(
        compensator,
        text,
        str(source),
        chord_um=chord_um,
        offset=None if offset is None else np.array(offset),
        start=None if start is None else np.array(start),
        limit=limit_mm,
        context=_context(set_),
    )
    write_bytes(out, result.text.replace("\n", end).encode(encoding))
    for line in result.notes:
        note(line)
    data = {"program": str(source), "model": str(model), "out": str(out), **result.to_dict()}
    show(data, _text(data), json)


def _read(source: Path) -> tuple[str, str, str]:
    """A program's text, its encoding and the end of its lines; old controllers' comments are in Latin 1."""
    from ptt.errors import InputError
    from ptt.files import read_text

    try:
        text, encoding = read_text(source), "utf-8"
    except InputError as error:
        if "UTF-8" not in error.what:
            raise
        text, encoding = source.read_bytes().decode("latin-1"), "latin-1"
    return text, encoding, "\r\n" if b"\r\n" in source.read_bytes() else "\n"


def _context(set_: list[str] | None) -> dict[str, float]:
    from ptt.errors import InputError
    from ptt.run.readers.required import require_number

    values = parse_settings(set_ or ())
    strange = [key for key in values if key not in CONTEXT]
    if strange:
        fix = f"set one of {', '.join(CONTEXT)}; speeds come from F"
        raise InputError(f"'{strange[0]}' does not apply to a program", where="--set", fix=fix)
    numbers = {key: float(value) for key, value in values.items()}
    for key, value in numbers.items():
        require_number(key, value)
    return numbers


def _text(data: dict[str, Any]) -> str:
    return "\n".join(
        [
            f"{data['out']}: {data['moves']} moves of {data['lines']} lines, written as {data['pieces']} pieces",
            f"  largest static correction {data['largest_shift_um']:.1f} um; the written path deviates from the"
            f" corrected one by at most {data['deviation_um']:.2f} um ({data['chord_um']:g} um allowed)",
            f"  reversal: {data['reversal']}",
        ]
    )
