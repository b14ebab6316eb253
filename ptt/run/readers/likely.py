"""Unrecognised columns that may be the commands: the user is asked about them where a run has none."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ptt.errors import TableError
from ptt.run.readers.columns import UNITS, split_joint, to_standard
from ptt.run.readers.export import Export, Request, read_any
from ptt.run.readers.mapping import answer
from ptt.run.readers.titles import meaning_of, stated_unit

Ends = Sequence[tuple[float, float]]
"""Least and greatest command of each joint, mm or rad; infinite where there is none."""

BEYOND = 0.25  # of the travel: commands may exceed it by so much, for a drawing may state too little
LEAST_STROKE = 0.01  # of the travel: a column with a smaller range is no command of a run
LEAST_MOVE = {"b": 1.0, "q": 0.01}  # mm, rad: least range where no travel is known
TURN = 2.0 * np.pi  # rad: larger values are degrees
NONE = "none of them"


def has_commands(export: Export | None) -> bool:
    """Whether a file holds a command of any joint."""
    return export is not None and any(map(split_joint, export.columns))


def with_likely(path: str | Path, export: Export, request: Request, ends: Ends | None) -> Export:
    """A file with the columns that the user names as its commands.

    Without commands those of the drawing are taken to have been sent; columns in another spelling would be dropped, and
    whatever the machine was told to correct would be taken for its errors.

    Args:
        path: the file.
        export: what was read of it, without commands.
        request: how; its machine is known.
        ends: of the joints; None where they are not known.

    Returns:
        The columns, read anew where a person said so.

    Raises:
        TableError: there are such columns, and there is nobody to ask.
    """
    found = likely_commands(export, request, ends)
    if not found:
        return export
    chosen = _asked(found, export.source, request)
    if not chosen:
        return export
    known = export.understood.mapping
    columns = {**request.mapping.columns, **known.columns, **chosen}
    mapping = replace(request.mapping, columns=columns, units={**request.mapping.units, **known.units})
    return read_any(path, replace(request, mapping=mapping))


def likely_commands(export: Export, request: Request, ends: Ends | None) -> list[dict[str, str]]:
    """Columns in a unit of the joints that were not read, one for each joint, with values that could be sent.

    Args:
        export: the columns.
        request: known answers, and the machine.
        ends: of the joints; None where they are not known.

    Returns:
        Title -> quantity, for each set of columns.
    """
    series: dict[tuple[str, str], dict[int, str]] = {}
    for title in export.extra:
        if title not in request.mapping.columns:
            for number in re.finditer(r"\d+", title):
                around = title[: number.start()], title[number.end() :]
                series.setdefault(around, {})[int(number[0])] = title
    count = request.joints or 0
    whole = [
        [titles[number] for number in sorted(titles)]
        for titles in series.values()
        if sorted(titles) in (list(range(1, count + 1)), list(range(count)))
    ]
    return [
        {title: f"{request.letter}{joint}_cmd" for joint, title in enumerate(titles, 1)}
        for titles in whole
        if count and all(_could_be_sent(title, request.letter) for title in titles)
        if _moves(export, titles, request.letter, ends)
    ]


def _could_be_sent(title: str, letter: str) -> bool:
    """Whether a title has a unit of the joints, or none and a word for what drives one."""
    unit, own = stated_unit(title), "length" if letter == "b" else "angle"
    if unit is not None:
        return unit in UNITS[own]
    said = meaning_of(f"{title} [{next(iter(UNITS[own]))}]")
    return said is not None and said.likely and split_joint(said.quantity) is not None


def _moves(export: Export, titles: list[str], letter: str, ends: Ends | None) -> bool:
    """Whether numbers lie within the travel of the joints, roughly, and cover some of it."""
    columns = [_numbers(export, title, letter) for title in titles]
    if not all(values is not None and values.size for values in columns):
        return False
    low, high = (np.array([part(values) for values in columns if values is not None]) for part in (np.min, np.max))
    least, most = np.transpose(ends) if ends is not None else np.full((2, len(titles)), [[-np.inf], [np.inf]])
    travel = np.where(np.isfinite(most - least), most - least, LEAST_MOVE[letter] / LEAST_STROKE)
    if ends is None and letter == "b" and low.min() < 0.0 < high.max():  # differences, not heights
        return False
    within = (low >= least - BEYOND * travel) & (high <= most + BEYOND * travel)
    return bool(within.all() and (high - low >= LEAST_STROKE * travel).any())


def _numbers(export: Export, title: str, letter: str) -> np.ndarray | None:
    """The cells with something in them, (m,) mm or rad; None where one is no number."""
    decimal = export.understood.mapping.decimal or "."
    try:
        values = np.array([float(cell.replace(decimal, ".")) for cell in export.extra[title].tolist() if cell])
    except ValueError:
        return None
    unit = stated_unit(title) or ("mm" if letter == "b" else "deg" if np.abs(values).max(initial=0.0) > TURN else "rad")
    values = to_standard(values, f"{letter}1_cmd", unit)
    return values if np.isfinite(values).all() else None


def _asked(found: list[dict[str, str]], where: str, request: Request) -> dict[str, str]:
    listed = [", ".join(columns) for columns in found]
    noun = "sliders" if request.letter == "b" else "joints"
    question = f"no command of the machine is understood; which columns hold those of its {noun} 1 to {request.joints}?"
    if request.ask is None:
        lines = ", ".join(
            f'{json.dumps(title, ensure_ascii=False)} = "{quantity}"' for title, quantity in found[0].items()
        )
        more = f", or of {' or '.join(listed[1:])}" if len(listed) > 1 else ""
        raise TableError(
            f"no command of the machine is understood; are {listed[0]}{more} those of its {noun}?",
            where=where,
            fix=f'answer with --map FILE.toml, columns = {{ {lines} }}, or "ignore" in place of each if they are not',
        )
    chosen = answer(question, (*listed, NONE), request.ask, where, "[columns]")
    return {} if chosen == NONE else found[listed.index(chosen)]
