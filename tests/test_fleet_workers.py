"""Workers: a real scheduler and two real processes; one is killed in the middle, and nothing is lost."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from fleet_work import deadly, outcome, slow
from test_fleet_log import terms_of, write_log
from test_fleet_store import MACHINE, fill

from ptt.errors import InputError
from ptt.fitting.layout import lay_out
from ptt.fleet.ctrl_c import held_back
from ptt.fleet.log import open_log
from ptt.fleet.queue import waiting
from ptt.fleet.run import run_all
from ptt.fleet.shares import Passes
from ptt.fleet.workers import cluster, run_on_workers
from ptt.machine import load_machine
from ptt.model.model import Model
from ptt.run.noise import Noise

HERE = Path(__file__).parent
PYTHONPATH = os.pathsep.join([str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")])


def start(module: str, *options: str) -> subprocess.Popen:
    command = [sys.executable, "-m", f"distributed.cli.{module}", "--dashboard-address", "127.0.0.1:0", *options]
    environment = {**os.environ, "PYTHONPATH": PYTHONPATH, "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """Address of a scheduler, and its two workers."""
    file = tmp_path_factory.mktemp("dask") / "scheduler.json"
    processes = [start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))]
    options = ("--scheduler-file", str(file), "--no-nanny", "--nthreads", "1")
    processes += [start("dask_worker", *options) for _ in range(2)]
    try:
        while not file.exists():
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"], processes[1:]
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


def test_a_worker_that_is_killed_in_the_middle_costs_nothing(running, tmp_path):
    address, workers = running
    store, told = fill(tmp_path / "s", machines=4, runs=2), []
    with cluster(address, None) as client:
        client.wait_for_workers(2, timeout=60)

    def tell(what, done, of):
        if done == 2 and not told:
            os.kill(workers[0].pid, signal.SIGKILL)
            told.append(of)

    done = run_on_workers(store, address, progress=tell, work=slow)
    assert (done.runs, done.lost, done.elsewhere, told) == (8, [], 0, [8])
    assert waiting(store) == {} and len(store.ask("SELECT * FROM outcomes")) == 8
    days = store.ask("SELECT machine, words FROM outcomes ORDER BY finished")
    for machine in {row["machine"] for row in days}:
        own = [row["words"] for row in days if row["machine"] == machine]
        assert own == sorted(own)
    assert run_on_workers(store, address, work=slow).runs == 0


def test_a_machine_whose_runs_no_worker_survives_is_left_and_the_others_go_on(running, tmp_path):
    store = fill(tmp_path / "s", machines=2, runs=2)
    done = run_on_workers(store, running[0], work=deadly)
    assert (done.runs, len(done.lost), done.elsewhere, waiting(store)) == (2, 2, 0, {"m0": 2})
    assert run_on_workers(store, running[0], work=slow).runs == 2  # another day it may do


def test_a_run_whose_readings_are_gone_fails_and_the_others_go_on(running, tmp_path):
    store = fill(tmp_path / "s", machines=2, runs=2)
    (lost,) = store.ask("SELECT readings FROM runs WHERE machine = 'm0' ORDER BY date LIMIT 1")
    (store.folder / lost["readings"]).unlink()
    done = run_on_workers(store, running[0], work=slow)
    assert (done.verdicts, done.lost, done.elsewhere, waiting(store)) == ({"failed": 1, "same": 3}, [], 0, {})


RUN = """
import sys
from fleet_work import slow
from ptt.commands.main import guard
from ptt.fleet.store import open_store
from ptt.fleet.workers import run_on_workers
tell = lambda what, done, of: print(done, flush=True)
sys.exit(guard(lambda: run_on_workers(open_store(sys.argv[1]), workers=1, progress=tell, work=slow) and None))
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="groups of processes are POSIX")
def test_ctrl_c_is_one_line_and_what_is_done_is_kept(tmp_path):
    """As a terminal does it, the workers get it too."""
    store = fill(tmp_path / "s", machines=4, runs=3)
    environment = {**os.environ, "PYTHONPATH": PYTHONPATH, "OMP_NUM_THREADS": "1"}
    run = subprocess.Popen(
        [sys.executable, "-c", RUN, str(store.folder)], env=environment, start_new_session=True, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    while run.stdout.readline() != "2\n":
        assert run.poll() is None, run.stderr.read()
    os.killpg(run.pid, signal.SIGINT)
    _, told = run.communicate(timeout=60)
    assert (run.returncode, told) == (130, "error: interrupted\n")
    done = len(store.ask("SELECT * FROM outcomes"))
    assert 2 <= done < 12 and not store.ask("SELECT * FROM claims")
    assert run_all(store, work=lambda task, tell: outcome(task)).runs == 12 - done


@pytest.fixture
def listening():
    """Ctrl-C as in a terminal: whatever a shell runs in the background is started deaf to it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_waits_while_processes_start_and_they_never_get_it(listening):
    code = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    with held_back() as pressed:
        os.kill(os.getpid(), signal.SIGINT)
        deaf = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout
    assert pressed and deaf == "True\n"
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_a_scheduler_that_is_not_there_is_told(tmp_path, monkeypatch):
    store = fill(tmp_path / "s", 1, 1)
    monkeypatch.setattr("ptt.fleet.workers.PATIENCE", "0.5s")
    with pytest.raises(InputError, match="no scheduler answers"):
        run_on_workers(store, "tcp://127.0.0.1:9", work=slow)
    assert waiting(store) == {"m0": 1}


@pytest.mark.long
def test_a_log_on_workers_has_the_sums_of_one_process_also_when_one_dies(tmp_path):
    log = open_log(load_machine(MACHINE), write_log(tmp_path / "log.parquet", 1200), 100)
    layout = lay_out(Model(log.machine), log.whole, terms_of("backlash", "homing-offset"))
    noise, unknowns, none, gross = Noise(np.eye(3) * 0.005**2, "stated"), np.full(12, 1e-2), np.zeros(0, int), [107]
    alone = Passes(log, layout, noise)
    with cluster(None, 2) as client:
        there = Passes(log, layout, noise, client)
        first = there(unknowns, none)
        pids = client.run(os.getpid)
        os.kill(next(iter(pids.values())), signal.SIGKILL)
        again = there(unknowns + 1e-3, np.array(gross))
    assert (first.rows, again.rows) == (1200, 1199)
    for share, own in ((first, alone(unknowns, none)), (again, alone(unknowns + 1e-3, np.array(gross)))):
        for one, other in zip(share.total, own.total, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-9 * np.abs(other).max())
