"""Removing a run from a store, such as one of another machine or one that was measured wrongly."""

from dataclasses import dataclass
from typing import Any

from ptt.fleet.database import rows, transaction
from ptt.fleet.models import forget_run
from ptt.fleet.queue import alone_with
from ptt.fleet.store import Store, shown
from ptt.fleet.which import which_run
from ptt.record import Record


@dataclass(frozen=True)
class Removed(Record):
    """A run that was removed from its store.

    Attributes:
        machine: its name.
        run: SHA-256.
        file: name of its file.
        date: when it was measured, ISO 8601.
        waiting: number of runs that were compared with a model made from this one; they wait to be processed again.
    """

    machine: str
    run: str
    file: str
    date: str
    waiting: int

    def __str__(self) -> str:
        """A line or two."""
        line = f"{shown(self.machine)}: the run of {self.date[:10]} ({shown(self.file)}) is removed"
        again = f"{self.waiting} run{'s' if self.waiting > 1 else ''} rechecked against its model to be processed again"
        return f"{line}\n{again}: ptt fleet run" if self.waiting else line


def remove(store: Store, machine: str, which: str) -> Removed:
    """Remove a run and all its results from a store; its file can be added again as a new run.

    Args:
        store: the store.
        machine: its name.
        which: the run: file name, date or beginning of its SHA-256.

    Returns:
        The run that was removed.

    Raises:
        InputError: no such machine or run, or another process works on the machine.
    """
    run = which_run(store, machine, which)
    with alone_with(store, machine, "remove when it is done"):
        with transaction(store.file) as connection:
            later = forget_run(connection, machine, run["run"])
        _drop_files(store, run)  # last: a process killed before this leaves files that no row names
    return Removed(machine, run["run"], run["file"], run["date"].isoformat(), len(later))


def _drop_files(store: Store, run: dict[str, Any]) -> None:
    """Delete a run's files unless it was added again meanwhile; nobody adds runs while the transaction lasts."""
    with transaction(store.file) as connection:
        for column in ("kept", "readings"):
            if not rows(connection, f"SELECT 1 FROM runs WHERE {column} = ?", run[column]):
                (store.folder / run[column]).unlink(missing_ok=True)
