"""Copying a log from CSV to Parquet, which can be read part by part."""

from pathlib import Path

from ptt.errors import InputError, TableError, shown
from ptt.fleet.database import duckdb, in_memory
from ptt.run.readers.encoding import decode
from ptt.run.readers.mapping import Mapping
from ptt.run.readers.text import raw_text

GROUP = 20_480  # rows of a Parquet row group, ten of DuckDB's vectors of 2048: a part of a log reads one or two
HEAD = 2**18  # bytes from which encoding, delimiter and decimal sign are found
READ = "a log is Parquet, or a CSV with one line of titles (docs/files.md)"


def require_log(log: Path) -> None:
    """Refuse a log that is not there, or is empty.

    Args:
        log: Parquet or CSV.

    Raises:
        InputError: no such file, a folder, or nothing in it.
    """
    if not log.is_file():
        what = "is a folder" if log.is_dir() else "no such file"
        raise InputError(what, where=str(log), fix=f"check the path; {READ}")
    if not log.stat().st_size:
        fix = "export it again; a header and two rows are the least"
        raise InputError("the file is empty", where=str(log), fix=fix)


def to_parquet(csv: Path, out: Path) -> None:
    """Copy a CSV of any length to Parquet; DuckDB streams it, so that memory does not limit its size.

    Args:
        csv: file with the titles of a tracker CSV (docs/files.md).
        out: Parquet file to write.

    Raises:
        InputError: it cannot be read.
    """
    require_log(csv)
    package = duckdb()
    with in_memory() as connection:
        source = f"read_csv(?{_separators(csv)})"
        query = f"COPY (SELECT * FROM {source}) TO ? (FORMAT parquet, ROW_GROUP_SIZE {GROUP})"
        try:
            connection.execute(query, [str(csv), str(out)])
        except package.Error as error:
            what = f"cannot be read as a table ({shown(str(error).splitlines()[0], 200)})"
            raise InputError(what, where=str(csv), fix=READ) from None


def _separators(csv: Path) -> str:
    """Options of read_csv for delimiter and decimal sign, found as for a run; '' where DuckDB finds them itself."""
    with csv.open("rb") as file:
        data = file.read(HEAD)
    data = data if len(data) < HEAD else data[: data.rfind(b"\n") + 1]
    try:
        raw = raw_text(*decode(data, str(csv), Mapping(), None), str(csv), Mapping())
    except TableError:
        return ""
    if raw.delimiter not in (";", "\t", "|") or raw.header is None:
        return ""
    return f", delim = '{raw.delimiter}', decimal_separator = '{raw.decimal}', header = true"
