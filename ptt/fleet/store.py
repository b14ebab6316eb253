"""A fleet's store: one folder with a DuckDB file, the run files unchanged, and their readings as Parquet."""

import hashlib
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from ptt.correct.training.machine_of import machine_of as read_drawing
from ptt.errors import InputError
from ptt.files import neighbour, sha256, sweep, write_parts
from ptt.fleet.database import duckdb, insert, now, rows, transaction
from ptt.fleet.readings import write_readings
from ptt.fleet.schema import TABLES, VERSION
from ptt.machine import MachineFile, format_machine, parse_machine
from ptt.run.dates import date_in_name
from ptt.run.table import Table

FILE = "fleet.duckdb"
SECTIONS = {  # of a machine file, which decide what its runs are compared with -> attribute of `MachineFile`
    "[machine]": "machine", "[[effect]]": "effect", "[tracker]": "tracker", "[controller]": "controller",
    "[targets]": "targets",
}  # fmt: skip
PART = 2**20  # bytes of a run that are copied at a time


@dataclass(frozen=True)
class Added:
    """The result of adding one file.

    Attributes:
        file: its name.
        run: its SHA-256.
        rows: number of rows of the run.
        date: when it was measured, and how that is known, in words.
        new: whether the store did not hold it before.
    """

    file: str
    run: str
    rows: int
    date: str
    new: bool


@dataclass(frozen=True)
class Store:
    """A store on disk.

    Attributes:
        folder: where it lies.
    """

    folder: Path

    @property
    def file(self) -> Path:
        """The DuckDB file."""
        return self.folder / FILE

    @property
    def workers(self) -> Path:
        """Folder of lock files of the processes that work on the store (`ptt.fleet.owner`)."""
        return self.folder / "working"

    def ask(self, query: str, *values: Any) -> list[dict[str, Any]]:
        """The rows that a query returns, each as column -> value, in a transaction of its own."""
        with transaction(self.file, read_only=True) as connection:
            return rows(connection, query, *values)


def create_store(folder: str | Path) -> Store:
    """Make an empty store.

    Args:
        folder: a new or empty folder.

    Returns:
        The store.

    Raises:
        InputError: a store or other files are there, or duckdb is missing.
    """
    store, place = Store(Path(folder)), Path(folder)
    duckdb()
    if store.file.exists():
        raise InputError("is already a fleet's store", where=str(folder), fix="use it, or name another folder")
    if place.is_dir():
        sweep(store.file)  # remains of a creation that was interrupted
    if place.exists() and (not place.is_dir() or any(place.iterdir())):
        raise InputError("is not an empty folder", where=str(folder), fix="name a new folder")
    place.mkdir(parents=True, exist_ok=True)
    part = neighbour(store.file)
    with transaction(part) as connection:
        connection.execute(TABLES)
        insert(connection, "about", key="version", value=VERSION)
        insert(connection, "about", key="created", value=now().isoformat(timespec="seconds"))
    part.replace(store.file)
    return store


def open_store(folder: str | Path) -> Store:
    """Open a store.

    Args:
        folder: where it lies.

    Returns:
        The store.

    Raises:
        InputError: none is there, or one of a later program.
    """
    store = Store(Path(folder))
    if not store.file.is_file():
        raise InputError("holds no fleet's store", where=str(folder), fix=f"make one: ptt fleet init {folder}")
    version = store.ask("SELECT value FROM about WHERE key = 'version'")
    if not version or version[0]["value"] != VERSION:
        found = version[0]["value"] if version else "none"
        raise InputError(f"has version {found}, this program reads {VERSION}", where=str(store.file), fix="update ptt")
    return store


def machine_of(store: Store, machine: str) -> MachineFile | None:
    """The drawing of a machine as it was given; None where the store does not know it."""
    query = "SELECT toml FROM models WHERE machine = ? AND made = 'given'"
    found = store.ask(query, machine)
    return parse_machine(found[0]["toml"], machine) if found else None


def drawing_of(store: Store, machine: str, model: Path | None) -> MachineFile:
    """A machine's drawing: the one in the store, or, where the machine is new, the one given.

    Args:
        store: the store.
        machine: its name.
        model: its machine.toml, or a compensator folder; None where the store has the machine.

    Raises:
        InputError: an empty name, no drawing, or one that differs from that in the store.
    """
    if not machine.strip():
        raise InputError("the machine has no name", fix="give it one, such as 'mill 3'")
    known, given = machine_of(store, machine), None if model is None else read_drawing(model)
    if known is None and given is None:
        fix = "give --model M.toml once, or the path of the machine file in place of the name"
        raise InputError(f"no machine '{shown(machine)}' yet", where=str(store.folder), fix=fix)
    if known is not None and given is not None:
        other = [section for section, name in SECTIONS.items() if getattr(known, name) != getattr(given, name)]
        if other:
            what = f"differs from the stored drawing of '{shown(machine)}' in {', '.join(other)}"
            raise InputError(what, where=str(model), fix="name the machine alone, or give it another name")
    found = known or given
    assert found is not None
    return found


def add_machine(store: Store, machine: str, model: Path | None) -> MachineFile:
    """A machine's drawing as from `drawing_of`; a machine that is new is added to the store."""
    given = drawing_of(store, machine, model)
    with transaction(store.file) as connection:
        if not rows(connection, "SELECT 1 FROM machines WHERE machine = ?", machine):
            kind, drawing = given.machine.kind, _drawing(given)
            insert(connection, "machines", machine=machine, kind=kind, drawing=drawing, added=now())
            text = format_machine(given)
            insert(connection, "models", machine=machine, run="", made="given", toml=text, since=now())
    return given


def add_run(
    store: Store, machine: str, path: Path, table: Table, date: datetime | None, *, ordered: bool, units_said: bool
) -> Added:
    """Add a run: its file unchanged, its readings as Parquet, and last the row of the table that names both.

    A process that is killed on the way leaves files that no row names; adding the run again overwrites them.

    Args:
        store: the store.
        machine: name of the machine that was measured; the store has it.
        path: the run's file.
        table: the table that was read from it.
        date: when it was measured; None for the date in the file's name, else that of the file.
        ordered: whether the user stated that the rows are in travel order.
        units_said: whether the user stated the units of the columns.

    Returns:
        Name, date and size of the run, and whether it is new.

    Raises:
        InputError: the run is another machine's.
    """
    run = sha256(path)
    when, how = (date, "as said") if date is not None else date_of(path)
    told = f"{when.date().isoformat()} ({how})"
    if is_there(store, machine, run, path):
        (held,) = store.ask("SELECT date FROM runs WHERE run = ?", run)
        return Added(path.name, run, table.rows, f"{held['date'].date().isoformat()} (as it is kept)", False)
    kept, readings = f"runs/{run}{path.suffix}", f"readings/{run}.parquet"
    put = partial(_put_files, path, store.folder / kept, table, machine, run, store.folder / readings)
    put()  # here, so that a long file keeps nobody from the store
    with transaction(store.file) as connection:
        if rows(connection, "SELECT 1 FROM runs WHERE run = ?", run):
            return Added(path.name, run, table.rows, told, False)
        if not all((store.folder / file).is_file() for file in (kept, readings)):
            put()  # another process had added the same run, and removed it with its files
        place = rows(connection, "SELECT coalesce(max(place), 0) + 1 AS place FROM runs")[0]["place"]
        insert(
            connection, "runs", run=run, machine=machine, date=when, place=place, file=path.name, kept=kept,
            readings=readings, row_count=table.rows, ordered=ordered, units_said=units_said, added=now(),
        )  # fmt: skip
    return Added(path.name, run, table.rows, told, True)


def date_of(path: Path) -> tuple[datetime, str]:
    """When a file was measured, by its name or its date of change (UTC), and which of them, in words."""
    named = date_in_name(path.name)
    if named is not None:
        return datetime(named.year, named.month, named.day), "by the file's name"
    changed = datetime.fromtimestamp(path.stat().st_mtime, UTC).replace(tzinfo=None)
    return changed.replace(microsecond=0), "the file's own date"


def read_date(text: str) -> datetime:
    """Read a date as ISO 8601.

    Raises:
        InputError: it is none.
    """
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"cannot read '{text}'", where="--date", fix="write it as 2026-03-15") from None
    return when if when.tzinfo is None else when.astimezone(UTC).replace(tzinfo=None)


def shown(name: str) -> str:
    """A name that is safe to print: control characters are escaped."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in name)


def is_there(store: Store, machine: str, run: str, path: Path) -> bool:
    """Whether a run is in the store.

    Raises:
        InputError: it is another machine's.
    """
    known = store.ask("SELECT machine FROM runs WHERE run = ?", run)
    if known and known[0]["machine"] != machine:
        owner = shown(known[0]["machine"])
        raise InputError(f"is already a run of '{owner}'", where=str(path), fix="name that machine, or the right file")
    return bool(known)


def _drawing(file: MachineFile) -> str:
    """Digest of a drawing without the machine's name, which sister machines share."""
    text = file.machine.model_dump_json(exclude={"name"})
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _put_files(path: Path, kept: Path, table: Table, machine: str, run: str, readings: Path) -> None:
    """Put a run's file, unchanged, and its readings in place, each whole or not at all, whatever their size."""
    with path.open("rb") as file:
        write_parts(kept, iter(partial(file.read, PART), b""))
    write_readings(table, machine, run, readings)
