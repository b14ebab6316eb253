"""Interpreter of a program: modal state and moves, block by block.

Source: RS274/NGC 3.4 to 3.8 and LinuxCNC's G-code reference for the order in which a block's words act.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ptt.correct.program.codes import (
    EXTRUDER_RELATIVE,
    FURTHER_AXES,
    HOME,
    LENGTHS,
    MM,
    MODES,
    MOTIONS,
    NO_MOTION,
    OWN_AXES,
    PROBES,
    TOOL_AXES,
    own_words,
    refuse,
)
from ptt.correct.program.moves import Arc, Move, find_arc
from ptt.correct.program.words import ProgramBlock, at_line
from ptt.errors import InputError

Array = np.ndarray

ARC = "IJKRP"
ADRIFT = "and perhaps others go on by increments (G91) from a place that the program has not stated"


@dataclass(frozen=True)
class ModalState:
    """Modal state: what lasts from block to block.

    Attributes:
        place: (3,) mm, programmed position of the tool.
        known: (3,) bool, axes whose position the program has stated.
        motion: ten times the number of the G-code of moves; NO_MOTION where none is in force.
        absolute: G90, else G91.
        centre_absolute: G90.1, else G91.1.
        unit: mm per unit.
        plane: 17, 18 or 19.
        feed: mm/s, NaN until stated.
        system: work coordinate system, ten times its G-code.
        carried: positions of further axes, letter -> value.
        extruder_relative: M83.
    """

    place: Array
    known: Array = field(default_factory=lambda: np.zeros(3, dtype=bool))
    motion: int = NO_MOTION
    absolute: bool = True
    centre_absolute: bool = False
    unit: float = 1.0
    plane: int = 17
    feed: float = float("nan")
    system: int = 540
    carried: dict[str, float] = field(default_factory=dict)
    extruder_relative: bool | None = None


@dataclass(frozen=True)
class Read:
    """A program as moves.

    Attributes:
        blocks: its lines.
        moves: in order.
        states: in force after each block.
        notes: what a user should know.
    """

    blocks: list[ProgramBlock]
    moves: list[Move]
    states: list[ModalState]
    notes: list[str]


def read_moves(
    blocks: list[ProgramBlock], start: Array, home: Array | None, source: str, *, stated: bool = False
) -> Read:
    """Interpret a program.

    Args:
        blocks: its lines.
        start: (3,) mm, where the tool is before the first move, in the program's coordinates.
        home: (3,) mm, the machine's zero in the program's coordinates; None where these are rotated against it.
        source: file name for messages.
        stated: whether the user gave `start`, so that all axes are known.

    Returns:
        The moves.

    Raises:
        InputError: a line whose moves cannot be determined, by its number.
    """
    state = ModalState(np.asarray(start, dtype=float), known=np.full(3, stated))
    moves: list[Move] = []
    states: list[ModalState] = []
    notes: list[str] = []
    systems: set[int] = set()
    for index, block in enumerate(blocks):
        codes = [word.code for word in block.words if word.letter == "G"]
        refuse(block, codes, source)
        state = _set_modes(state, block, codes, source)
        own = [code for code in codes if code in OWN_AXES]
        if own:
            state = _own_axes(state, block, own[0], start, source)
        elif _moves(block, state):
            move, state = _move(state, block, codes, index, home, source)
            moves.append(move)
            notes += [line for line in _adrift(move, block) if not any(ADRIFT in told for told in notes)]
            systems |= set() if move.machine else {state.system}
        states.append(state)
        if len(systems) > 1:
            what = "moves in a second work coordinate system, but --offset states only one"
            raise InputError(what, where=at_line(source, block.line), fix="split the program by coordinate systems")
        notes += [line for line in _notes(codes) if line not in notes]
    if moves and not any(word.code in MM for block in blocks for word in block.words if word.letter == "G"):
        notes.append("neither G20 nor G21: millimetres are assumed")
    return Read(blocks, moves, states, notes)


def _set_modes(state: ModalState, block: ProgramBlock, codes: list[int], source: str) -> ModalState:
    """The state with what a block's G-codes, M82, M83 and feed word change of it."""
    changes = dict(MODES[code] for code in codes if code in MODES)
    for word in block.words:
        if word.letter == "M" and word.code in EXTRUDER_RELATIVE:
            changes["extruder_relative"] = EXTRUDER_RELATIVE[word.code]
    state = replace(state, **changes)  # type: ignore[arg-type]
    feed = block.values("F", source).get("F")
    return state if feed is None else replace(state, feed=feed * state.unit / 60.0)


def _own_axes(state: ModalState, block: ProgramBlock, code: int, start: Array, source: str) -> ModalState:
    """The state after a block whose axis words are not a target."""
    if code in HOME:
        return replace(state, place=np.asarray(start, dtype=float), known=np.zeros(3, dtype=bool))
    if code == 920:
        if any(word.letter in TOOL_AXES for word in block.words):
            fix = "write all positions from one origin, or state it with --offset"
            raise InputError("G92 moves the origin within the program", where=at_line(source, block.line), fix=fix)
        return replace(state, carried=state.carried | block.values(FURTHER_AXES, source))
    return state


def _moves(block: ProgramBlock, state: ModalState) -> bool:
    letters = {word.letter for word in block.words}
    if own_words(block) and not any(word.letter == "G" and word.code in MOTIONS for word in block.words):
        return False
    centre = state.motion in (20, 30) and bool(letters & {"I", "J", "K"})
    return bool(letters & set(TOOL_AXES + FURTHER_AXES)) or centre


def _move(
    state: ModalState, block: ProgramBlock, codes: list[int], index: int, home: Array | None, source: str
) -> tuple[Move, ModalState]:
    where = (source, block.line)
    if state.motion == NO_MOTION:
        raise InputError("axis words before any of G0, G1, G2, G3", where=at_line(*where), fix="correct the line")
    if "/" in block.parts:
        fix = "remove the line, or the slash"
        raise InputError("a move that the controller may skip", where=at_line(*where), fix=fix)
    machine = 530 in codes
    if machine and (home is None or not state.absolute or state.motion not in (0, 10)):
        what = "G53 needs G90, G0 or G1, and coordinates that are not turned"
        raise InputError(what, where=at_line(*where), fix="correct the line")
    stated = block.values(TOOL_AXES, source)
    end, known = _end(state, stated, home if machine and home is not None else np.zeros(3))
    arc = None
    if state.motion in (20, 30):
        arc = _arc(state, block, end, where)
    carried = _carried(state, block.values(FURTHER_AXES, source))
    feed = float("nan") if state.motion == 0 else state.feed
    move = Move(
        index, state.motion == 0, state.place, end, known, bool(state.known.all()), arc, feed, state.absolute,
        state.unit, machine, carried,
    )  # fmt: skip
    places = state.carried | {letter: stop for letter, (_, stop, _) in carried.items()}
    return move, replace(state, place=end, known=known, carried=places)


def _end(state: ModalState, stated: dict[str, float], origin: Array) -> tuple[Array, Array]:
    """Where a move ends, mm, and which axes are stated by then; `origin` is that of the numbers.

    An increment (G91) on a place that is not known leads to another such place.
    """
    end, known = state.place.copy(), state.known.copy()
    for axis, letter in enumerate(TOOL_AXES):
        if letter in stated:
            base = origin[axis] if state.absolute else state.place[axis]
            end[axis], known[axis] = base + state.unit * stated[letter], state.absolute or state.known[axis]
    return end, known


def _arc(state: ModalState, block: ProgramBlock, end: Array, where: tuple[str, int]) -> Arc:
    if not state.known.all():
        what = "an arc from a place that the program has not stated"
        fix = "state X, Y and Z by G0 before it, or say where the tool is: --start X Y Z"
        raise InputError(what, where=at_line(*where), fix=fix)
    words = block.values(ARC, where[0])
    return find_arc(
        state.place, end, state.plane, state.motion == 20, words, unit=state.unit,
        centre_absolute=state.centre_absolute, where=where,
    )  # fmt: skip


def _carried(state: ModalState, stated: dict[str, float]) -> dict[str, tuple[float, float, bool]]:
    """Start, end and whether relative of each further axis, in the program's units: interpolated, not corrected."""
    found = {}
    for letter, value in stated.items():
        relative = not state.absolute
        if letter == "E" and state.extruder_relative is not None:
            relative = state.extruder_relative
        begin = state.carried.get(letter, 0.0)
        found[letter] = (begin, begin + value if relative else value, relative)
    return found


def _adrift(move: Move, block: ProgramBlock) -> list[str]:
    """A note on an increment from a place that the program has not stated."""
    letters = [letter for axis, letter in enumerate(TOOL_AXES) if not (move.absolute or move.known[axis])]
    if not any(word.letter in letters for word in block.words):
        return []
    return [f"line {block.line} {ADRIFT}: it is corrected as if the tool were at the start; state positions before it"]


def _notes(codes: list[int]) -> list[str]:
    notes = []
    if any(code in LENGTHS[:-1] for code in codes):
        notes.append("tool lengths (G43) are left to the controller: the correction is for the tool point at --offset")
    if any(code in HOME for code in codes):
        notes.append(
            "the program does not say where the tool is after G28, G30 and probing: a move that does not restate X, Y "
            "and Z is corrected as if it began where the tool was before the first move"
        )
    if any(code in PROBES for code in codes):
        notes.append("the controller's own correction after probing (G29, G32) is added to this correction")
    return notes
