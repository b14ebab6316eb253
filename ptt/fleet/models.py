"""The models of a machine over time: which one applies to a run, and which runs wait again when a model changes.

Column `made` of the table of models: 'given' (the drawing), 'solved' (a diagnosis, or a recheck with new physics),
'refit' (the values of one run, for the record), 'accepted', and 'superseded TIME' (a solved one that was replaced).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ptt.fleet.database import insert, now, rows

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection as Connection

# Models that runs may be compared with.
HELD = """
SELECT models.run, models.toml FROM models JOIN runs USING (run)
WHERE models.machine = ? AND made IN ('solved', 'accepted') """
WHEN = "(runs.date, runs.place) {} (SELECT (date, place) FROM runs WHERE run = ?) "
# Processed runs after a run, up to and including the next one whose model was accepted.
LATER = (
    "SELECT run FROM outcomes JOIN runs USING (run) WHERE runs.machine = ? AND "
    + WHEN.format(">")
    + """AND (runs.date, runs.place) <= coalesce((
    SELECT min((next.date, next.place)) FROM models JOIN runs AS next USING (run)
    WHERE models.machine = ? AND made = 'accepted'
    AND (next.date, next.place) > (SELECT (date, place) FROM runs WHERE run = ?)), (runs.date, runs.place))"""
)
OF_RUN = ("outcomes", "checks", "diagnoses", "rechecks", "parameters", "fits")  # tables with results of runs


def drawing_of(connection: "Connection", machine: str) -> str:
    """Text of a machine's drawing, the machine.toml as it was given."""
    query = "SELECT toml FROM models WHERE machine = ? AND made = 'given'"
    return str(rows(connection, query, machine)[0]["toml"])


def model_at(connection: "Connection", machine: str, run: str) -> tuple[str, str] | None:
    """The model that a run is compared with: the latest from an earlier run, else the first later one, else its own.

    A model that was accepted from the run itself says nothing of a change before it. Of the models of one run, one that
    was accepted goes before what a recheck added.

    Args:
        connection: to the store.
        machine: its name.
        run: SHA-256 of the run.

    Returns:
        SHA-256 of the run that the model was fitted to, and text of its machine.toml; None where there is no model yet.
    """
    for side, order in ((WHEN.format("<"), "DESC"), (WHEN.format(">"), "ASC"), (WHEN.format("="), "ASC")):
        query = f"{HELD} AND {side} ORDER BY runs.date {order}, runs.place {order}, made LIMIT 1"
        if found := rows(connection, query, machine, run):
            return str(found[0]["run"]), str(found[0]["toml"])
    return None


def accept_model(connection: "Connection", machine: str, run: str, toml: str) -> list[str]:
    """Store a model as the machine's from a run on, and put later runs back into the queue.

    Args:
        connection: to the store.
        machine: its name.
        run: SHA-256 of the run that the model was fitted to.
        toml: text of the model.

    Returns:
        The later runs, up to the next whose model was accepted.
    """
    later = [str(row["run"]) for row in rows(connection, LATER, machine, run, machine, run)]
    insert(connection, "models", machine=machine, run=run, made="accepted", toml=toml, since=now())
    # Models that they made from the old one are kept, under a name that `HELD` does not find.
    past = f"superseded {now().isoformat()}"
    query = "UPDATE models SET made = ? WHERE made = 'solved' AND list_contains(?, run)"
    connection.execute(query, [past, later])
    forget_outcomes(connection, later)
    return later


def forget_run(connection: "Connection", machine: str, run: str) -> list[str]:
    """Remove a run with its results and models, and put runs that depend on its model back into the queue.

    Args:
        connection: to the store.
        machine: its name.
        run: SHA-256 of the run.

    Returns:
        The runs that are back in the queue: those compared with a model fitted to it and, if any, those after it up to
        the next whose model was accepted.
    """
    compared = "SELECT run FROM outcomes WHERE machine = ? AND did <> 'diagnosis'"  # which compares with no model
    others = [str(row["run"]) for row in rows(connection, compared, machine)]
    held = {other for other in others if (model_at(connection, machine, other) or ("", ""))[0] == run}
    if held:
        held |= {str(row["run"]) for row in rows(connection, LATER, machine, run, machine, run)}
    for table in (*OF_RUN, "models", "runs"):
        connection.execute(f"DELETE FROM {table} WHERE run = ?", [run])
    forget_outcomes(connection, sorted(held - {run}))
    return sorted(held - {run})


def forget_outcomes(connection: "Connection", runs: Sequence[str]) -> None:
    """Delete the results and models of runs, so that they wait to be processed again."""
    found = list(runs)
    for table in OF_RUN:
        connection.execute(f"DELETE FROM {table} WHERE list_contains(?, run)", [found])
    connection.execute("DELETE FROM models WHERE list_contains(?, run) AND made IN ('solved', 'refit')", [found])
