"""The whole job on sample data: five experiments compensated and measured again, then two sealed machines solved.

Usage: python data/demo.py [FOLDER]; pictures and runs go to FOLDER, `out` by default.
"""

import json
import multiprocessing
import os
import sys
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import torch
from demo_experiments import LABELS, MODELS, describe, draw, measure_experiment
from demo_loop import SEALED, walk_loop

from ptt.commands.common import progress
from ptt.files import write_text
from ptt.record import plain

MOST_WORKERS = 4  # each needs about half a gigabyte
WAIT = "This takes about two minutes on two cores."


def main(out: Path) -> None:
    """Do everything, each experiment and each sealed machine as a job of its own, then print and draw."""
    print(WAIT, file=sys.stderr)
    with start_workers() as workers:
        walks = [workers.submit(walk_loop, name, out / name) for name in SEALED]
        keys = [(number, model) for model in reversed(MODELS) for number in LABELS]
        experiments = {key: workers.submit(measure_experiment, *key, out / "runs") for key in keys}
        wait_for([*walks, *experiments.values()])
    measured = {key: experiments[key].result() for key in sorted(experiments)}
    results = {(*key, title): value for key, one in measured.items() for title, value in one.results.items()}
    for number in LABELS:
        print(describe(number, results))
    draw(results, measured[1, MODELS[1]], out)
    data = {f"experiment {key[0]}, {key[1]}, {key[2]}": value.to_dict() for key, value in results.items()}
    write_text(out / "experiments.json", json.dumps(plain(data), indent=1) + "\n")
    for walk in walks:
        print(walk.result())
    print(
        "\nmeasured again: on the virtual machine, with noise of its own; below 90, 90, 80: goals of the source paper"
    )
    print(f"pictures, runs and figures in {out}/; with a run of your own: ptt check RUN.csv --model MACHINE.toml")


def start_workers() -> ProcessPoolExecutor:
    """One process per core: that keeps cores busier than several threads in one process."""
    count = min(os.cpu_count() or 1, MOST_WORKERS)
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(count, mp_context=spawn, initializer=torch.set_num_threads, initargs=(1,))


def wait_for(jobs: list[Future[Any]]) -> None:
    """Show how far it is; a job that failed ends the demo."""
    with progress() as tell:
        tell("five experiments, two sealed machines", 0, len(jobs))
        for done, job in enumerate(as_completed(jobs), 1):
            job.result()
            tell("five experiments, two sealed machines", done, len(jobs))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out"))
