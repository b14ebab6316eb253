"""Provenance of a report: its input files by short names with hashes, and the options that were given.

Folders are left out of all names, as they may be private and mean nothing on another computer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath

from ptt.files import sha256
from ptt.record import Record
from ptt.run.table import Table

ROLES = ("model", "compensator", "run", "also", "after", "targets", "map", "effects")


@dataclass(frozen=True)
class InputFile(Record):
    """One input file.

    Attributes:
        role: one of `ROLES`.
        name: its short name.
        sha256: of its content, hexadecimal.
    """

    role: str
    name: str
    sha256: str


@dataclass(frozen=True)
class MadeOf:
    """What a report was made from.

    Attributes:
        files: every input file, those of a compensator folder one by one.
        names: role -> short names for command lines, a folder as one name.
        settings: values of --set, such as 'payload_kg=2'.
        shown: path as it was opened -> its short name, where the two differ.
    """

    files: tuple[InputFile, ...] = ()
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    settings: tuple[str, ...] = ()
    shown: Mapping[str, str] = field(default_factory=dict)

    def one(self, role: str, default: str) -> str:
        """The first name of a role, or the default where there is none."""
        return self.names.get(role, (default,))[0]

    def clean(self, text: str) -> str:
        """A text with every opened path replaced by its short name."""
        for path in sorted(self.shown, key=len, reverse=True):
            text = text.replace(path, self.shown[path])
        return text


def source_of(paths: Mapping[str, Sequence[Path]], settings: Sequence[str] = ()) -> MadeOf:
    """Hash the files and find the shortest names that tell them apart.

    Args:
        paths: role -> files or compensator folders.
        settings: values of --set, such as 'payload_kg=2'.

    Returns:
        The source.
    """
    given = [(role, path) for role in ROLES for path in paths.get(role, ())]
    short = dict(zip((str(path) for _, path in given), short_names([path for _, path in given]), strict=True))
    names: dict[str, tuple[str, ...]] = {}
    files: list[InputFile] = []
    for role, path in given:
        names[role] = (*names.get(role, ()), short[str(path)])
        inner = sorted(part for part in path.iterdir() if part.is_file()) if path.is_dir() else []
        shown = [f"{short[str(path)]}/{part.name}" for part in inner] or [short[str(path)]]
        files += [InputFile(role, name, sha256(part)) for name, part in zip(shown, inner or [path], strict=True)]
    differing = {path: name for path, name in short.items() if path != name}
    return MadeOf(tuple(dict.fromkeys(files)), names, tuple(settings), differing)


def short_names(paths: Sequence[PurePath]) -> list[str]:
    """The shortest tails of paths that tell different files apart.

    Args:
        paths: as given.

    Returns:
        For example 'run.csv', or 'monday/run.csv' where there is a second run.csv.
    """
    names = []
    for path in paths:
        others = [other for other in paths if other != path]
        length = 1
        while length < len(path.parts) and any(_tail(other, length) == _tail(path, length) for other in others):
            length += 1
        names.append(_tail(path, length))
    return names


def shown_table(table: Table, source: MadeOf) -> Table:
    """A table with short names in place of paths in its source, run labels and findings.

    Args:
        table: as read.
        source: what was read.

    Returns:
        The table; no number changes.
    """
    lines = tuple(source.clean(line) for line in table.understood.lines)
    return table.replace(
        source=source.clean(table.source),
        run_label=tuple(source.clean(label) for label in table.run_label),
        files=tuple(source.clean(name) for name in table.files),
        understood=replace(table.understood, lines=lines),
    )


def _tail(path: PurePath, length: int) -> str:
    parts = [part for part in path.parts if part not in (path.anchor, "..", ".")]
    return "/".join(parts[-length:])
