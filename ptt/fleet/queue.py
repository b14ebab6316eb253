"""The queue of runs: which wait, which process has claimed a machine, and storing outcomes; each in one transaction."""

import json
import platform
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from ptt.errors import InputError
from ptt.fleet.database import insert, now, rows, transaction
from ptt.fleet.models import drawing_of, forget_outcomes, model_at
from ptt.fleet.owner import alive, owner
from ptt.fleet.readings import read_columns
from ptt.fleet.store import Store, shown
from ptt.fleet.task import Outcome, Task
from ptt.record import plain

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection as Connection

WAITING = """
SELECT runs.machine, min(runs.date) AS first, count(*) AS runs FROM runs LEFT JOIN outcomes USING (run)
WHERE outcomes.run IS NULL GROUP BY runs.machine ORDER BY first, runs.machine"""
NEXT = """
SELECT runs.* FROM runs LEFT JOIN outcomes USING (run)
WHERE outcomes.run IS NULL AND runs.machine = ? AND NOT list_contains(?, runs.run) ORDER BY date, place LIMIT 1"""


def waiting(store: Store) -> dict[str, int]:
    """Machine -> how many of its runs wait, the machine with the oldest waiting run first."""
    return {row["machine"]: int(row["runs"]) for row in store.ask(WAITING)}


def claim(store: Store, owner: str, besides: Collection[str] = ()) -> str | None:
    """Claim a machine with waiting runs: no other process works on it until it is released or this process ends.

    A machine's runs are processed one after the other, because the first makes the model for the others.

    Args:
        store: the store.
        owner: name of this process, from `ptt.fleet.owner.owner`.
        besides: machines to pass over: all their waiting runs were given up for now.

    Returns:
        The machine; None where every machine with waiting runs is claimed or passed over.
    """
    with transaction(store.file) as connection:
        machines = [str(row["machine"]) for row in rows(connection, WAITING)]
        wanted = (machine for machine in machines if machine not in besides)
        return next((machine for machine in wanted if _take(store, connection, owner, machine)), None)


@contextmanager
def alone_with(store: Store, machine: str, then: str) -> Iterator[None]:
    """Claim one machine while the body runs, whether runs of it wait or not.

    Args:
        store: the store.
        machine: its name.
        then: the way out that the error message gives.

    Raises:
        InputError: another process has claimed it.
    """
    with owner(store.workers) as name:
        with transaction(store.file) as connection:
            taken = _take(store, connection, name, machine)
        if not taken:
            what = f"another `ptt fleet run` is working on '{shown(machine)}'"
            raise InputError(what, where=str(store.folder), fix=then)
        try:
            yield
        finally:
            release(store, name)


def _take(store: Store, connection: "Connection", owner: str, machine: str) -> bool:
    """Claim a machine; False where a living process, this one included, has claimed it already."""
    taken = rows(connection, "SELECT owner FROM claims WHERE machine = ?", machine)
    if taken and (taken[0]["owner"] == owner or alive(store.workers, taken[0]["owner"])):
        return False
    connection.execute("DELETE FROM claims WHERE machine = ?", [machine])
    insert(connection, "claims", machine=machine, owner=owner, since=now())
    return True


def release(store: Store, owner: str, machine: str | None = None) -> None:
    """Release a machine that a process has claimed; None for all of them."""
    with transaction(store.file) as connection:
        query = "DELETE FROM claims WHERE owner = ?"
        connection.execute(*((query, [owner]) if machine is None else (f"{query} AND machine = ?", [owner, machine])))


def next_task(store: Store, machine: str, besides: Sequence[str] = ()) -> Task | Outcome | None:
    """The oldest waiting run of a machine, with its readings and the model that it is compared with.

    Args:
        store: the store.
        machine: its name.
        besides: runs to pass over: they were given up for now.

    Returns:
        The task, or the outcome 'failed' where its readings cannot be read, which must not stop the other runs; None
        where none waits.
    """
    with transaction(store.file, read_only=True) as connection:
        found = rows(connection, NEXT, machine, list(besides))
        if not found:
            return None
        drawing, held = drawing_of(connection, machine), model_at(connection, machine, found[0]["run"])
    try:
        return task_of(store, found[0], drawing, None if held is None else held[1])
    except InputError as error:
        return Outcome(found[0]["run"], machine, "nothing", "failed", str(error), 0.0)


def task_of(store: Store, run: Mapping[str, Any], drawing: str, solved: str | None) -> Task:
    """The task for a run: its row of the table of runs, the drawing, and the model to compare with (both as TOML).

    Raises:
        InputError: its readings are gone or damaged.
    """
    columns = read_columns(store.folder / run["readings"])
    return Task(
        run["run"], run["machine"], run["date"].isoformat(), run["file"], columns, drawing, solved, run["ordered"],
        run["units_said"],
    )  # fmt: skip


def keep_outcome(store: Store, outcome: Outcome) -> bool:
    """Store the outcome of a run with its results, models and parameter values, all or nothing.

    Args:
        store: the store.
        outcome: the outcome.

    Returns:
        False where the run has an outcome already; nothing is stored then.
    """
    with transaction(store.file) as connection:
        if rows(connection, "SELECT 1 FROM outcomes WHERE run = ?", outcome.run):
            return False
        program = _program(connection)
        insert(
            connection, "outcomes", run=outcome.run, machine=outcome.machine, did=outcome.did, verdict=outcome.verdict,
            error_um=plain(outcome.error_um), expected_um=plain(outcome.expected_um),
            noise_um=plain(outcome.noise_um), words=outcome.words, seconds=outcome.seconds, program=program,
            finished=now(),
        )  # fmt: skip
        _keep_results(connection, outcome)
        _keep_models(connection, outcome)
        _keep_told(connection, outcome)
    return True


def requeue_failed(store: Store) -> int:
    """Put all runs with the verdict 'failed' back into the queue.

    Returns:
        How many.
    """
    with transaction(store.file) as connection:
        found = [row["run"] for row in rows(connection, "SELECT run FROM outcomes WHERE verdict = 'failed'")]
        forget_outcomes(connection, found)
    return len(found)


def _keep_results(connection: "Connection", outcome: Outcome) -> None:
    if outcome.check is not None:
        insert(connection, "checks", run=outcome.run, ok=outcome.check["ok"], result=_json(outcome.check))
    for table, result in (("diagnoses", outcome.diagnosis), ("rechecks", outcome.recheck)):
        if result is not None:
            insert(connection, table, run=outcome.run, verdict=outcome.verdict, result=_json(result))


def _keep_models(connection: "Connection", outcome: Outcome) -> None:
    for made, text in (("solved", outcome.solved), ("refit", outcome.refit)):
        if text is not None:
            insert(connection, "models", machine=outcome.machine, run=outcome.run, made=made, toml=text, since=now())


def _keep_told(connection: "Connection", outcome: Outcome) -> None:
    told = outcome.told
    if told is None:
        return
    insert(
        connection, "fits", run=outcome.run, names=list(told.names), labels=list(told.labels), units=list(told.units),
        usual=told.usual.tolist(), information=told.information.ravel().tolist(), score=told.score.tolist(),
    )  # fmt: skip
    for place, name in enumerate(told.names):
        effect, _, parameter = name.partition(" ")
        insert(
            connection, "parameters", run=outcome.run, machine=outcome.machine, effect=effect, parameter=parameter,
            label=told.labels[place], unit=told.units[place], value=float(told.values[place]),
            std=plain(float(told.std[place])), usual=float(told.usual[place]),
        )  # fmt: skip


def _program(connection: "Connection") -> str:
    """Versions of this program and its packages in one line: the key of its row in the table of programs."""
    own = {name: _version(name) for name in ("ptt", "torch", "numpy", "scipy")}
    name = " ".join(f"{key} {value}" for key, value in (*own.items(), ("python", platform.python_version())))
    if not rows(connection, "SELECT 1 FROM programs WHERE program = ?", name):
        insert(
            connection, "programs", program=name, version=own["ptt"], python=platform.python_version(),
            torch=own["torch"], numpy=own["numpy"], scipy=own["scipy"],
        )  # fmt: skip
    return name


@cache
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def _json(value: Any) -> str:
    return json.dumps(plain(value), allow_nan=False)
