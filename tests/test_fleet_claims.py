"""Runs of a store are claimed once: by date, by two processes, after one that died."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from fleet_work import outcome
from test_fleet_store import fill

from ptt.errors import InputError
from ptt.fleet.database import transaction
from ptt.fleet.queue import claim, keep_outcome, next_task, requeue_failed, waiting
from ptt.fleet.remove import remove
from ptt.fleet.run import run_all
from ptt.fleet.store import add_run, create_store
from ptt.fleet.task import Outcome
from ptt.run.reading import read_table


def test_runs_are_worked_on_by_date_once_and_the_first_makes_the_model(tmp_path):
    store, seen = fill(tmp_path / "s"), []

    def work(task, tell):
        seen.append((task.machine, task.date[:10], task.solved is None))
        return outcome(task)

    done = run_all(store, work=work)
    assert done.runs == 6 and waiting(store) == {}
    for machine in ("m0", "m1"):
        own = [(day, first) for name, day, first in seen if name == machine]
        assert own == [(f"2026-0{month}-05", month == 1) for month in range(1, 4)]
    assert run_all(store, work=work).runs == 0 and len(seen) == 6


def test_a_run_interrupted_goes_on_where_it_was(tmp_path):
    store, seen = fill(tmp_path / "s"), []

    def work(task, tell):
        if len(seen) == 2:
            raise KeyboardInterrupt
        seen.append(task.run)
        return outcome(task)

    with pytest.raises(KeyboardInterrupt):
        run_all(store, work=work)
    assert sum(waiting(store).values()) == 4 and not store.ask("SELECT * FROM claims")
    seen.clear()
    run_all(store, work=lambda task, tell: seen.append(task.run) or outcome(task))
    assert len(set(seen)) == 4


@pytest.mark.parametrize("damage", ["gone", "cut"])
def test_readings_that_are_gone_or_damaged_fail_their_run_and_the_others_go_on(tmp_path, damage):
    store = fill(tmp_path / "s", 2, 2)
    (lost,) = store.ask("SELECT run, readings FROM runs WHERE machine = 'm0' ORDER BY date LIMIT 1")
    path = store.folder / lost["readings"]
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2]) if damage == "cut" else path.unlink()
    assert run_all(store, work=lambda task, tell: outcome(task)).verdicts == {"failed": 1, "same": 3}
    (told,) = store.ask("SELECT run, did, words FROM outcomes WHERE verdict = 'failed'")
    what = "missing" if damage == "gone" else "damaged"
    assert (told["run"], told["did"]) == (lost["run"], "nothing")
    assert f"readings of the store are {what}; put the file back from a copy of the store" in told["words"]
    path.write_bytes(whole)
    assert requeue_failed(store) == 1
    assert run_all(store, work=lambda task, tell: outcome(task)).verdicts == {"same": 1}


def test_what_came_of_a_run_is_written_once(tmp_path):
    store = fill(tmp_path / "s", 1, 1)
    task = next_task(store, "m0")
    assert keep_outcome(store, outcome(task)) and not keep_outcome(store, outcome(task))
    assert len(store.ask("SELECT * FROM outcomes")) == 1


WORKER = """
import sys, time
sys.path.insert(0, {here!r})
from fleet_work import outcome
from ptt.fleet.run import run_all
from ptt.fleet.store import open_store
def work(task, tell):
    print(task.run, flush=True)
    time.sleep({pause})
    return outcome(task)
print('done', run_all(open_store({store!r}), work=work).runs, flush=True)
"""


def start(store, pause: float) -> subprocess.Popen:
    code = WORKER.format(here=str(Path(__file__).parent), store=str(store.folder), pause=pause)
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def test_two_processes_at_once_share_the_work_and_one_that_is_killed_costs_nothing(tmp_path):
    store = fill(tmp_path / "s", machines=3, runs=3)
    killed, other = start(store, 0.15), start(store, 0.15)
    begun = [killed.stdout.readline() for _ in range(2)]
    os.kill(killed.pid, signal.SIGKILL)
    killed.communicate()
    told, _ = other.communicate(timeout=60)
    assert other.returncode == 0
    last = start(store, 0.0)
    rest, _ = last.communicate(timeout=60)
    assert waiting(store) == {} and len(store.ask("SELECT * FROM outcomes")) == 9
    own = [line for line in told.splitlines() if len(line) == 64]
    assert own and all(begun)
    assert len(own) == len(set(own))
    assert len(own) + sum(len(line) == 64 for line in rest.splitlines()) <= 9


def test_a_store_that_somebody_else_keeps_open_is_waited_for_then_told(tmp_path):
    store = create_store(tmp_path / "s")
    code = f"import duckdb, time; c = duckdb.connect({str(store.file)!r}); print('open', flush=True); time.sleep(30)"
    holder = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout.readline() == "open\n"
        with pytest.raises(InputError, match="in use by another program"), transaction(store.file, patience=0.3):
            pass
    finally:
        holder.kill()
        holder.communicate()
    assert store.ask("SELECT count(*) AS n FROM runs") == [{"n": 0}]


def test_a_claim_of_a_dead_process_is_taken_over(tmp_path):
    store = fill(tmp_path / "s", 1, 1)
    with transaction(store.file) as connection:
        connection.execute("INSERT INTO claims VALUES ('m0', 'somebody', NULL)")
    store.workers.mkdir()
    assert claim(store, "me") == "m0"  # nobody of that name lives


def test_a_failed_run_waits_again_only_when_asked(tmp_path):
    store = fill(tmp_path / "s", 1, 2)

    def failed(task, tell):
        return Outcome(task.run, task.machine, "nothing", "failed", "no", 0.0)

    assert run_all(store, work=failed).verdicts == {"failed": 2}
    assert run_all(store, work=failed).runs == 0
    assert requeue_failed(store) == 2 and sum(waiting(store).values()) == 2


@pytest.fixture
def between(monkeypatch):
    """Lets something happen once, before or after the first transaction in which a file of the package writes."""

    def once(module: str, what, *, after: bool) -> None:
        @contextmanager
        def interrupted(path, **options):
            if writes := not options.get("read_only"):
                monkeypatch.setattr(f"{module}.transaction", transaction)
            if writes and not after:
                what()
            with transaction(path, **options) as connection:
                yield connection
            if writes and after:
                what()

        monkeypatch.setattr(f"{module}.transaction", interrupted)

    return once


def files_of(store) -> list[bool]:
    (run,) = store.ask("SELECT kept, readings FROM runs")
    return [(store.folder / run[column]).is_file() for column in ("kept", "readings")]


def test_a_run_that_is_added_while_it_is_removed_keeps_its_files(tmp_path, between):
    store = fill(tmp_path / "s", 2, 1)
    remove(store, "m1", "2026-01-05")
    path = tmp_path / "m0-2026-01-05.csv"

    def add_again():  # as another machine's: no claim of the first one holds it back
        add_run(store, "m1", path, read_table(path), None, ordered=False, units_said=False)

    between("ptt.fleet.remove", add_again, after=True)
    remove(store, "m0", "2026-01-05")
    assert store.ask("SELECT machine FROM runs") == [{"machine": "m1"}] and files_of(store) == [True, True]
    remove(store, "m1", "2026-01-05")
    assert not any(path.is_file() for folder in ("runs", "readings") for path in (store.folder / folder).iterdir())


def test_a_run_that_is_removed_while_it_is_added_again_has_its_files(tmp_path, between):
    store = fill(tmp_path / "s", 1, 1)
    remove(store, "m0", "2026-01-05")
    path = tmp_path / "m0-2026-01-05.csv"

    def add_and_remove():
        add_run(store, "m0", path, read_table(path), None, ordered=False, units_said=False)
        remove(store, "m0", "2026-01-05")

    between("ptt.fleet.store", add_and_remove, after=False)
    added = add_run(store, "m0", path, read_table(path), None, ordered=False, units_said=False)
    assert added.new and files_of(store) == [True, True]
