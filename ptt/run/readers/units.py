"""The unit of a column: stated by its title or the mapping, asked where neither does or both contradict each other."""

from collections import Counter

from ptt.run.readers.columns import (
    UNITS,
    UNSTATED_IS_ASKED,
    Column,
    Meaning,
    begun,
    canonical,
    dimension_of,
    of_axis,
    split_joint,
    standard_unit,
)
from ptt.run.readers.mapping import IGNORE, Ask, Mapping, answer
from ptt.run.readers.titles import is_newton, load_in_newtons, stated_unit, written_unit

FORCE_IS_NO_MASS = "a weight in newtons is not a mass: divide it by 9.81 m/s2 and call the column payload_kg"


def unit_beside(said: str, known: Meaning, title: str, where: str, ask: Ask | None) -> str | None:
    """Unit of a column that the mapping calls `payload` or `payload_kg`: the title says how its numbers are written.

    Args:
        said: what the mapping calls it.
        known: what that means.
        title: of the column.
        where: file, for messages.
        ask: who answers where title and mapping state two units.

    Returns:
        A key of `UNITS`, a word in brackets where it is no known unit, or None where neither states one.

    Raises:
        TableError: two units are stated, and there is nobody to ask.
    """
    named, own = known.unit if said != known.quantity else None, stated_unit(title)
    if named is None or own is None:
        return own if named is None else named
    if own == named or own.startswith("("):
        return named
    question = f"the title says '{written_unit(title)}' and the mapping '{said}'; which unit is it in?"
    return answer(question, list(UNITS[dimension_of(known.quantity)]), ask, f"{where}, column {title}", _key(title))


def with_begun(
    titles: tuple[str, ...], meanings: list[Meaning | None], mapping: Mapping, where: str, ask: Ask | None
) -> list[Meaning | None]:
    """`payload_st` and `Load [N]` are asked about: left unread, what a load does would be taken for something else.

    Not where another column holds it, nor where several begin alike: those are names (`temp_air`, `temp_oil`).

    Args:
        titles: one per column.
        meanings: what each says.
        mapping: answers given before.
        where: file, for messages.
        ask: who answers the rest.

    Returns:
        The meanings, with those that were answered.

    Raises:
        TableError: there is nobody to ask.
    """
    have = {meaning.quantity for meaning in meanings if meaning}
    said = [
        None if meaning or title in mapping.columns else begun(title) or load_in_newtons(title)
        for title, meaning in zip(titles, meanings, strict=True)
    ]
    counts = Counter(each[0] for each in said if each)
    asked = list(meanings)
    for index, (title, each) in enumerate(zip(titles, said, strict=True)):
        if each is None or each[0] in have or counts[each[0]] > 1:
            continue
        what = _misfit(*each) if is_newton(each[1]) else f"'{each[1]}' is not a known unit of {each[0]}"
        question = f"{what}; which unit is it in, or is it something else?"
        choices = [*(unit for unit in UNITS[dimension_of(each[0])] if unit != "stamp"), IGNORE]
        unit = mapping.units.get(title) or answer(question, choices, ask, f"{where}, column {title}", _key(title))
        asked[index] = None if unit == IGNORE else Meaning(each[0], unit, "unit as answered")
    return asked


def with_unit(index: int, title: str, meaning: Meaning | None, have: set[str], where: str, ask: Ask | None) -> Column:
    """A column in a known unit.

    Args:
        index: place in the row, from 0.
        title: as in the file.
        meaning: what it holds, None for a column that is kept aside.
        have: quantities of all columns.
        where: file, for messages.
        ask: who answers where the unit is not known.

    Returns:
        The column.

    Raises:
        TableError: the unit is not known, and there is nobody to ask.
    """
    if meaning is None or meaning.unit == IGNORE:
        return Column(index, title)
    dimension = dimension_of(meaning.quantity)
    known = UNITS[dimension]
    if meaning.unit is None and dimension in UNSTATED_IS_ASKED:
        return _asked(index, title, meaning, f"which unit is {meaning.quantity} in", have, where, ask)
    if meaning.unit is None and dimension == "time":
        return Column(index, title, meaning.quantity, "stamp")
    if meaning.unit is None:
        note = "no unit in the file" if standard_unit(meaning.quantity) else ""
        return Column(index, title, meaning.quantity, standard_unit(meaning.quantity), note)
    if meaning.unit in known:
        return Column(index, title, meaning.quantity, meaning.unit, meaning.note)
    if dimension in ("number", "text"):
        return Column(index, title, meaning.quantity, "")
    written = meaning.unit.strip("()") or written_unit(title)  # '' is all that is known without a scale, newtons too
    question = f"{_misfit(meaning.quantity, written)}; which unit is it in"
    if dimension == "effort":  # a share of what a motor can do, or a current
        question = f"{question}, or is it something else"
    return _asked(index, title, meaning, question, have, where, ask)


def _asked(
    index: int, title: str, meaning: Meaning, question: str, have: set[str], where: str, ask: Ask | None
) -> Column:
    """A column whose unit is asked for; an axis may turn or slide, where no other column is that slider."""
    choices, joint = list(UNITS[dimension_of(meaning.quantity)]), split_joint(meaning.quantity)
    if dimension_of(meaning.quantity) == "effort":
        choices = [*filter(None, choices), IGNORE]
    slider = f"b{joint[1]}_cmd" if joint and joint[0] == "q" else ""
    if slider and slider not in have and not canonical(title):
        choices, question = [*choices, "mm"], f"{question} ('mm': it is the slider {slider})"
    unit = answer(f"{question}?", choices, ask, f"{where}, column {title}", _key(title))
    if unit == IGNORE:
        return Column(index, title)
    return Column(index, title, of_axis(Meaning(meaning.quantity, unit)).quantity, unit, "unit as answered")


def _misfit(quantity: str, written: str) -> str:
    """What is wrong with a unit, in words."""
    force = dimension_of(quantity) == "mass" and is_newton(written)
    return f"unit '{written}' does not fit {quantity}" + (f"; {FORCE_IS_NO_MASS}" if force else "")


def _key(title: str) -> str:
    return f'[units] "{title}"'
