"""Processing all waiting runs of a store on dask.distributed workers, here or on other computers.

Workers get a run's readings and the machine's models by message and send back the outcome. Only the submitting process
opens the store, so a worker needs neither the folder nor duckdb, and nothing is lost when one dies: its run is given to
another worker, and stays in the queue if workers die of it as often as the scheduler allows.
"""

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ptt.errors import InputError
from ptt.fleet.ctrl_c import held_back
from ptt.fleet.owner import owner
from ptt.fleet.queue import claim, keep_outcome, next_task, release, waiting
from ptt.fleet.run import Done
from ptt.fleet.store import Store
from ptt.fleet.task import Outcome, Task
from ptt.progress import Progress, unwatched

AHEAD = 2  # tasks submitted for each worker, so that none waits for the submitting process
PATIENCE = "30s"  # for a scheduler to answer


def run_on_workers(
    store: Store,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    work: Callable[[Task], Outcome] | None = None,
) -> Done:
    """Process every waiting run, each as one task; runs of one machine follow each other.

    Args:
        store: the store.
        scheduler: address of a running one; None starts one here.
        workers: how many processes to start here; None for two.
        progress: told what is being done, how many runs are done of how many.
        work: processes one run; None for `ptt.fleet.work.work`.

    Returns:
        What was done.

    Raises:
        InputError: distributed is missing, or no scheduler answers.
    """
    from ptt.fleet.work import work as whole

    tell, done = progress or unwatched, Done()
    with owner(store.workers) as name, cluster(scheduler, workers) as client:
        total = sum(waiting(store).values())
        try:
            _distribute(store, name, client, work or whole, done, lambda what: tell(what, done.runs, total))
        finally:
            release(store, name)
    done.elsewhere = max(0, sum(waiting(store).values()) - len(done.lost))
    return done


@contextmanager
def cluster(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """A client of a running scheduler, or of processes that are started here and end with it.

    Args:
        scheduler: address; None starts one.
        workers: how many processes to start; None for two.

    Yields:
        `distributed.Client`.

    Raises:
        InputError: distributed is missing, or no scheduler answers.
    """
    try:
        from distributed import Client, LocalCluster
    except ModuleNotFoundError:
        raise InputError("workers need the package distributed", fix="pip install 'ptt[fleet]'") from None
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=PATIENCE)
        except (OSError, ValueError) as error:
            fix = "start one: dask scheduler; dask worker ADDRESS"
            raise InputError(f"no scheduler answers ({error})", where=scheduler, fix=fix) from None
        with client:
            yield client
        return
    # dask and tornado log every call and every task that Ctrl-C interrupts: hidden unless tracebacks are asked for.
    level = logging.WARNING if os.environ.get("PTT_TRACEBACK") else logging.CRITICAL
    logging.getLogger("tornado.application").setLevel(level)
    with held_back() as pressed:
        # One thread each: threads of one process would wait for each other.
        local = LocalCluster(
            n_workers=workers or 2, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1",
            silence_logs=level,
        )  # fmt: skip
        client = Client(local)
    try:
        if pressed:
            raise KeyboardInterrupt
        yield client
    finally:
        with held_back():
            client.close()
            local.close()


def _why(failed: BaseException) -> str:
    """Why no worker processed a run, in one line: its workers died, or the error that one raised."""
    from distributed import KilledWorker

    if isinstance(failed, KilledWorker):
        return "its workers died"
    said = str(failed).strip().splitlines()
    return f"its worker says {type(failed).__name__}{': ' + said[0] if said else ''}"


def _distribute(
    store: Store, name: str, client: Any, work: Callable[[Task], Outcome], done: Done, tell: Callable[[str], None]
) -> None:
    from distributed import as_completed

    doing: dict[Any, Task] = {}
    running = as_completed([])
    given_up, ended = dict[str, list[str]](), set[str]()

    def submit(machine: str) -> None:
        while isinstance(task := next_task(store, machine, given_up.get(machine, [])), Outcome):
            if keep_outcome(store, task):
                done.count(task.verdict)
        if task is None:
            ended.add(machine)  # all that still waits there was given up: claimed again, it would come back for ever
            release(store, name, machine)
            return
        future = client.submit(work, task, pure=False)
        doing[future] = task
        running.add(future)

    def fill() -> None:
        room = AHEAD * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        while len(doing) < room and (machine := claim(store, name, ended)) is not None:
            submit(machine)

    fill()
    for future in running:
        if future.status in ("lost", "pending"):  # its worker died before the outcome came: another repeats it
            running.add(future)
            continue
        task = doing.pop(future)
        tell(f"{task.machine}, {task.date[:10]}")
        if future.status == "finished":
            outcome = future.result()
            if keep_outcome(store, outcome):
                done.count(outcome.verdict)
        else:  # its workers died one after the other, or run another version: that must not end the rest
            done.lost.append(f"{task.machine}, {task.file} ({_why(future.exception())})")
            given_up.setdefault(task.machine, []).append(task.run)
        future.release()
        submit(task.machine)
        fill()
