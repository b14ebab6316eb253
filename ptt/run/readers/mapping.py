r"""Answers about a file's columns and units, kept in a TOML file so that they are given once.

Every key is optional; what is absent is inferred from the file, or asked where that is ambiguous::

    encoding = "gbk"         # any Python codec name
    delimiter = ";"          # "," ";" "|" "\t" or "space"
    decimal = ","            # "." or ","
    dates = "day-first"      # or "month-first", for stamps such as 02/12/25
    pairing = "name"         # or "number" (ids are row numbers of the targets), "order"

    [columns]                # title in the file -> column of the tracker CSV without its unit, or "ignore"; the unit
                             # that the title states is the unit of its numbers, unless [units] says another
    "Goal x" = "x_cmd"       # a file without titles has "column 1", "column 2", ...
    "Goal roll" = "ignore"

    [units]                  # title in the file -> unit
    "Goal x" = "m"

    [targets]                # the same for the file given with --targets: targets.columns, targets.units ...

What [columns] and [units] say of a title that the file of the readings does not have holds for that of the targets.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import tomlkit

from ptt.documents import parse_toml
from ptt.errors import TableError
from ptt.files import read_text, write_text

Ask = Callable[[str, Sequence[str]], str]
"""Asks the user: (question, choices) -> one of the choices."""

IGNORE = "ignore"
ALLOWED = {
    "delimiter": ("\t", ";", ",", "|", "space"),
    "decimal": (".", ","),
    "dates": ("day-first", "month-first"),
    "pairing": ("name", "number", "order"),
}


@dataclass(frozen=True)
class Mapping:
    """Answers on one layout of files; None or a missing key means not answered.

    Attributes:
        encoding: codec name.
        delimiter: character between cells, or 'space'.
        decimal: '.' or ','.
        dates: 'day-first' or 'month-first'.
        pairing: 'name', 'number' or 'order'.
        columns: title -> quantity or 'ignore'.
        units: title -> unit.
        targets: answers on the file of the targets that an export is paired with.
    """

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    dates: str | None = None
    pairing: str | None = None
    columns: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    targets: "Mapping | None" = None


NOT_USED = "not used: "
ABSENT = "in the mapping but not in the file: "
MAP = "--map FILE.toml, "


@dataclass(frozen=True)
class Understood:
    """How a file was interpreted, for the user to check.

    Attributes:
        lines: one finding a line: encoding, delimiter, column -> meaning and unit, pairing, warnings.
        ignored: titles of the columns that were not used.
        mapping: the interpretation as answers that can be saved and reused.
    """

    lines: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    mapping: Mapping = field(default_factory=Mapping)

    def __str__(self) -> str:
        """All lines as one text."""
        return "\n".join(self.lines)


def load_mapping(path: str | Path) -> Mapping:
    """Read saved answers.

    Args:
        path: TOML file as in the module's description.

    Returns:
        The answers.

    Raises:
        TableError: no such file, no TOML, an unknown key or a value of the wrong kind.
    """
    data = parse_toml(read_text(path, TableError), str(path), TableError, "mend or delete it")
    return _mapping_from(data, str(path))


def _mapping_from(data: dict[str, Any], where: str) -> Mapping:
    kinds = {entry.name: dict if entry.name in ("columns", "units", "targets") else str for entry in fields(Mapping)}
    for key, value in data.items():
        if key not in kinds:
            raise TableError(f"unknown key '{key}'", where=where, fix=f"known keys: {', '.join(kinds)}")
        texts = list(value.values()) if isinstance(value, dict) and key != "targets" else []
        if not isinstance(value, kinds[key]) or not all(isinstance(text, str) for text in texts):
            kind = "a table of texts" if kinds[key] is dict else "a text"
            raise TableError(f"key '{key}' is not {kind}", where=where, fix="write texts between quotes")
        if value not in ALLOWED.get(key, (value,)):
            raise TableError(f"{key} = '{value}' is not known", where=where, fix=f"use one of {ALLOWED[key]}")
    inner = _mapping_from(data["targets"], where) if "targets" in data else None
    return Mapping(**{**data, "targets": inner})


def save_mapping(mapping: Mapping, path: str | Path) -> None:
    """Write answers so that `load_mapping` gives them back; the file appears whole or not at all.

    Args:
        mapping: the answers, for instance `table.understood.mapping`.
        path: where to.
    """
    document = tomlkit.document()
    document.add(tomlkit.comment("What the columns of such files hold and in which units; edit freely."))
    document.update(_plain(mapping))
    write_text(path, tomlkit.dumps(document))


def _plain(mapping: Mapping) -> dict[str, Any]:
    values = {entry.name: getattr(mapping, entry.name) for entry in fields(mapping)}
    if mapping.targets is not None:
        values["targets"] = _plain(mapping.targets)
    return {name: value for name, value in values.items() if value}


def answers_on_targets(mapping: Mapping, titles: Collection[str]) -> Mapping:
    """Answers on the file of the targets: those below [targets], and the others on titles that the readings lack.

    Args:
        mapping: all answers.
        titles: of the file of the readings.

    Returns:
        The answers, without those that call a column a reading.
    """
    own = mapping.targets or Mapping()
    read = {title for title, quantity in mapping.columns.items() if quantity.partition("_")[2][:4] in ("meas", "std")}
    columns, units = (
        {title: said for title, said in each.items() if title not in titles and title not in read}
        for each in (mapping.columns, mapping.units)
    )
    return replace(own, columns={**columns, **own.columns}, units={**units, **own.units})


def of_targets(error: TableError) -> TableError:
    """An error worded for the file of the targets, whose answers are under [targets]."""
    before, found, key = error.fix.partition(MAP)
    if not found:
        return error
    key = f"[targets.{key[1:]}" if key.startswith("[") else f"[targets] {key}"
    return TableError(error.what, where=error.where, fix=f"{before}{found}{key}")


def without_absent(understood: Understood, titles: Collection[str]) -> Understood:
    """An interpretation without the remark that these titles are absent: they belong to another file."""
    lines = []
    for line in understood.lines:
        if line.startswith(ABSENT):
            left = [title for title in line.removeprefix(ABSENT).split(", ") if title not in titles]
            line = f"{ABSENT}{', '.join(left)}" if left else ""
        lines.append(line)
    return replace(understood, lines=tuple(filter(None, lines)))


def answer(question: str, choices: Sequence[str], ask: Ask | None, where: str, key: str) -> str:
    """Ask what the file leaves open; if nobody can be asked, an error says how to answer.

    Args:
        question: what is open.
        choices: the possible answers.
        ask: who answers, or None.
        where: file and column.
        key: key of the mapping file that answers it.

    Returns:
        One of the choices.

    Raises:
        TableError: nobody to ask, or an answer that is no choice.
    """
    listed = ", ".join(f"'{choice}'" for choice in choices)
    if ask is None:
        raise TableError(question, where=where, fix=f"answer with {MAP}{key} = one of {listed}")
    given = ask(f"{where}: {question}", choices)
    if given not in choices:
        raise TableError(f"'{given}' does not answer: {question}", where=where, fix=f"choose one of {listed}")
    return given
