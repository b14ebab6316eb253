"""Ctrl-C in the middle of a statement is Ctrl-C, wherever it comes; nothing of it is kept."""

import signal
import threading

import pytest

from ptt.fleet.database import in_memory, rows, transaction

LONG = "SELECT sum(a.range * b.range) AS n FROM range(1000000) a, range(1000000) b"  # an hour's work


@pytest.fixture
def pressed():
    """A finger on Ctrl-C in a moment, as a terminal would have it; whoever runs tests may not listen to it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    finger = threading.Timer(0.3, signal.raise_signal, [signal.SIGINT])
    yield finger.start
    finger.cancel()
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_breaks_a_transaction_off_and_it_is_undone(tmp_path, pressed):
    file = tmp_path / "fleet.duckdb"
    with transaction(file) as connection:
        connection.execute("CREATE TABLE runs (name TEXT)")
    pressed()
    with pytest.raises(KeyboardInterrupt), transaction(file) as connection:
        connection.execute("INSERT INTO runs VALUES ('lost')")
        rows(connection, LONG)
    with transaction(file) as connection:
        assert rows(connection, "SELECT * FROM runs") == []


def test_ctrl_c_breaks_the_reading_of_a_run_off(pressed):
    pressed()
    with pytest.raises(KeyboardInterrupt), in_memory() as connection:
        connection.execute(LONG)
    with in_memory() as connection:
        assert rows(connection, "SELECT 1 AS one") == [{"one": 1}]
