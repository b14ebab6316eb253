"""The command that adds what was found, with the files as they were given."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ptt.door.opened import Opened


@dataclass(frozen=True)
class Given:
    """What the next command is given; placeholders for what is in no file.

    Attributes:
        run: path of the run.
        model: path of the model.
        options: how the run is read, as words of a command line.
    """

    run: str = "RUN.csv"
    model: str = "M.toml"
    options: tuple[str, ...] = ()

    def add(self, effects: Sequence[str], *, sizes: bool = False) -> str:
        """The command that adds effects to the model, under a suggested name of the new one.

        Args:
            effects: their keys.
            sizes: whether all other sizes of the drawing are fitted as well.

        Returns:
            For example 'ptt add june.csv backlash --model machine.toml --out M2.toml'.
        """
        more = [*(["--sizes"] if sizes else []), "--model", shlex.quote(self.model), *map(shlex.quote, self.options)]
        words = ["ptt add", shlex.quote(self.run), *map(_as_word, effects), *more, "--out", self._out]
        return " ".join(words)

    @property
    def _out(self) -> str:
        """A name for the new model that is not the present one's: M2.toml, then M3.toml and so on."""
        number = re.fullmatch(r"M([0-9]+)\.toml", Path(self.model).name)
        return f"M{int(number[1]) + 1 if number else 2}.toml"


def given_in(opened: Opened | None) -> Given:
    """The files of a run and a model, as they were given.

    Args:
        opened: both; None where they are not known. A data frame and a model made in Python have no file.
    """
    if opened is None:
        return Given()
    of_files = bool(opened.run.files) and not opened.run.of_frames
    run, words = (str(opened.run.files[0]), opened.run.reading.words) if of_files else (Given.run, ())
    return Given(run, Given.model if opened.model_path is None else str(opened.model_path), words)


def _as_word(name: str) -> str:
    """A name as one word of a command line: harmonics have brackets and a blank."""
    return f'"{name}"' if "[" in name else name
