"""Access to the store's DuckDB file: it allows one writing process, so each opens it briefly and waits for others."""

import random
import re
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.errors import HostError, InputError, shown

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection as Connection

PATIENCE = 60.0  # s to wait for the file; transactions here take a few milliseconds
ONE_THREAD = {"threads": 1}  # queries here are small: starting threads takes longer than answering
DAMAGED = re.compile("IOException|Corrupt|checksum|SerializationException|InternalException|FatalException")
INTERRUPTED = "Query interrupted"  # DuckDB's message for a statement that Ctrl-C broke off
PAUSE = 0.02  # s before the file is tried again; doubled each time up to half a second (exponential backoff)


def duckdb() -> Any:
    """The package duckdb, imported when it is first needed.

    Raises:
        InputError: it is not installed.
    """
    try:
        import duckdb
    except ModuleNotFoundError:
        raise InputError("a fleet's store needs the package duckdb", fix="pip install 'ptt[fleet]'") from None
    return duckdb


@contextmanager
def transaction(path: Path, *, read_only: bool = False, patience: float = PATIENCE) -> Iterator["Connection"]:
    """A transaction on a database file: committed when the body ends, undone where it raises.

    Args:
        path: the DuckDB file.
        read_only: nothing will be written; several processes may read at once.
        patience: how long to wait for processes that have the file open, s.

    Yields:
        The connection.

    Raises:
        InputError: another program keeps the file open, it is no DuckDB file, or it is damaged.
        HostError: the disk is full.
    """
    connection, package = _connect(path, read_only, patience), duckdb()
    try:
        with _interruptible():
            connection.begin()
            yield connection
            connection.commit()
    except package.Error as error:
        raise _failed(path, error) from error
    finally:
        connection.close()  # what was not committed is undone


@contextmanager
def in_memory() -> Iterator["Connection"]:
    """A connection to a database in memory, for queries that read and write files of readings.

    Yields:
        The connection.
    """
    with _interruptible(), _database().cursor() as connection:
        yield connection


@cache
def _database() -> "Connection":
    """The database in memory, opened once: opening takes longer than reading a run."""
    return duckdb().connect(config=ONE_THREAD)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Turn DuckDB's own error after Ctrl-C into KeyboardInterrupt; as an error it would be kept as a run's outcome."""
    try:
        yield
    except RuntimeError as error:
        if str(error) == INTERRUPTED:
            raise KeyboardInterrupt from None
        raise


def _failed(path: Path, error: Exception) -> Exception:
    """DuckDB's error for a file that is damaged or cannot grow as InputError or HostError; any other as it is."""
    text = " ".join(str(error).split())
    if re.search("No space|Disk quota|could not allocate", text, re.IGNORECASE):
        return HostError(f"{path}: cannot be written ({shown(text, 200)}); make room and try again")
    if DAMAGED.search(f"{type(error).__name__} {text}"):
        return InputError(
            f"is damaged ({shown(text, 200)})", where=str(path), fix="take a copy of the store from before"
        )
    return error


def _connect(path: Path, read_only: bool, patience: float) -> "Connection":
    package = duckdb()
    end, pause = time.monotonic() + patience, PAUSE
    while True:
        try:
            return package.connect(str(path), read_only=read_only, config=ONE_THREAD)
        except package.IOException as error:
            if "lock" not in str(error).lower():
                raise InputError(f"cannot be opened ({error})", where=str(path), fix="is it a fleet's store?") from None
            if time.monotonic() > end:
                what = f"has been in use by another program for {patience:.0f} s ({_holder(str(error))})"
                raise InputError(what, where=str(path), fix="close it there, then run this again") from None
        except package.Error as error:
            raise InputError(f"cannot be opened ({error})", where=str(path), fix="is it a fleet's store?") from None
        time.sleep(pause * random.uniform(0.5, 1.5))
        pause = min(2.0 * pause, 0.5)


def _holder(message: str) -> str:
    """The part of DuckDB's message that says which process holds the file."""
    start = message.find("Conflicting lock")
    return message[start:].split(". ")[0] if start >= 0 else message


def rows(connection: "Connection", query: str, *values: Any) -> list[dict[str, Any]]:
    """The rows that a query returns, each as column -> value."""
    answer = connection.execute(query, _storable(values))
    names = [column[0] for column in answer.description or ()]
    return [dict(zip(names, row, strict=True)) for row in answer.fetchall()]


def now() -> datetime:
    """The time now, UTC without a time zone, as the store keeps times."""
    return datetime.now(UTC).replace(tzinfo=None)


def insert(connection: "Connection", table: str, **values: Any) -> None:
    """Insert one row into a table. Values may come from users; table and column names are not escaped."""
    marks = ", ".join("?" for _ in values)
    connection.execute(f"INSERT INTO {table} ({', '.join(values)}) VALUES ({marks})", _storable(values.values()))


def _storable(values: Iterable[Any]) -> list[Any]:
    """Values as a list for the database.

    Raises:
        InputError: a text that is not UTF-8, such as a file name of other bytes.
    """
    found = list(values)
    for text in (value for value in found if isinstance(value, str)):
        try:
            text.encode()
        except UnicodeEncodeError:
            raise InputError(f"{shown(repr(text))} is not UTF-8", fix="write or rename it in plain letters") from None
    return found
