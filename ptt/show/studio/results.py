"""Values that page and workers exchange: the source (which files are read, and how), and results of jobs."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.show.studio.looks import Look

if TYPE_CHECKING:
    from ptt.door.options import ReadOptions

# Files in the folder of a session, and, last, the folder of effect files.
ANSWERS = "answers.toml"  # answers to questions about columns, as a file for --map
COLUMNS = "columns.toml"  # the same as entered in the grid of columns
MENDED = "mended.csv"  # the run with mistakes of its set-up corrected
SEAL = "sealed.json"  # of a challenge
SEALS = "seals"  # folder of seals, each in a folder that is named as its run
EFFECTS = "effects"  # uploads never get there, because its files are executed
ORDER = "order"  # key of --set that says what to do with rows whose time goes back


@dataclass(frozen=True)
class Source:
    """Which files a session reads, by their names in its folder, and how.

    Attributes:
        run: tracker CSV.
        also: further runs, read together with it.
        targets: targets of an export that holds readings only; '' for none.
        set_: values of --set, 'column=value' each.
        map_: file for --map with answers on columns and units; '' for none.
        effects: Python files in the folder `EFFECTS`, named by whoever started the server, or written by it.
        answers: (question, answer) pairs given on the page.
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
        """The same as options of a command line."""
        pairs = [("--also", each) for each in self.also] + [("--set", each) for each in self.set_]
        pairs += [("--targets", self.targets), ("--map", self.mapping)]
        pairs += [("--effects", each) for each in self.effects]
        words = tuple(word for pair in pairs if pair[1] for word in pair)
        return (*words, "--anyway") if self.anyway else words

    @property
    def words(self) -> str:
        """Run and options as words of a shell."""
        return shlex.join([self.run, *self.options])

    @property
    def mapping(self) -> str:
        """File for --map, with answers given on the page if there are any; '' for none."""
        return ANSWERS if self.answers else self.map_

    @property
    def sealed(self) -> str:
        """Folder with the seal of the run, if it is a challenge's and read by itself; relative to the session's."""
        return f"{SEALS}/{'' if self.also else self.run}"

    @property
    def effect_files(self) -> tuple[str, ...]:
        """Paths of the effect files, relative to the session's folder."""
        return tuple(f"{EFFECTS}/{name}" for name in self.effects)

    def answered(self, about: str, question: str, choice: str) -> "Source":
        """The source with one more answer.

        Args:
            about: what the question is about, as in `QuestionError`.
            question: the question.
            choice: the answer.
        """
        if about == ORDER:
            return replace(self, set_=(*self.set_, f"{ORDER}={choice}"))
        return replace(self, answers=(*self.answers, (question, choice)))

    def reading(self) -> "ReadOptions":
        """The same as options of the library; with `json` set, so that nobody is asked on a terminal."""
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
        data: JSON of `ptt diagnose`.
        text: what it prints.
        measure_next: CSV of poses to measure; '' for none.
        card: the result card, from `ptt.show.card.result.card_of_diagnosis`.
        fits: residuals and fits of suggested effects, from `ptt.show.card.fits.fits_of`.
        ghosts: displacements by suggested effects, from `ptt.show.card.ghost.ghosts_of`.
        unknown: the leading dependence of an unknown with its readings; None for any other verdict.
        cards: suggested effect -> its card in words.
        sizes: keys of all other sizes of the drawing, where one of them is suggested.
        whole: the diagnosis itself, pickled, for a report; never written to disk.
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
