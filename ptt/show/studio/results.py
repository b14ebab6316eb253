"""What goes to and fro between page and worker: which files are read, and what was found out, as plain values."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.show.studio.looks import Look

if TYPE_CHECKING:
    from ptt.door.options import Reading

ANSWERS = "answers.toml"
SEAL = "sealed.json"
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
    """

    run: str
    also: tuple[str, ...] = ()
    targets: str = ""
    set_: tuple[str, ...] = ()
    map_: str = ""
    effects: tuple[str, ...] = ()
    answers: tuple[tuple[str, str], ...] = ()

    @property
    def options(self) -> tuple[str, ...]:
        """Options that a command would be given."""
        pairs = [("--also", each) for each in self.also] + [("--set", each) for each in self.set_]
        pairs += [("--targets", self.targets), ("--map", self.mapping)]
        pairs += [("--effects", each) for each in self.effects]
        return tuple(word for pair in pairs if pair[1] for word in pair)

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

    def reading(self) -> "Reading":
        """The same as the command line has it; nobody is asked on a terminal."""
        from ptt.door.options import Reading

        return Reading(
            also=[Path(name) for name in self.also],
            targets=Path(self.targets) if self.targets else None,
            set_=self.set_,
            map_=Path(self.mapping) if self.mapping else None,
            effects=[Path(name) for name in self.effect_files],
            json=True,
        )


@dataclass(frozen=True, eq=False)
class Compared:
    """A comparison: its look, the figures that `ptt compare --json` prints, and its text."""

    look: Look
    data: Mapping[str, Any]
    text: str


@dataclass(frozen=True)
class Learned:
    """A diagnosis: what `ptt diagnose --json` prints, its text, and the CSV of poses to measure ('' where none)."""

    data: Mapping[str, Any]
    text: str
    measure_next: str


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
