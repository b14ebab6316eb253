"""What goes to and fro between page and worker: which files are read, and what was found out, as plain values."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.show.studio.looks import Look

if TYPE_CHECKING:
    from ptt.door.options import ReadOptions

ANSWERS = "answers.toml"
COLUMNS = "columns.toml"  # what a person said of the columns, in the grid
MENDED = "mended.csv"  # the run with the mistakes of its set-up undone
SEAL = "sealed.json"
ORDER = "order"  # what --set says of rows whose time goes back
EFFECTS = "effects"  # folder of the effect files; uploads never get there, for what is in it is executed


@dataclass(frozen=True)
class Source:
    """Which files a session reads, by their names in its folder, and how.

    Attributes:
        run: tracker CSV.
        also: further runs.
        targets: targets of an export; '' where none.
        set_: 'column=value' each.
        map_: saved answers on columns and units; '' where none.
        effects: Python files that the person who started the page named; they lie in the folder `EFFECTS`.
        answers: (question, answer) given on the page.
        anyway: whether to go on although the set-up looks mistaken.
    """

    run: str
    also: tuple[str, ...] = ()
    targets: str = ""
    set_: tuple[str, ...] = ()
    map_: str = ""
    effects: tuple[str, ...] = ()
    answers: tuple[tuple[str, str], ...] = ()
    anyway: bool = False

    @property
    def options(self) -> tuple[str, ...]:
        """Options that a command would be given."""
        pairs = [("--also", each) for each in self.also] + [("--set", each) for each in self.set_]
        pairs += [("--targets", self.targets), ("--map", self.mapping)]
        pairs += [("--effects", each) for each in self.effects]
        words = tuple(word for pair in pairs if pair[1] for word in pair)
        return (*words, "--anyway") if self.anyway else words

    @property
    def words(self) -> str:
        """Run and options as one writes them."""
        return shlex.join([self.run, *self.options])

    @property
    def mapping(self) -> str:
        """File with the answers on columns and units; '' where none."""
        return ANSWERS if self.answers else self.map_

    @property
    def effect_files(self) -> tuple[str, ...]:
        """Where the effect files are."""
        return tuple(f"{EFFECTS}/{name}" for name in self.effects)

    def answered(self, about: str, question: str, choice: str) -> "Source":
        """The same with an answer more.

        Args:
            about: of the question, as `QuestionError` has it.
            question: what was open.
            choice: the answer.
        """
        if about == ORDER:
            return replace(self, set_=(*self.set_, f"{ORDER}={choice}"))
        return replace(self, answers=(*self.answers, (question, choice)))

    def reading(self) -> "ReadOptions":
        """The same as the command line has it; nobody is asked on a terminal."""
        from ptt.door.options import ReadOptions

        return ReadOptions(
            also=[Path(name) for name in self.also],
            targets=Path(self.targets) if self.targets else None,
            set_=self.set_,
            map_=Path(self.mapping) if self.mapping else None,
            effects=[Path(name) for name in self.effect_files],
            json=True,
            anyway=self.anyway,
        )


@dataclass(frozen=True, eq=False)
class Compared:
    """A comparison: its look, the figures that `ptt compare --json` prints, and its text."""

    look: Look
    data: Mapping[str, Any]
    text: str


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis.

    Attributes:
        data: what `ptt diagnose --json` prints.
        text: the same as text.
        measure_next: CSV of poses to measure; '' where none.
        card: the result in short, `ptt.show.card.result.card_of_diagnosis`.
        fits: effect -> this run's data with the fit through it.
        ghosts: effect -> how far the parts of the machine are off, at each pose of the picture.
        unknown: the one curve that the unknown follows; None where there is none.
        cards: effect -> what its card says, of each that is suggested.
        sizes: all other sizes of the drawing, where one is suggested.
        whole: the diagnosis itself, as the process that made it packed it; for a report of this sitting, never on disk.
    """

    data: Mapping[str, Any]
    text: str
    measure_next: str
    card: Mapping[str, Any] = field(default_factory=dict)
    fits: Mapping[str, Any] = field(default_factory=dict)
    ghosts: Mapping[str, Any] = field(default_factory=dict)
    unknown: Mapping[str, Any] | None = None
    cards: Mapping[str, Any] = field(default_factory=dict)
    sizes: Sequence[str] = field(default_factory=list)
    whole: bytes = field(default=b"", compare=False, repr=False)


@dataclass(frozen=True)
class Changed:
    """A changed model: its TOML, what `ptt add --json` prints, and the fit in words."""

    model: str
    data: Mapping[str, Any]
    text: str


@dataclass(frozen=True)
class Trained:
    """A trained compensator: figures before and after, and the folder as a zip."""

    data: Mapping[str, Any]
    archive: bytes


@dataclass(frozen=True)
class Predicted:
    """Corrected commands: what `ptt predict --json` prints, its warnings, and the CSV."""

    data: Mapping[str, Any]
    notes: tuple[str, ...]
    content: bytes
