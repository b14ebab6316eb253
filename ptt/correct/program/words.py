"""G-code as text: blocks of words and comments, each with its line.

Source: NIST RS274/NGC, version 3, sections 3.3 and 3.4 (Kramer, Proctor, Messina, NISTIR 6556, 2000).
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from ptt.errors import InputError

TOKEN = re.compile(
    r"(?P<space>\s+)|(?P<comment>\([^()]*\)|;.*)|(?P<mark>[%/])"
    r"|(?P<letter>[A-Za-z$])\s*(?P<number>[-+]?\s*(?:\d[\d ]*\.?[\d ]*|\.[\d ]+))?"
)
ALONE = "is evaluated only by the controller"
GREATEST = 1e9  # in the letter's unit: larger numbers are no position of a machine
FOREIGN = {
    "#": ("a parameter", ALONE),
    "[": ("an expression", ALONE),
    "=": ("an assignment", ALONE),
    "<": ("a name", ALONE),
    "@": ("a polar coordinate", ALONE),
    "^": ("a polar coordinate", ALONE),
    "(": ("a comment without end", "is not closed"),
}
WORDS = re.compile(r"(\s*[A-Za-z]\s*[-+]?\s*[\d.]+)+\s*([(;].*)?")
TEXT = (23, 32, 117, 118)  # M-codes followed by a file name or a message up to the end of the line
EXPAND = "let the post-processor or the controller's interpreter write the program out, and correct that"


@dataclass(frozen=True)
class Word:
    """A letter with its number.

    Attributes:
        letter: upper case; '$' is a spindle's number.
        value: the number; None where there is none.
        text: as written.
    """

    letter: str
    value: float | None
    text: str

    @property
    def code(self) -> int:
        """Ten times the number, so that G91.1 is 911; -1 where there is none."""
        return -1 if self.value is None else round(10.0 * self.value)


@dataclass(frozen=True)
class ProgramBlock:
    """A line of a program.

    Attributes:
        line: its number in the file, from 1.
        text: as written, without the line's end.
        parts: words, comments and marks in order.
    """

    line: int
    text: str
    parts: tuple[Word | str, ...]

    @property
    def words(self) -> list[Word]:
        """Words in order."""
        return [part for part in self.parts if isinstance(part, Word)]

    def values(self, letters: Iterable[str], source: str) -> dict[str, float]:
        """Numbers of some letters.

        Args:
            letters: which.
            source: file name for messages.

        Returns:
            Letter -> number, of those that are there.

        Raises:
            InputError: a letter appears twice or has no number.
        """
        found: dict[str, float] = {}
        for word in self.words:
            if word.letter not in letters:
                continue
            if word.letter in found or word.value is None:
                what = "appears twice" if word.letter in found else "has no number"
                raise InputError(f"{word.letter} {what}", where=at_line(source, self.line), fix="correct the line")
            found[word.letter] = word.value
        return found


def at_line(source: str, line: int) -> str:
    """File and line, for messages."""
    return f"{source} line {line}"


def read_blocks(text: str, source: str) -> list[ProgramBlock]:
    """Read the lines of a program.

    Args:
        text: the program.
        source: file name for messages.

    Returns:
        The blocks, empty lines included.

    Raises:
        InputError: a line that holds anything but words and comments.
    """
    lines = re.split(r"\r\n|\r|\n", text)  # not splitlines(), whose other separators may be in a comment
    return [_read(number, line, source) for number, line in enumerate(lines if lines[-1] else lines[:-1], 1)]


def _is_text(parts: list[Word | str], word: Word, rest: str) -> bool:
    """Whether the rest of a line is a file name or a message: after such an M-code at its head, if it is not words."""
    first = all(isinstance(part, Word) and part.letter == "N" for part in parts[:-1])
    return first and word.letter == "M" and word.code // 10 in TEXT and bool(rest.strip()) and not WORDS.fullmatch(rest)


def _read(number: int, line: str, source: str) -> ProgramBlock:
    parts: list[Word | str] = []
    place = 0
    while place < len(line):
        found = TOKEN.match(line, place)
        if found is None:
            told = line[place:].lstrip("+- ")[:1]  # the first character behind signs names what cannot be read
            what, why = FOREIGN.get(told, (f"'{line[place]}'", "is not G-code"))
            where = f"{at_line(source, number)}, column {place + 1}"
            raise InputError(f"{what} {why}", where=where, fix=EXPAND if why == ALONE else "correct the line")
        if found["letter"]:
            digits = (found["number"] or "").replace(" ", "")
            value = float(digits) if digits else None
            if value is not None and not abs(value) <= GREATEST:
                where = f"{at_line(source, number)}, column {place + 1}"
                raise InputError(f"'{found[0].strip()}' is beyond any machine", where=where, fix="correct the line")
            word = Word(found["letter"].upper(), value, found[0].strip())
            parts.append(word)
            if _is_text(parts, word, line[found.end() :]):
                parts.append(line[found.end() :])
                break
        elif not found["space"]:
            parts.append(found[0])
        place = found.end()
    return ProgramBlock(number, line, tuple(parts))
