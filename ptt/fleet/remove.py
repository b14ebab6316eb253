"""A run is taken out of a store again: of another machine, or measured wrongly."""

from dataclasses import dataclass

from ptt.fleet.database import transaction
from ptt.fleet.models import forget_run
from ptt.fleet.queue import alone_with
from ptt.fleet.store import Store, shown
from ptt.fleet.which import which_run
from ptt.record import Record


@dataclass(frozen=True)
class Removed(Record):
    """A run that is no more in its store.

    Attributes:
        machine: its name.
        run: SHA-256.
        file: name of its file.
        date: when it was measured, ISO 8601.
        waiting: runs that were held against a model that this one made; they wait to be worked on once more.
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
    """Take a run out of a store, and all that came of it; adding its file again is as if it had never been there.

    Args:
        store: the store.
        machine: its name.
        which: the run: file name, date or beginning of its SHA-256.

    Returns:
        What was taken out.

    Raises:
        InputError: no such machine or run, or another process works on the machine.
    """
    run = which_run(store, machine, which)
    with alone_with(store, machine, "remove when it is done"), transaction(store.file) as connection:
        later = forget_run(connection, machine, run["run"])
    for kept in (run["kept"], run["readings"]):  # of whoever is killed before, no row names these any more
        (store.folder / kept).unlink(missing_ok=True)
    return Removed(machine, run["run"], run["file"], run["date"].isoformat(), len(later))
