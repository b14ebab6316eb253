"""The store's DuckDB file: one writer at a time, so everybody opens it briefly and waits for the others."""

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

PATIENCE = 60.0  # s that anybody waits for the file; transactions here take a few milliseconds
ONE_THREAD = {"threads": 1}  # what is asked here is small: starting threads takes longer than answering
DAMAGED = re.compile("IOException|Corrupt|checksum|SerializationException|InternalException|FatalException")
INTERRUPTED = "Query interrupted"  # what DuckDB says of a statement that Ctrl-C broke off
PAUSE = 0.02  # s before the first further try; doubled up to half a second, so that many waiting do not crowd


def duckdb() -> Any:
    """The package, or a word on how to get it.

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
    """All or nothing of what is done to a database, alone with it while it lasts.

    Args:
        path: the DuckDB file.
        read_only: nothing will be written; several may read at once.
        patience: how long to wait for others, s.

    Yields:
        The connection.

    Raises:
        InputError: another program keeps the file, or it is none of DuckDB's, or damaged.
        HostError: the disk is full.
    """
    connection, package = _connect(path, read_only, patience), duckdb()
    try:
        with _heard():
            connection.begin()
            yield connection
            connection.commit()
    except package.Error as error:
        raise _failed(path, error) from error
    finally:
        connection.close()  # what was not committed is undone


@contextmanager
def in_memory() -> Iterator["Connection"]:
    """A connection to a database of this process alone, which reads and writes files of readings.

    Yields:
        The connection.
    """
    with _heard(), _database().cursor() as connection:
        yield connection


@cache
def _database() -> "Connection":
    """The database in memory: opening one takes longer than reading a run."""
    return duckdb().connect(config=ONE_THREAD)


@contextmanager
def _heard() -> Iterator[None]:
    """Ctrl-C as everywhere else: DuckDB makes an error of its own of it, which would be told as a run's outcome."""
    try:
        yield
    except RuntimeError as error:
        if str(error) == INTERRUPTED:
            raise KeyboardInterrupt from None
        raise


def _failed(path: Path, error: Exception) -> Exception:
    """What DuckDB says of a file that is damaged or cannot grow, as an error of ours; a mistake of ours as it is."""
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
    """What DuckDB says of who holds the file."""
    start = message.find("Conflicting lock")
    return message[start:].split(". ")[0] if start >= 0 else message


def rows(connection: "Connection", query: str, *values: Any) -> list[dict[str, Any]]:
    """What a query answers, one dictionary for each row."""
    answer = connection.execute(query, _kept(values))
    names = [column[0] for column in answer.description or ()]
    return [dict(zip(names, row, strict=True)) for row in answer.fetchall()]


def now() -> datetime:
    """The time, UTC, as the store has it."""
    return datetime.now(UTC).replace(tzinfo=None)


def insert(connection: "Connection", table: str, **values: Any) -> None:
    """Put one row into a table; its column names are ours, its values are anybody's."""
    marks = ", ".join("?" for _ in values)
    connection.execute(f"INSERT INTO {table} ({', '.join(values)}) VALUES ({marks})", _kept(values.values()))


def _kept(values: Iterable[Any]) -> list[Any]:
    """Values as the database takes them; a name that came as bytes of no encoding is none.

    Raises:
        InputError: a text that is no UTF-8.
    """
    found = list(values)
    for text in (value for value in found if isinstance(value, str)):
        try:
            text.encode()
        except UnicodeEncodeError:
            raise InputError(f"{shown(repr(text))} is not UTF-8", fix="write or rename it in plain letters") from None
    return found
