"""Meaning of a file's columns: from titles, from their order in files without titles, from saved answers."""

import re
from collections import Counter

from ptt.errors import TableError
from ptt.run.readers.columns import Column, Meaning, canonical, of_axis
from ptt.run.readers.mapping import IGNORE, Ask, Mapping, answer
from ptt.run.readers.separators import is_number, split_line
from ptt.run.readers.series import counted_from_zero, settle_likely
from ptt.run.readers.text import RawText
from ptt.run.readers.titles import DRIVER_NOTE, is_polar, meaning_of
from ptt.run.readers.units import unit_beside, with_begun, with_unit

GOALS = ("x_cmd", "y_cmd", "z_cmd")
_PREDICTED = re.compile(r"reversal1|in_domain|shift_um|sigma_um|q\d+_cmd_rad")  # of `ptt predict`: q1 is in rad too


def understand(
    titles: tuple[str, ...],
    meanings: list[Meaning | None],
    purpose: str,
    where: str,
    mapping: Mapping,
    ask: Ask | None,
    joints: int | None = None,
    letter: str = "b",
) -> list[Column]:
    """Decide for every column what it holds.

    Args:
        titles: one per column.
        meanings: what each title says by itself.
        purpose: 'run', 'targets', 'sliders' or 'beside'; decides what a bare x, y, z or b1 is.
        where: file, for messages.
        mapping: answers that override the titles.
        ask: answers open questions.
        joints: number k of joints of the machine; None where it is not known.
        letter: 'b' or 'q' of its joints.

    Returns:
        One entry per column.

    Raises:
        TableError: two columns for one quantity, an unknown unit, or an open question and nobody to ask.
    """
    meanings = [_mapped(title, meaning, mapping, where, ask) for title, meaning in zip(titles, meanings, strict=True)]
    meanings = settle_likely(meanings, joints, letter)
    radians = purpose == "sliders" or any(map(_PREDICTED.fullmatch, titles))
    if purpose == "beside":  # the readings belong to the commands sent, b1, not to the drawing's b1_cmd
        purpose = "sliders"
    meanings = with_begun(titles, meanings, mapping, where, ask)
    meanings = _settle_bare(meanings, purpose, where, ask, radians)
    meanings = _settle_double(titles, meanings, where, ask)
    have = {meaning.quantity for meaning in meanings if meaning}
    return [
        with_unit(index, title, meaning, have, where, ask)
        for index, (title, meaning) in enumerate(zip(titles, meanings, strict=True))
    ]


def meanings_of_titles(titles: tuple[str, ...], where: str) -> list[Meaning | None]:
    """What each title says; polar coordinates are refused."""
    meanings = _with_driver_units(counted_from_zero(titles, [meaning_of(title) for title in titles]))
    sure = [meaning.quantity[:1] for meaning in meanings if meaning and not meaning.likely]
    found = {letter for letter in sure if letter in ("x", "y", "z", "b")}
    polar = [title for title in titles if is_polar(title)]
    if len(polar) >= 2 and not {"x", "y"} <= found and "b" not in found:
        refuse_polar(where, f"columns {', '.join(polar)}")
    return meanings


def _with_driver_units(meanings: list[Meaning | None]) -> list[Meaning | None]:
    """Beside joints named by a ROS driver a goal without unit is in metres too (REP 103: SI units throughout)."""
    if not any(meaning and meaning.note == DRIVER_NOTE for meaning in meanings):
        return meanings
    goals = [meaning and meaning.quantity in GOALS and meaning.unit is None for meaning in meanings]
    return [
        Meaning(meaning.quantity, "m", DRIVER_NOTE) if meaning and goal else meaning
        for meaning, goal in zip(meanings, goals, strict=True)
    ]


def refuse_polar(where: str, evidence: str) -> None:
    """Raise: polar, spherical and cylindrical coordinates are not read as x, y, z."""
    raise TableError(
        f"coordinates are polar or cylindrical ({evidence})", where=where, fix="export Cartesian x, y, z in mm"
    )


def meanings_by_order(raw: RawText) -> list[Meaning | None]:
    """Meanings of the columns of a file without titles where they are unambiguous: x y z, or id x y z.

    Raises:
        TableError: any other number of columns.
    """
    rows = [split_line(line, raw.delimiter) for line in raw.body[:200]]
    width = max(len(row) for row in rows)
    xyz: list[Meaning | None] = [Meaning(axis, None) for axis in "xyz"]
    if width == 3:
        return xyz
    first = [row[0] for row in rows]
    counted = all(re.fullmatch(r"\d+", cell) for cell in first) and len(set(first)) == len(first)
    if width == 4 and (counted or not any(is_number(cell, raw.delimiter) for cell in first)):
        return [Meaning("name", ""), *xyz]
    return [None] * width


def _mapped(title: str, meaning: Meaning | None, mapping: Mapping, where: str, ask: Ask | None) -> Meaning | None:
    unit = mapping.units.get(title)
    if title not in mapping.columns:
        return of_axis(Meaning(meaning.quantity, unit)) if meaning and unit is not None else meaning
    said = mapping.columns[title]
    if said == IGNORE:
        return None
    known = canonical(said)
    if known is None:
        raise TableError(
            f"the mapping gives column '{title}' the unknown meaning '{said}'",
            where=where,
            fix=f"use a column of the tracker CSV such as x_meas, or '{IGNORE}'",
        )
    if unit is None:
        unit = unit_beside(said, known, title, where, ask)
    return of_axis(Meaning(known.quantity, unit if unit is not None else meaning.unit if meaning else known.unit))


def _settle_bare(
    meanings: list[Meaning | None], purpose: str, where: str, ask: Ask | None, radians: bool
) -> list[Meaning | None]:
    """Bare x, y, z and b1 or q1 get the role (command or reading) implied by the purpose and the other columns."""
    have = {meaning.quantity for meaning in meanings if meaning}
    role = "meas" if purpose == "run" else "cmd"
    if purpose == "run" and "x_meas" in have:
        role = "cmd"
    sent = _bare_joints_are_commands(have, purpose, where, ask)
    unit = "rad" if radians and purpose == "sliders" else None
    return [_settled(meaning, have, role, sent, unit) for meaning in meanings]


def _bare_joints_are_commands(have: set[str], purpose: str, where: str, ask: Ask | None) -> bool:
    bare = [quantity for quantity in have if quantity.endswith("_bare")]
    if not bare or purpose == "targets":
        return bool(bare) and not {"x_cmd", "x"} & have
    named = {quantity.replace("_bare", "_cmd") for quantity in bare} & have
    if purpose == "sliders" or not named:
        return True
    question = "which columns were sent to the machine?"
    choices = ("the columns with _cmd", "the columns without")
    return answer(question, choices, ask, f"{where}, columns {', '.join(sorted(named))}", "[columns]") == choices[1]


def _settled(meaning: Meaning | None, have: set[str], role: str, sent: bool, angle: str | None) -> Meaning | None:
    if meaning is None:
        return None
    if meaning.quantity in ("x", "y", "z"):
        quantity = f"{meaning.quantity}_{role}"
        return None if quantity in have else Meaning(quantity, meaning.unit)
    if meaning.quantity.endswith("_bare"):
        unit = angle if meaning.unit is None and meaning.quantity[0] == "q" else meaning.unit
        return Meaning(meaning.quantity.replace("_bare", "_cmd"), unit) if sent else None
    replaced = meaning.quantity.replace("_cmd", "_bare")
    return None if sent and replaced != meaning.quantity and replaced in have else meaning


def _settle_double(
    titles: tuple[str, ...], meanings: list[Meaning | None], where: str, ask: Ask | None
) -> list[Meaning | None]:
    """One column per quantity: the one with the file format's own name, else the user's choice."""
    counts = Counter(meaning.quantity for meaning in meanings if meaning)
    settled = list(meanings)
    for quantity in [quantity for quantity, count in counts.items() if count > 1]:
        places = [i for i, meaning in enumerate(meanings) if meaning and meaning.quantity == quantity]
        named = [i for i in places if canonical(titles[i])]
        if len(named) > 1 or len({titles[i] for i in places}) < len(places):
            raise TableError(f"column {titles[places[0]]} appears twice", where=where, fix="remove or rename one")
        chosen = (
            named[0]
            if named
            else titles.index(
                answer(f"which column is {quantity}?", [titles[i] for i in places], ask, where, "[columns]")
            )
        )
        settled = [None if i in places and i != chosen else meaning for i, meaning in enumerate(settled)]
    return settled
