"""Writing blocks with corrected positions; all else of a line stays as it was."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ptt.correct.program.codes import FURTHER_AXES, HOME, MOTIONS, TOOL_AXES
from ptt.correct.program.modal import ARC, ModalState, Read
from ptt.correct.program.moves import Move
from ptt.correct.program.words import ProgramBlock, Word

Array = np.ndarray

DIGITS = {1.0: 5, 25.4: 6}  # decimals by unit (mm, inch): 0.01 um and 0.025 um
FURTHER_DIGITS = 5  # of axes beside X, Y, Z
STOPS = (0, 10, 20, 300, 600)  # M0, M1, M2, M30, M60 act after the move of their block


@dataclass(frozen=True, eq=False)
class Piece:
    """A straight segment of a corrected move.

    Attributes:
        place: (3,) mm, where it ends, in the program's coordinates.
        share: fraction of the move completed there.
    """

    place: Array
    share: float


@dataclass
class Writer:
    """The controller's state by the lines written so far.

    Attributes:
        place: (3,) mm, as printed, in the program's coordinates.
        home: (3,) mm, the machine's zero in them, for G53.
        motion: modal motion in force, ten times its G-code.
        carried: positions of further axes as printed.
    """

    place: Array
    home: Array
    motion: int = -1
    carried: dict[str, float] = field(default_factory=dict)

    def lines(self, block: ProgramBlock, move: Move, pieces: list[Piece]) -> list[str]:
        """Lines that replace a block with a move.

        Args:
            block: the line.
            move: its move.
            pieces: its segments, at least one.

        Returns:
            The lines.
        """
        said = {word.letter for word in block.words}
        drop = set(TOOL_AXES + FURTHER_AXES) | (set(ARC) if move.arc is not None else set())
        head = [part for part in block.parts if not _dropped(part, drop)]
        at = next(number for number, part in enumerate(block.parts) if _dropped(part, drop))
        before = sum(not _dropped(part, drop) for part in block.parts[:at])
        stops = [part for part in head if isinstance(part, Word) and part.letter == "M" and part.code in STOPS]
        if len(pieces) > 1:
            before -= sum(part in stops for part in head[:before])
            head = [part for part in head if part not in stops]
        lines = []
        for number, piece in enumerate(pieces):
            last = number == len(pieces) - 1
            words = self._words(move, piece, said if last else set(), first=number == 0 and _states(block))
            if number == 0:
                words = [*_texts(head[:before]), *words, *_texts(head[before:])]
            if last and len(pieces) > 1:
                words += _texts(stops)
            lines.append(" ".join(words))
        return [line for line in lines if line]

    def keep(self, block: ProgramBlock, state: ModalState) -> str:
        """Text of a block without a move, unchanged; the state follows what it changes."""
        codes = [word.code for word in block.words if word.letter == "G"]
        if any(code in MOTIONS or code == 800 for code in codes):
            self.motion = state.motion
        if 920 in codes:
            self.carried |= {word.letter: word.value for word in block.words if word.value is not None}
        return block.text

    def _words(self, move: Move, piece: Piece, said: set[str], *, first: bool) -> list[str]:
        motion = 0 if move.rapid else 10
        words = [f"G{motion // 10}"] if first or motion != self.motion else []
        if move.machine:
            words = ["G53", *words]
        self.motion = motion
        moved = [word for axis in range(3) for word in self._axis(move, axis, piece, said)]
        return [*words, *moved, *self._further(move, piece)]

    def _axis(self, move: Move, axis: int, piece: Piece, said: set[str]) -> list[str]:
        letter, here = TOOL_AXES[axis], self.place[axis]
        if not move.known[axis] and (move.absolute or letter not in said):  # an increment is one from any place
            return []
        digits = DIGITS[move.unit]
        zero = self.home[axis] if move.machine else 0.0 if move.absolute else here
        printed = round((piece.place[axis] - zero) / move.unit, digits)
        same = printed == (round((here - zero) / move.unit, digits))
        self.place[axis] = zero + printed * move.unit
        return [] if same and letter not in said else [f"{letter}{_plain(printed, digits)}"]

    def _further(self, move: Move, piece: Piece) -> list[str]:
        words = []
        for letter, (begin, end, relative) in move.carried.items():
            here = self.carried.get(letter, begin)
            wanted = begin + piece.share * (end - begin)
            printed = round(wanted - here if relative else wanted, FURTHER_DIGITS)
            self.carried[letter] = here + printed if relative else printed
            words.append(f"{letter}{_plain(printed, FURTHER_DIGITS)}")
        return words


def write_program(read: Read, pieces: list[list[Piece]], start: Array, home: Array) -> str:
    """Write a program with corrected places.

    Args:
        read: the program.
        pieces: of each move.
        start: (3,) mm, where the controller is before the first move.
        home: (3,) mm, the machine's zero in the program's coordinates.

    Returns:
        The text.
    """
    writer = Writer(np.array(start, dtype=float), home)
    moves = {move.block: (number, move) for number, move in enumerate(read.moves)}
    lines: list[str] = []
    for index, block in enumerate(read.blocks):
        if index in moves:
            number, move = moves[index]
            lines += writer.lines(block, move, pieces[number])
        else:
            lines.append(writer.keep(block, read.states[index]))
            if any(word.letter == "G" and word.code in HOME for word in block.words):
                writer.place = np.array(start, dtype=float)
    return "\n".join(lines) + "\n"


def _dropped(part: Word | str, letters: set[str]) -> bool:
    if isinstance(part, str):
        return False
    return part.letter in letters or (part.letter == "G" and part.code in (*MOTIONS, 530))


def _states(block: ProgramBlock) -> bool:
    return any(word.letter == "G" and word.code in MOTIONS for word in block.words)


def _texts(parts: Iterable[Word | str]) -> list[str]:
    return [part if isinstance(part, str) else part.text for part in parts]


def _plain(value: float, digits: int) -> str:
    """A number without needless zeros."""
    text = f"{value + 0.0:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text
