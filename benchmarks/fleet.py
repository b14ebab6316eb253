"""A fleet of virtual machines over a year, and rows per second against workers.

    python benchmarks/fleet.py year FOLDER [--machines 50] [--months 12] [--rows 100]
    python benchmarks/fleet.py rows [--rows 100000] [--workers 0 1 2] [--part 20000]

`year` can be stopped and started again: the store goes on where it was. One machine in five is sound, one has a slider
whose play grows, one a slider that was hit, one is repaired halfway, one gets a fault that it did not have; what was
said of each is printed beside that.
"""

import argparse
import json
import tempfile
import time
from collections import Counter
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ptt.effects.registry import library, make_effect
from ptt.fitting.layout import lay_out
from ptt.fleet.fit_log import start_of
from ptt.fleet.log import open_log
from ptt.fleet.log_copy import to_parquet
from ptt.fleet.overview import overview
from ptt.fleet.run import run_all
from ptt.fleet.shares import Passes
from ptt.fleet.store import FILE, add_machine, add_run, create_store, open_store, read_date
from ptt.fleet.workers import cluster
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.noise import DEFAULT_SIGMA, Noise
from ptt.run.reading import read_table
from ptt.run.table import make_table
from ptt.run.written import write_table
from ptt.show.fleet.page import write_page

MACHINE = Path(__file__).resolve().parents[1] / "data" / "sealed_one" / "machine.toml"
KINDS = ("sound", "drift", "jump", "repaired", "new")


def faults(machine: int, month: int, months: int) -> dict[str, dict[str, list[float]]]:
    """What ails a machine in a month."""
    random = np.random.default_rng([machine, 7])
    kind, slider = KINDS[machine % len(KINDS)], int(random.integers(3))
    gap, homing = random.uniform(0.02, 0.06, 3), random.uniform(-0.3, 0.3, 3)
    late = month >= months // 2
    if kind == "drift":
        gap[slider] += 0.004 * month
    if kind == "jump" and late:
        homing[slider] += 0.06
    if kind == "repaired":
        gap[slider] = 0.005 if late else 0.09
    drive = {"backlash_mm": gap.tolist(), "homing_mm": homing.tolist()}
    return {"drive": drive | ({"turn_um": [15.0, 12.0, 18.0]} if kind == "new" and late else {})}


def year(folder: Path, machines: int, months: int, rows: int) -> None:
    """Draw what is not there yet, work on what is new, and write the page."""
    file = load_machine(MACHINE)
    drawing = file.machine.model_dump(mode="json", exclude_none=True)
    store = open_store(folder / "store") if (folder / "store" / FILE).exists() else create_store(folder / "store")
    there = {row["file"] for row in store.ask("SELECT file FROM runs")}
    for machine in range(machines):
        add_machine(store, f"machine {machine:02d}", MACHINE)
        for month in range(months):
            path = folder / "csv" / f"m{machine:02d}-{month:02d}.csv"
            if path.name in there:
                continue
            spec = {"machine": drawing, "seed": 1000 * machine + month, **faults(machine, month, months)}
            rig = replace(parse_rig(spec), machine=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_run(simulate(rig, make_volume(ideal_machine(rig.spec), rows, machine)).frame, path)
            when = read_date(f"{2026 + month // 12}-{month % 12 + 1:02d}-05")
            add_run(store, f"machine {machine:02d}", path, read_table(path), when, ordered=False, units_said=False)
    start, cpu = time.perf_counter(), time.process_time()
    done = run_all(store, lambda what, count, of: print(f"{count}/{of} {what}", end="\r", flush=True))
    print(f"\n{done}; {time.perf_counter() - start:.0f} s, {time.process_time() - cpu:.0f} s of one core")
    found = overview(store)
    write_page(found, folder / "report.html")
    for standing in found.machines:
        kind = KINDS[int(standing.machine.split()[-1]) % len(KINDS)]
        verdicts = dict(Counter(past.verdict for past in standing.past))
        print(f"{standing.machine} {kind:<9} {verdicts} {[alarm.words for alarm in standing.alarms]}")


def rows_per_second(rows: int, workers: list[int], size: int) -> None:
    """Passes over a log: rows a second, and the most memory of each worker; none is this process alone."""
    random, file = np.random.default_rng(2), load_machine(MACHINE)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        way = 283.0 + 40.0 * np.sin(np.cumsum(random.normal(size=(rows, 3)) * 0.1, axis=0))
        place = build_mechanism(file.machine).forward(torch.as_tensor(way)).numpy()
        write_table(make_table(place, way, place + 0.005 * random.normal(size=place.shape)), path)
        to_parquet(path, path.with_suffix(".parquet"))
        log = open_log(file, path.with_suffix(".parquet"), size)
        names = ("backlash", "homing-offset")
        model = Model(file)
        for name in names:
            model = model + make_effect(library(), name)
        noise = log.noise or Noise(np.eye(3) * DEFAULT_SIGMA**2, "first guess")
        layout = lay_out(model, log.whole, start_of(model, log, noise))
        for count in workers:
            with cluster(None, count) if count else nullcontext() as client:
                if count:
                    client.wait_for_workers(count)
                start = time.perf_counter()
                passes = Passes(log, layout, noise, client)
                entered = time.perf_counter()
                for turn in range(3):
                    passes(layout.start() + 1e-4 * turn, np.zeros(0, dtype=int))
                each, held = (time.perf_counter() - entered) / 3, peaks(client)
            told = {"workers": count, "rows": rows, "enter_s": entered - start, "rows_per_s": rows / each}
            print(json.dumps(told | {"peak_gb": held}), flush=True)


def peaks(client: Any) -> list[float]:
    """The most memory that each worker, or this process, has held so far, GB."""
    own = [peak_gb()] if client is None else list(client.run(peak_gb).values())
    return [round(each, 3) for each in own]


def peak_gb() -> float:
    """The most memory that this process has held, GB (that of rusage is the parent's where it was more)."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return float(status["VmHWM"].split()[0]) / 1e6


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    one = verbs.add_parser("year")
    one.add_argument("folder", type=Path)
    one.add_argument("--machines", type=int, default=50)
    one.add_argument("--months", type=int, default=12)
    one.add_argument("--rows", type=int, default=100)
    one.set_defaults(do=lambda own: year(own.folder, own.machines, own.months, own.rows))
    two = verbs.add_parser("rows")
    two.add_argument("--rows", type=int, default=100_000)
    two.add_argument("--workers", type=int, nargs="+", default=[0, 1, 2])
    two.add_argument("--part", type=int, default=20_000, help="rows of a part")
    two.set_defaults(do=lambda own: rows_per_second(own.rows, own.workers, own.part))
    own = parser.parse_args()
    own.do(own)


if __name__ == "__main__":
    main()
