"""The columns of a log as the readers of runs take them: by the titles of the file format, in the program's units."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from ptt.errors import InputError, TableError, shown
from ptt.machine import MachineFile
from ptt.run.readers import Export, Understood
from ptt.run.readers import Mapping as Answers
from ptt.run.readers.assemble import table_fields
from ptt.run.readers.columns import (
    UNITS,
    UNSTATED_IS_ASKED,
    Meaning,
    begun,
    canonical,
    dimension_of,
    standard_unit,
    to_standard,
)
from ptt.run.table import Table

STATED = (*UNSTATED_IS_ASKED, "time")  # a time without a unit may be a date, which a log does not hold


def meanings_of(titles: Iterable[str], where: str) -> dict[str, Meaning]:
    """What the columns of a log hold, each in a known unit.

    Args:
        titles: of all its columns.
        where: the log, for messages.

    Returns:
        Title -> quantity and unit; without titles that are not of the file format.

    Raises:
        InputError: a quantity in no known unit, or in two columns: left out unseen, it would be missed in the fit.
    """
    found = {title: meaning for title in titles if (meaning := canonical(title)) is not None}
    found = {title: _in_unit(title, meaning, where) for title, meaning in found.items()}
    held = {meaning.quantity: title for title, meaning in found.items()}
    for title, meaning in found.items():
        if held[meaning.quantity] != title:
            what = f"columns {shown(title)} and {shown(held[meaning.quantity])} hold the same"
            raise InputError(what, where=where, fix="remove or rename one")
    like = {title: start for title in titles if title not in found and (start := begun(title)) is not None}
    counts = Counter(quantity for quantity, _ in like.values())
    for title, (quantity, unit) in like.items():  # several that begin alike are names, as of a run (`temp_air`)
        if quantity not in held and counts[quantity] == 1:
            what = f"'{shown(unit)}' is not a known unit of {quantity}"
            raise InputError(what, where=f"{where}, column {shown(title)}", fix=_units_of(quantity))
    return found


def _in_unit(title: str, meaning: Meaning, where: str) -> Meaning:
    if meaning.unit is None and dimension_of(meaning.quantity) in STATED:
        raise InputError("its title states no unit", where=f"{where}, column {title}", fix=_units_of(meaning.quantity))
    return replace(meaning, unit=meaning.unit or standard_unit(meaning.quantity))


def _units_of(quantity: str) -> str:
    units = [unit for unit in UNITS[dimension_of(quantity)] if unit != "stamp"]
    return f"name it {' or '.join(f'{quantity}_{unit}' for unit in units)}"


def log_table(machine: MachineFile, columns: Mapping[str, np.ndarray], line: np.ndarray, name: str) -> Table:
    """Some rows of a log as a table, checked as the rows of a run are.

    Args:
        machine: the machine, which says which joints there are.
        columns: title -> (n,), texts or numbers.
        line: (n,) int, line numbers.
        name: of the log's file, for messages.

    Returns:
        The table; its `understood` has what a run of these rows would be warned of.

    Raises:
        InputError: a column is missing or not known, or a value is not allowed.
    """
    meanings = meanings_of(columns, name)
    held = {each.quantity: _as_held(columns[title], each) for title, each in meanings.items()}
    # so that messages name titles
    answers = Answers(columns={title: each.quantity for title, each in meanings.items()})
    joints, letter = machine.machine.joints, machine.machine.letter
    export = Export(name, held, {}, line, Understood(mapping=answers))
    try:
        fields, lines = table_fields(export, joints, letter, "run")
    except TableError as error:
        if "--map" not in error.fix:
            raise
        fix = "give the column its title, see docs/files.md"  # `ptt fleet fit` has no --map
        raise InputError(error.what, where=error.where, fix=fix) from None
    digests = ("",) * len(fields["run_label"])
    return Table(**fields, joint_prefix=letter, understood=Understood(lines=tuple(lines)), run_sha256=digests)


def _as_held(values: np.ndarray, meaning: Meaning) -> np.ndarray:
    """A column in the program's unit, or as text; DuckDB gives one whose cells are all empty as texts."""
    if dimension_of(meaning.quantity) == "text":
        return values.astype(str)
    numbers = np.where(values == "", "nan", values) if values.dtype.kind == "U" else values
    return to_standard(numbers.astype(float), meaning.quantity, str(meaning.unit))
