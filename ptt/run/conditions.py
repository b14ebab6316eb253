"""The conditions of a run as every path takes them: cells that are empty, and temperatures that a display rounds."""

from ptt.run.blanks import fill_blanks
from ptt.run.display import between_steps
from ptt.run.table import Table


def settle_conditions(table: Table) -> tuple[Table, list[str]]:
    """Fill empty cells of a run's conditions, then interpolate its temperature between the steps of a display.

    Args:
        table: n rows in travel order, as they were read.

    Returns:
        The table, and a line on each thing that was done.
    """
    table, blanks = fill_blanks(table)
    table, steps = between_steps(table)
    return table, [*blanks, *steps]
