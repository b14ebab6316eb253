"""Correction of a Cartesian G-code program for a controller that computes the nominal kinematics."""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import torch

from ptt.correct.commands import Commands, sent_rows
from ptt.correct.compensate import LIMIT_MM, compensate
from ptt.correct.context import beyond_context, beyond_lines, missing_context
from ptt.correct.program.cut import Places, ProgramFrame, distance_from_segment, sample_moves, thin_out
from ptt.correct.program.modal import Read, read_moves
from ptt.correct.program.moves import Move
from ptt.correct.program.words import at_line, read_blocks
from ptt.correct.program.write import Piece, write_program
from ptt.errors import InputError, PosesError
from ptt.machine import ThreePttSpec
from ptt.mechanisms import build_mechanism
from ptt.record import Record
from ptt.run.table import make_table
from ptt.run.target_frame import stated_frame

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ptt.correct.training.compensator import Compensator

Array = np.ndarray

CHORD_UM = 5.0  # default of --chord-um
SHOWN_LINES = 5  # named in a refusal
OUTSIDE = "outside the network's training domain"


@dataclass(frozen=True, eq=False)
class Corrected(Record):
    """A corrected program.

    Attributes:
        text: the program.
        lines: number of lines of the original program.
        moves: number of its moves.
        pieces: number of straight segments written.
        looked_at: number of positions at which the correction was computed.
        chord_um: tolerance of the written path, um.
        deviation_um: largest distance of the written path from a position that was left out, um.
        shift_um: largest static correction, um.
        reversal: who compensates reversal errors, in words.
        notes: what a user should know.
    """

    keys: ClassVar[str] = (
        "lines, moves, pieces, looked_at, chord_um, deviation_um, reversal, largest_shift_um: shift_um, notes"
    )

    text: str
    lines: int
    moves: int
    pieces: int
    looked_at: int
    chord_um: float
    deviation_um: float
    shift_um: float
    reversal: str
    notes: tuple[str, ...]


def correct_program(
    compensator: "Compensator",
    text: str,
    source: str = "program",
    *,
    chord_um: float = CHORD_UM,
    offset: Array | None = None,
    start: Array | None = None,
    limit: float = LIMIT_MM,
    context: "Mapping[str, float] | None" = None,
) -> Corrected:
    """Correct a program: its positions are replaced by forward kinematics (drawing) of the corrected slider heights.

    Args:
        compensator: model, and network where there is one.
        text: the program.
        source: its name for messages.
        chord_um: largest distance of the written path from the corrected one, um.
        offset: (3,) mm, where the program's zero lies in the base frame (its work offset and tool length); None takes
            the frame that the machine file states for targets.
        start: (3,) mm, where the tool is before the first move, in the program's coordinates; None takes p = 0 for
            axes that the program has not stated yet, and leaves them unwritten.
        limit: largest correction, mm.
        context: payload_kg, temp_c, time_s of the whole program.

    Returns:
        The corrected program.

    Raises:
        InputError: a line that cannot be read or told, or a machine whose poses a program does not say.
        PosesError: lines that the machine cannot run.
    """
    spec = compensator.model.file.machine
    if not isinstance(spec, ThreePttSpec):
        what = f"is a {spec.kind} machine, and a program's X, Y, Z do not say in which posture to reach them"
        raise InputError(what, where=compensator.model.file.source, fix="correct joint commands: ptt predict")
    frame = _frame(compensator, offset)
    here = frame.from_base(np.zeros((1, 3)))[0]
    stated, start = start is not None, here if start is None else np.asarray(start, dtype=float)
    turned = not np.array_equal(frame.turn, np.eye(3))
    read = read_moves(read_blocks(text, source), start, None if turned else here, source, stated=stated)
    mechanism = build_mechanism(spec)
    places = sample_moves(read.moves, frame, mechanism, 1e-3 * chord_um, spec.screw_lead_mm)
    if not len(places.move):
        raise InputError("holds no move", where=source, fix="is it a G-code program?")
    commands, lacking = _command(compensator, places, limit, source, context or {})
    _refuse(read, places, commands, source)
    corrected = frame.from_base(mechanism.forward(torch.as_tensor(commands.q)).numpy())
    pieces, deviation = _pieces(read.moves, places, corrected, 1e-3 * chord_um)
    return Corrected(
        write_program(read, pieces, start, here),
        len(read.blocks),
        len(read.moves),
        sum(len(each) for each in pieces),
        len(places.move),
        chord_um,
        1e3 * deviation,
        1e3 * float(np.nanmax(commands.shift)),
        commands.reversal_note,
        (*read.notes, *lacking, *(_unstarted(compensator) if not stated else ())),
    )


def _unstarted(compensator: "Compensator") -> tuple[str, ...]:
    """A note where the direction from which joints come to the first move matters and the start is not stated."""
    if not any(term.effect.reverses and term.effect.stage != "metrology" for term in compensator.model.terms):
        return ()
    return (
        "the position before the first move is not stated (--start): joints that reverse there may lose their play or "
        "wind-up once more, until each has moved as far in one direction",
    )


def _frame(compensator: "Compensator", offset: Array | None) -> ProgramFrame:
    if offset is not None:
        return ProgramFrame(np.eye(3), np.asarray(offset, dtype=float))
    file = compensator.model.file
    stated = stated_frame(file.targets)
    if stated.source == "unknown":
        what = "where is the program's zero? The runs that the model was fitted to contradict each other"
        raise InputError(what, where=f"{file.source} [targets]", fix="state it: --offset X Y Z")
    return ProgramFrame(stated.rotation, stated.origin)


def _command(
    compensator: "Compensator", places: Places, limit: float, source: str, context: "Mapping[str, float]"
) -> tuple[Commands, list[str]]:
    """Corrected slider heights of all places, in travel order, and notes on context that is missing or out of range."""
    model = compensator.in_base().model
    correction, inside = compensator.network_parts()
    moving = any("speed" in term.effect.requires for term in model.terms)
    table = make_table(places.place, source=source, feed_mm_s=places.feed if moving else None, **context)
    commands = compensate(
        model,
        table,
        correction=correction,
        inside=inside,
        limit=limit,
        network=compensator.error,
    )
    return commands, [*missing_context(model, table), *beyond_lines([beyond_context(model, table)], source, table.rows)]


def _refuse(read: Read, places: Places, commands: Commands, source: str) -> None:
    """Refuse a program with lines that cannot be run, by line and reason."""
    status = np.where(commands.in_domain | ~sent_rows(commands.status), commands.status, OUTSIDE)
    bad = np.flatnonzero(~sent_rows(status))
    if not len(bad):
        return
    first: dict[int, int] = {}
    for row in bad.tolist():
        first.setdefault(read.blocks[read.moves[places.move[row]].block].line, row)
    named = []
    for line, row in list(first.items())[:SHOWN_LINES]:
        at = " ".join(f"{letter}{value:.3f}" for letter, value in zip("XYZ", places.place[row], strict=True))
        named.append(f"{at_line(source, line)}: {status[row]} (at {at} of the base frame)")
    more = f"; and {len(first) - SHOWN_LINES} more lines" if len(first) > SHOWN_LINES else ""
    unknown = not read.moves[places.move[bad[0]]].begun
    fix = (
        "state where the tool is before the first move: --start X Y Z" if unknown else "change these lines, or --offset"
    )
    raise PosesError(f"{'; '.join(named)}{more}; nothing was written; {fix}")


def _pieces(moves: list[Move], places: Places, path: Array, tolerance: float) -> tuple[list[list[Piece]], float]:
    """Segments of each move, and the largest distance of their path from a position that was left out, mm."""
    ends = np.concatenate([[0], np.cumsum(np.bincount(places.move, minlength=len(moves)))])
    pieces, worst = [], 0.0
    for number, move in enumerate(moves):
        first, last = int(ends[number]), int(ends[number + 1])
        rows = np.arange(first - 1 if move.begun and first else first, last)
        kept = thin_out(path[rows], tolerance)
        worst = max(worst, _largest_deviation(path[rows], kept))
        pieces.append([Piece(path[row], float(places.share[row])) for row in rows[kept] if row >= first])
    return pieces, worst


def _largest_deviation(path: Array, kept: Array) -> float:
    gaps = [distance_from_segment(path[a + 1 : b], path[a], path[b]).max() for a, b in pairwise(kept) if b > a + 1]
    return float(max(gaps, default=0.0))
