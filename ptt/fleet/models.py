"""The models of a machine over time: which one held when, and which runs have to be held against another."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ptt.fleet.database import insert, now, rows

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection as Connection

HELD = """
SELECT models.run, models.toml FROM models JOIN runs USING (run)
WHERE models.machine = ? AND made IN ('solved', 'accepted') """
WHEN = "(runs.date, runs.place) {} (SELECT (date, place) FROM runs WHERE run = ?) "
LATER = (
    "SELECT run FROM outcomes JOIN runs USING (run) WHERE runs.machine = ? AND "
    + WHEN.format(">")
    + """AND (runs.date, runs.place) <= coalesce((
    SELECT min((next.date, next.place)) FROM models JOIN runs AS next USING (run)
    WHERE models.machine = ? AND made = 'accepted'
    AND (next.date, next.place) > (SELECT (date, place) FROM runs WHERE run = ?)), (runs.date, runs.place))"""
)
OF_RUN = ("outcomes", "checks", "diagnoses", "rechecks", "parameters", "fits")


def drawing_of(connection: "Connection", machine: str) -> str:
    """The machine.toml as it was given."""
    query = "SELECT toml FROM models WHERE machine = ? AND made = 'given'"
    return str(rows(connection, query, machine)[0]["toml"])


def model_at(connection: "Connection", machine: str, run: str) -> tuple[str, str] | None:
    """The model that a run is held against: the machine's when it was measured, else the first that there is.

    Args:
        connection: to the store.
        machine: its name.
        run: SHA-256.

    Returns:
        The run that made it, and the machine.toml; None where no run was worked on yet.
    """
    for side, order in ((WHEN.format("<="), "DESC"), (WHEN.format(">"), "ASC")):
        query = f"{HELD} AND {side} ORDER BY runs.date {order}, runs.place {order} LIMIT 1"
        if found := rows(connection, query, machine, run):
            return str(found[0]["run"]), str(found[0]["toml"])
    return None


def accept_model(connection: "Connection", machine: str, run: str, toml: str) -> list[str]:
    """Take a model as the machine's from a run on.

    Args:
        connection: to the store.
        machine: its name.
        run: SHA-256 of the run that it was fitted to.
        toml: the model.

    Returns:
        Later runs, up to the next whose model was accepted: they wait to be held against it.
    """
    later = [str(row["run"]) for row in rows(connection, LATER, machine, run, machine, run)]
    insert(connection, "models", machine=machine, run=run, made="accepted", toml=toml, since=now())
    # What they added to the old model is kept, under a name that no run is held against.
    past = f"superseded {now().isoformat()}"
    query = "UPDATE models SET made = ? WHERE made = 'solved' AND list_contains(?, run)"
    connection.execute(query, [past, later])
    let_wait(connection, later)
    return later


def forget_run(connection: "Connection", machine: str, run: str) -> list[str]:
    """Take a run out, with all that came of it.

    Args:
        connection: to the store.
        machine: its name.
        run: SHA-256.

    Returns:
        Other runs that were held against a model that it made, or follow one: they wait to be worked on once more.
    """
    others = [str(row["run"]) for row in rows(connection, "SELECT run FROM outcomes WHERE machine = ?", machine)]
    held = {other for other in others if (model_at(connection, machine, other) or ("", ""))[0] == run}
    if held:
        held |= {str(row["run"]) for row in rows(connection, LATER, machine, run, machine, run)}
    for table in (*OF_RUN, "models", "runs"):
        connection.execute(f"DELETE FROM {table} WHERE run = ?", [run])
    let_wait(connection, sorted(held - {run}))
    return sorted(held - {run})


def let_wait(connection: "Connection", runs: Sequence[str]) -> None:
    """Forget what came of runs, so that they are worked on once more."""
    found = list(runs)
    for table in OF_RUN:
        connection.execute(f"DELETE FROM {table} WHERE list_contains(?, run)", [found])
    connection.execute("DELETE FROM models WHERE list_contains(?, run) AND made IN ('solved', 'refit')", [found])
