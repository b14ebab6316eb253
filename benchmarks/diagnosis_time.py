"""Processor time of a diagnosis in process on one core, and how many sets of atoms it screens and scores.

    python benchmarks/diagnosis_time.py [--count 10] [--start 910000] [--experiments] [--before TREE]

The sealed samples, then machines drawn by seed of every level as `sweep.py --foreign` draws them, each diagnosed once
to warm up and then the given number of times, the least taken. `--before` diagnoses the same runs with the packages
of another checkout as well, each run behind the other, so that both meet the same other work on the machine.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

HERE = Path(__file__).resolve().parents[1]
SAMPLES = {name: (f"{name}/machine.toml", f"{name}/run.csv") for name in ("sealed_one", "sealed_three")}
EXPERIMENTS = {f"experiment{number}": ("machine.toml", f"experiment{number}.csv") for number in range(1, 6)}
LEVELS = ("none", "single", "multi", "unknown")


def runs(count: int, start: int, experiments: bool) -> Iterator[tuple[str, Any, Any]]:
    """Name, machine and table of each run."""
    from ptt.challenge.cases import draw, plan
    from ptt.challenge.truth import table_of
    from ptt.machine import load_machine
    from ptt.rig import simulate
    from ptt.run.reading import read_table

    for name, (machine, run) in (SAMPLES | (EXPERIMENTS if experiments else {})).items():
        yield name, load_machine(HERE / "data" / machine), read_table(HERE / "data" / run)
    for level in LEVELS:
        for case in plan(level, count, start, kinds="all", noise=None, bench=None, rows=None, visible=True):
            drawn, _ = draw(case)
            frame = simulate(drawn.rig, drawn.targets).frame
            yield f"{level} {case.seed}", drawn.rig.machine, table_of(frame, drawn.absent)


def serve(options: argparse.Namespace) -> None:
    """Diagnose one run after the other, as the lines on standard input ask for them."""
    import torch

    from ptt.diagnosis.diagnose import diagnose
    from ptt.diagnosis.evidence.score import Scorer
    from ptt.diagnosis.evidence.screen import Screen
    from ptt.model.model import Model
    from ptt.run.problem import build_problem

    torch.set_num_threads(1)
    screens, scored = _counted(Screen, "__init__"), _counted(Scorer, "_score")
    for name, file, table in runs(options.count, options.start, options.experiments):
        sys.stdin.readline()
        spent = list[float]()
        for _ in range(1 + options.repeat):
            screens.clear()
            scored.clear()
            problem, began = build_problem(file, table), time.process_time()
            said = diagnose(Model(file), problem)
            spent.append(time.process_time() - began)
        told = {"verdict": said.verdict, "named": [step[0] for step in said.suggested]}
        figures = {"seconds": min(spent[1:]), "screens": len(screens), "scored": len(scored), "rows": table.rows}
        print(json.dumps({"name": name} | figures | told), flush=True)
    sys.stdin.readline()
    print("null", flush=True)


def _counted(cls: type, name: str) -> list[None]:
    """Count the calls of a method."""
    calls, method = list[None](), getattr(cls, name)

    def counting(*args: Any, **named: Any) -> Any:
        calls.append(None)
        return method(*args, **named)

    setattr(cls, name, counting)
    return calls


def start(tree: Path) -> subprocess.Popen[str]:
    """A process that diagnoses with the packages of a tree."""
    command = [sys.executable, str(Path(__file__).resolve()), "--serve", *sys.argv[1:]]
    environment = os.environ | {"PYTHONPATH": str(tree)}
    return subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def ask(process: subprocess.Popen[str]) -> Any:
    """What a process says of its next run; None behind the last."""
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write("\n")
    process.stdin.flush()
    return json.loads(process.stdout.readline() or "null")


def main() -> None:
    """Ask, print, and sum up by level."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10, help="machines of each level")
    parser.add_argument("--start", type=int, default=910_000)
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--experiments", action="store_true", help="also the five runs of 1,268 rows")
    parser.add_argument("--before", type=Path, help="another checkout")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve(options)
        return
    processes = [start(tree) for tree in (options.before, HERE) if tree is not None]
    seconds: dict[str, list[list[float]]] = {}
    while all(answers := [ask(process) for process in processes]):
        last = answers[-1]
        times = [answer["seconds"] for answer in answers]
        same = all((answer["verdict"], answer["named"]) == (last["verdict"], last["named"]) for answer in answers)
        counts = f"{last['screens']:4d} screens {last['scored']:4d} sets  {last['verdict']} {', '.join(last['named'])}"
        print(f"{last['name']:16s} {last['rows']:5d} rows {_row(times)} s  {counts}{'' if same else '  DIFFERS'}")
        seconds.setdefault(last["name"].split()[0], []).append(times)
    for name, found in seconds.items():
        print(f"{name}: median {_row([statistics.median(column) for column in zip(*found, strict=True)])} s")


def _row(times: list[float]) -> str:
    return " -> ".join(f"{value:5.2f}" for value in times)


if __name__ == "__main__":
    main()
