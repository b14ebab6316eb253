"""Sweep over rigs with hidden faults: how often the diagnosis is right, silent, and what compensation then reaches.

    python benchmarks/sweep.py --level single --foreign --count 200 --out out/sweep
    python benchmarks/sweep.py --level none --foreign --noise wander
    python benchmarks/sweep.py --level unknown --foreign --kinds unseen --start 5000
    python benchmarks/sweep.py --level dense --foreign  # every size of the drawing off a little, beside one fault
    python benchmarks/sweep_report.py out/sweep [out/sweep_before]

Rigs come from `ptt.rig` alone. `--foreign` draws geometry, path, length and noise by the seed, else it is the bench;
fault sizes are log-uniform over the usual ranges, drawn anew until each leaves 2 to 30 times the noise of one reading
once the frame is out (`--any-size` leaves them as they come). A fault counts from twice that noise on. Everything
follows from the seeds `--start` ... `--start + count - 1`. Results go to OUT/LEVEL.json, one object a case; a case that
breaks is one of them.
"""

import argparse
import json
import multiprocessing
import os
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pandas as pd
import torch
from sweep_judge import judge_names, leading, printed_heldout, pulls, reached, statements, verdict_right
from sweep_report import NOISE_FREE, summary

from ptt.challenge.cases import Case, draw, plan
from ptt.challenge.challenge import bench
from ptt.challenge.truth import UM_PER_MM, Truth, table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.errors import PttError
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.rig.draw import DrawnRig
from ptt.rig.draw_noise import NOISES
from ptt.run.problem import build_problem

Closing = Callable[[Any, DrawnRig, Truth, pd.DataFrame], dict[str, Any]]  # what closing the loop comes to
BLANK: dict[str, Any] = {"rows": 0, "noise": "", "path": "", "hidden": {}, "counted": [], "outside": []}


def reach_again(result: Any, drawn: DrawnRig, truth: Truth, frame: pd.DataFrame) -> dict[str, Any]:
    """Close the loop with the model of a diagnosis, at the targets of its own run."""
    return {"tool": reached(result.model, drawn, truth, printed_heldout(result.to_dict()))}


def run_case(case: Case, close: Closing = reach_again) -> dict[str, Any]:
    """Draw, diagnose, and only then look at the truth."""
    row = {"seed": case.seed, "level": case.level, "protocol": case.protocol, "faults": list(case.faults), **BLANK}
    try:
        began = time.perf_counter()
        drawn, truth = draw(case)
        row |= describe(case, drawn, truth)
        frame = simulate(drawn.rig, drawn.targets).frame
        row |= {"rows": len(frame), "draw_s": time.perf_counter() - began}
        row |= examine(drawn, truth, frame, close)
    except Exception as error:  # one broken case must not lose the others, and must show
        row["error"] = f"{type(error).__name__}: {error}"
        row["refused"] = isinstance(error, PttError)  # in words that say what to do
        row["trace"] = traceback.format_exc(limit=-4)
    return row


def describe(case: Case, drawn: DrawnRig, truth: Truth) -> dict[str, Any]:
    """What is known of a case before anybody diagnoses it."""
    spec, tracker = drawn.rig.machine.machine, drawn.rig.machine.tracker
    return {
        "faults": list(drawn.truth),
        **{"noise": case.noise or NOISE_FREE, "path": drawn.protocol, "repeats": "own", **drawn.notes},
        "frame": tracker.frame,
        "sigma_told": tracker.sigma_mm is not None,
        "std_told": drawn.rig.tracker.report_std,
        "link_mm": getattr(spec, "link_length_mm", None),
        "hidden": {fault.name: fault.size / truth.noise.total for fault in truth.faults},
        "counted": [fault.name for fault in truth.faults if fault.counts],
        "outside": [fault.name for fault in truth.faults if not fault.known],
        "noise_um": UM_PER_MM * truth.noise.total,
    }


def examine(drawn: DrawnRig, truth: Truth, frame: pd.DataFrame, close: Closing) -> dict[str, Any]:
    """Diagnose a run, and judge what is said."""
    file = drawn.rig.machine
    problem = build_problem(file, table_of(frame, drawn.absent))
    began = time.perf_counter()
    result = diagnose(Model(file), problem)
    seconds = time.perf_counter() - began
    said = result.to_dict()
    named, verdict = [list(group) for group in said["suggested"]], said["verdict"]
    row: dict[str, Any] = {"verdict": verdict, "named": named, "seconds": seconds}
    row["noise_seen"] = said["noise_um"]["total"] / (UM_PER_MM * truth.noise.total)
    row["depends"] = [[item["residual"], item["on"]] for item in said["depends_on"][:3]]
    row |= judge_names(named, truth, drawn)
    row["right"] = verdict_right(verdict, truth, row["explained"])
    row["statements"] = statements(said, row["words"], row["right"])
    row["leading"] = leading(said["depends_on"], drawn)
    picks = {group[0] for group in named}
    row["pulls"] = pulls(said, truth, drawn) if picks == set(truth.hidden) else []
    if named:
        row |= close(result, drawn, truth, frame)
    return row


def sweep(cases: list[Case], jobs: int, run: Callable[[Case], dict[str, Any]] = run_case) -> Iterator[dict[str, Any]]:
    """Run all cases, in their order."""
    if jobs == 1:
        yield from map(run, cases)
        return
    with multiprocessing.get_context("spawn").Pool(jobs, start) as pool:
        yield from pool.imap(run, cases, chunksize=1)


def start() -> None:
    """One thread a process: a case is small."""
    torch.set_num_threads(1)


def plain(value: Any) -> Any:
    """What JSON does not know."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(type(value).__name__)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--level", choices=("single", "multi", "unknown", "none", "dense"), default="single")
    parser.add_argument("--foreign", action="store_true", help="geometry, path, length and noise by the seed")
    parser.add_argument("--steep", action="store_true", help="rails of --foreign lean by 15 to 75 deg or lie flat")
    parser.add_argument("--noise", choices=tuple(NOISES), help="one kind for all; else all kinds in turn")
    parser.add_argument("--kinds", choices=("shown", "unseen", "all"), default="shown", help="outside the library")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--rows", type=int, help="of a run; else 24 to 2,000 by the seed, 300 on the bench")
    parser.add_argument("--any-size", action="store_true", help="leave the sizes of the faults as they are drawn")
    parser.add_argument("--fault", help="only cases that hide this one")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/sweep"))
    args = parser.parse_args()
    if args.steep and not args.foreign:
        parser.error("--steep leans the rails of drawn machines: say --foreign as well")
    return args


def main() -> None:
    """Command line."""
    args = _options()
    shared = {
        "bench": None if args.foreign else bench(),
        "rows": args.rows,
        "visible": not args.any_size,
        "steep": args.steep,
    }
    cases = plan(args.level, args.count, args.start, kinds=args.kinds, noise=args.noise, **shared)
    if args.fault:
        cases = [case for case in cases if args.fault in case.faults]
    follow(cases, args.level, args.out, args.jobs)


def follow(
    cases: list[Case], level: str, out: Path, jobs: int, run: Callable[[Case], dict[str, Any]] = run_case
) -> None:
    """Run cases, keep what is done, whatever comes, and print one line on them."""
    out.mkdir(parents=True, exist_ok=True)
    place, rows, began = out / f"{level}.json", [], time.perf_counter()
    for row in sweep(cases, jobs, run):
        rows.append(row)
        place.write_text(json.dumps(rows, indent=1, default=plain) + "\n")
    print(summary(level, rows), f"({time.perf_counter() - began:.0f} s)")


if __name__ == "__main__":
    start()
    main()
