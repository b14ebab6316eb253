"""A run of a million rows, diagnosed in chunks: wall time, memory, and what took the time.

    python benchmarks/million.py [--rows 1000000] [--cores 0,1] [--keep RUN.csv]

The run comes from the virtual machine (backlash, an error with every turn of the screw, screws that grow as the room
warms) and is written to a temporary folder. Memory is the sum over the process and its workers of what only they hold
and their share of what they hold together (PSS), sampled ten times a second, seldomer where to look takes long.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from ptt.machine import load_machine
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume

MACHINE = Path(__file__).resolve().parents[1] / "data" / "sealed_one" / "machine.toml"
CYCLE = 25_000  # rows that are driven again and again
FAULTS: dict[str, dict[str, Any]] = {
    "drive": {"backlash_mm": [0.04, 0.05, 0.03], "turn_um": [6.0, 5.0, 7.0]},
    "thermal": {"growth_um_per_m_k": 11.5, "fixed_end_mm": 450.0},
}
GOAL_S, GOAL_GB = 60.0, 4.0
TRUTH = {
    "gap_mm": FAULTS["drive"]["backlash_mm"],
    "cosine_mm": [1e-3 * value for value in FAULTS["drive"]["turn_um"]],
    "growth_per_k": [1e-6 * FAULTS["thermal"]["growth_um_per_m_k"]] * 3,
}


def make_run(path: Path, rows: int, seed: int = 5) -> None:
    """Write a run of about that many rows."""
    file = load_machine(MACHINE)
    cycle = min(rows, CYCLE)
    conditions = {
        "cycles": max(1, rows // cycle),
        "dwell_s": 1.0,
        "room": {"start_c": 20.0, "rise_k": 6.0, "time_constant_s": 2.0 * rows},
    }
    drawing = file.machine.model_dump(mode="json", exclude_none=True)
    rig = replace(parse_rig({"machine": drawing, "seed": seed, "conditions": conditions, **FAULTS}), machine=file)
    frame = simulate(rig, make_volume(ideal_machine(rig.spec), cycle, 3)).frame
    write_run(frame.drop(columns=["name"]).round(7), path)


def measure(command: list[str], cores: list[int]) -> dict[str, float | str]:
    """Run a command on some cores: wall and CPU seconds, peak memory in GB, what it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start, peak = time.perf_counter(), 0.0
    pinned = (lambda: os.sched_setaffinity(0, cores)) if cores else None
    with tempfile.TemporaryFile("w+") as said:  # a pipe that nobody reads while it runs would stop it
        with subprocess.Popen(command, stdout=said, stderr=subprocess.DEVNULL, text=True, preexec_fn=pinned) as run:
            while run.poll() is None:
                looked = time.perf_counter()
                peak = max(peak, sum(map(_share, _family(run.pid))))
                time.sleep(max(0.1, 20.0 * (time.perf_counter() - looked)))  # pages are counted one by one
        said.seek(0)
        text = said.read()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"wall_s": time.perf_counter() - start, "cpu_s": cpu, "peak_gb": peak, "text": text}


def _family(pid: int) -> list[int]:
    children = Path(f"/proc/{pid}/task/{pid}/children")
    own = [int(child) for child in children.read_text().split()] if children.exists() else []
    return [pid, *(item for child in own for item in _family(child))]


def _share(pid: int) -> float:
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:  # gone in between
        return 0.0
    return sum(float(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1e6


def print_pulls(told: dict[str, Any]) -> None:
    """Print how far parameters are from what the virtual machine was given, in their own standard errors."""
    values = {item["name"]: item for step in told["candidates"] for item in step["parameters"] if item["std"]}
    for name, truth in TRUTH.items():
        for joint, true in enumerate(truth, 1):
            if found := values.get(f"{name} {joint}"):
                pull = (found["value"] - true) / found["std"]
                print(
                    f"  {name} {joint}: {found['value']:.6g} +- {found['std']:.2g}, true {true:.6g}: {pull:+.1f} sigma"
                )


def time_parts(run: Path) -> None:
    """Print when each part of the diagnosis begins."""
    from ptt.diagnosis.long import diagnose_long
    from ptt.door.opened import open_run
    from ptt.door.options import ReadOptions

    start = time.perf_counter()

    def tell(what: str) -> None:
        print(f"{time.perf_counter() - start:8.1f} s  {what}", flush=True)

    tell("read")
    opened = open_run(run, MACHINE, ReadOptions(json=True))
    tell("rows are seen through the machine")
    diagnose_long(opened.model, opened.problem, opened.library, progress=tell)
    tell("done")


def main() -> None:
    """Make the run, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--cores", default="", help="as in 0,1; all by default")
    parser.add_argument("--keep", type=Path, help="write the run here, or use it where it is there already")
    parser.add_argument("--parts", action="store_true", help="also print when each part begins (a second run)")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        run = chosen.keep or Path(folder) / "million.csv"
        if not run.exists():
            make_run(run, chosen.rows)
        ptt = [sys.executable, "-c", "from ptt.commands.main import main; main()"]
        cores = [int(core) for core in chosen.cores.split(",") if core]
        command = [*ptt, "diagnose", str(run), "--model", str(MACHINE), "--json"]
        seen = measure(command, cores)
        told = json.loads(str(seen["text"]))
        print(f"{told['rows']} rows, {told['verdict']}: {[step[0] for step in told['suggested']]}")
        print(f"wall {seen['wall_s']:.1f} s (goal {GOAL_S:g}), CPU {seen['cpu_s']:.1f} s")
        print(f"peak memory {seen['peak_gb']:.2f} GB (goal {GOAL_GB:g})")
        print(told["words"])
        print_pulls(told)
        if chosen.parts:
            time_parts(run)


if __name__ == "__main__":
    main()
