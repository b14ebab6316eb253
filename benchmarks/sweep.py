"""Sweep over rigs with hidden faults: how often the diagnosis is right, silent, and what compensation then reaches.

    python benchmarks/sweep.py --level single --count 200 --jobs 2 --out out/sweep
    python benchmarks/sweep.py --level none --outliers 0.05      (or --rows 60, or --wander 5)

Rigs come from `ptt.rig` alone, fault sizes log-uniform over the usual ranges. A fault counts when it leaves at least
twice the noise of one reading once the frame is out; `--visible` draws sizes anew until all count. Everything follows
from the seeds `--start` ... `--start + count - 1`.
"""

import argparse
import itertools
import json
import multiprocessing
import os
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import torch

from ptt.challenge.challenge import bench
from ptt.challenge.hide import FAULTS, hide_faults
from ptt.challenge.score import judge, remeasure
from ptt.challenge.truth import MICRO, UNSEEN, Truth, find_truth, table_of
from ptt.diagnosis.design import build_design
from ptt.diagnosis.path import present_candidates
from ptt.diagnosis.verdict import Diagnosis, diagnose
from ptt.effects import library
from ptt.machine import MachineFile
from ptt.model import Model
from ptt.problem import build_problem
from ptt.rig import simulate
from ptt.rig.draw import PROTOCOLS, DrawnRig, Protocol, draw_rig, fault_names
from ptt.sums import gain, project

ATTEMPTS = 16
GROUP = 3  # effects in a declared group, at most
# Faults that poses in a volume show are also hidden in runs of several loads and temperatures, and those that a path
# shows also in one at several speeds.
ALSO: dict[str, tuple[Protocol, ...]] = {"volume": ("volume", "payload", "warmup"), "path": ("path", "speed")}


@dataclass(frozen=True)
class Case:
    """One rig to be drawn.

    Attributes:
        seed: of everything.
        level: single, multi, unknown or none.
        protocol: how it is measured.
        faults: names of what is hidden.
    """

    seed: int
    level: str
    protocol: Protocol
    faults: tuple[str, ...]


@dataclass(frozen=True)
class Options:
    """What all cases share.

    Attributes:
        rows: of a run.
        visible: draw sizes anew until all faults count.
        outliers: share of gross errors.
        wander: slow random drift of the tracker, um, and its time constant, s.
        machine: the drawing.
    """

    rows: int = 300
    visible: bool = False
    outliers: float = 0.0
    wander: tuple[float, float] = (0.0, 1200.0)
    machine: MachineFile = field(default_factory=bench)


def protocols_of(name: str) -> tuple[Protocol, ...]:
    """Runs in which a fault is hidden."""
    own = FAULTS[name].protocols
    return tuple(dict.fromkeys(also for protocol in own for also in ALSO.get(protocol, (protocol,))))


def plan(level: str, count: int, start: int) -> list[Case]:
    """Spread cases evenly over faults and runs."""
    cases = []
    for number in range(start, start + count):
        random = np.random.default_rng([number, 61])
        if level == "none":
            protocol, faults = PROTOCOLS[number % len(PROTOCOLS)], ()
        elif level == "multi":
            protocol = PROTOCOLS[number % len(PROTOCOLS)]
            faults = _several(random, protocol, 2 + number // len(PROTOCOLS) % 2)
        else:
            names = fault_names("unknown" if level == "unknown" else "single")
            name = names[number % len(names)]
            runs = protocols_of(name)
            protocol = runs[number // len(names) % len(runs)]
            more = _several(random, protocol, number // 2 % 3) if level == "unknown" else ()
            faults = (name, *more)
        cases.append(Case(number, level, protocol, faults))
    return cases


def _several(random: np.random.Generator, protocol: Protocol, count: int) -> tuple[str, ...]:
    """Effects for one run, one of them of the kind that only this run shows."""
    fitting = [name for name in fault_names("single") if protocol in protocols_of(name)]
    special = [name for name in fitting if len(protocols_of(name)) == 1]
    first = [special[random.integers(len(special))]] if special and count else []
    rest = [name for name in random.permutation(fitting) if name not in first]
    return tuple(first + rest[: count - len(first)])


def draw(case: Case, options: Options) -> tuple[DrawnRig, Truth]:
    """Draw the rig of a case, and work out its truth."""
    best: tuple[float, DrawnRig, Truth] | None = None
    for attempt in range(ATTEMPTS if options.visible and case.faults else 1):
        seed = case.seed + 100_000 * attempt
        plain = draw_rig("none", seed, options.machine, case.protocol, rows=options.rows)
        drawn = hide_faults(plain, case.faults, seed)
        truth = find_truth(drawn, library())
        least = min((fault.size / truth.noise.total for fault in truth.faults), default=0.0)
        if best is None or least > best[0]:
            best = least, drawn, truth
        if all(fault.counts for fault in truth.faults):
            break
    assert best is not None
    return best[1], best[2]


def spoil(drawn: DrawnRig, options: Options) -> DrawnRig:
    """Make the tracker worse: gross errors, slow drift."""
    update = {"outlier_share": options.outliers, "wander_um": options.wander[0], "wander_s": options.wander[1]}
    return replace(drawn, rig=replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update=update)))


def run_case(case: Case, options: Options) -> dict[str, Any]:
    """Draw, diagnose, and only then look at the truth."""
    drawn, truth = draw(case, options)
    spoiled = spoil(drawn, options)
    file = options.machine
    problem = build_problem(file, table_of(simulate(spoiled.rig, spoiled.targets).frame))
    began = time.perf_counter()
    result = diagnose(Model(file), problem)
    seconds = time.perf_counter() - began
    end = result.path.end
    named = [list(group) for group in result.suggested]
    row: dict[str, Any] = {
        "seed": case.seed,
        "level": case.level,
        "protocol": case.protocol,
        "hidden": {fault.name: fault.size / truth.noise.total for fault in truth.faults},
        "counted": [fault.name for fault in truth.faults if fault.counts],
        "verdict": result.verdict,
        "named": named,
        "outcome": outcome(named, truth),
        "seconds": seconds,
        "noise_um": MICRO * truth.noise.total,
        "noise_seen": result.noise.total / truth.noise.total,
        "heldout": end.design.held_out_rms(end.design.base) / truth.noise.total,
        "heldout_seen": end.design.held_out_rms(end.design.base) / result.noise.total,
    }
    if case.faults:
        after = remeasure(end.fitted.model, drawn).to_dict()
        row["tool"] = {key: value and value["total"] / row["noise_um"] for key, value in after.items()}
    if case.level == "single":
        row["rivals"] = rivals(truth)
    if case.level == "unknown":
        row["depends"] = [[item.residual, item.on] for item in result.depends_on[:3]]
        row["place"] = place_found(drawn, result)
    row["reasons"] = list(result.rest.reasons)
    return row


def outcome(named: list[list[str]], truth: Truth) -> str:
    """One word on what was named against what was hidden."""
    picks = [group[0] for group in named]
    must, may = {fault.name for fault in truth.faults if fault.counts}, set(truth.hidden)
    if not picks:
        return "silent" if not must else "missed"
    if _fits(picks, must, may):
        return "exact"
    small = [group if len(group) <= GROUP else group[:1] for group in named]
    if any(_fits(choice, must, may) for choice in itertools.product(*small)) and judge(picks, truth).right:
        return "declared"
    if judge(picks, truth).right:
        return "fair"
    if must and must <= set(picks):
        return "extra"
    return "missed" if set(picks) <= may else "wrong"


def _fits(picks: Any, must: set[str], may: set[str]) -> bool:
    return must <= set(picks) <= may and len(set(picks)) == len(picks)


def rivals(truth: Truth) -> list[str]:
    """Other effects that leave nothing that can be seen of a single fault, by the run without noise."""
    (name,) = truth.hidden
    start = truth.fitted([])
    effects = [effect for effect in present_candidates(start, truth.problem, truth.known)[0] if effect.key != name]
    design = build_design(start, truth.problem, effects, truth.noise)
    projected = project(*design.sums.total[:3], design.base)
    left = {effect.key: np.inf for effect in effects}
    for trial in design.trials:
        key = trial.effect.key
        left[key] = min(left[key], projected.left - gain(projected, trial.columns)[0])
    near = [key for key, value in left.items() if value < 4.0 * UNSEEN + 0.02 * projected.left]
    return [key for key in near if truth.left([key]) - truth.left([name]) < UNSEEN]


def place_found(drawn: DrawnRig, result: Diagnosis) -> bool:
    """Whether the variable that a fault outside the library follows is the first that the rest depends on."""
    if not result.depends_on or not drawn.rig.odd:
        return False
    fault, on = drawn.rig.odd[0], result.depends_on[0].on
    if fault.kind == "hose":
        return on in ("x", "y", "z")
    if fault.kind == "warm-backlash":
        return on in ("temperature", f"direction{fault.leg}")
    return on == f"b{fault.leg}"


def _start() -> None:
    torch.set_num_threads(1)


def _safely(job: tuple[Case, Options]) -> dict[str, Any]:
    case, options = job
    try:
        return run_case(case, options)
    except Exception as error:  # one broken case must not lose the others, and must show
        hidden = dict.fromkeys(case.faults, float("nan"))
        words = f"{type(error).__name__}: {error}"
        return {"seed": case.seed, "level": case.level, "protocol": case.protocol, "hidden": hidden, "error": words}


def sweep(cases: list[Case], options: Options, jobs: int) -> list[dict[str, Any]]:
    """Run all cases, in their order."""
    work = [(case, options) for case in cases]
    if jobs == 1:
        return [_safely(job) for job in work]
    with multiprocessing.get_context("spawn").Pool(jobs, _start) as pool:
        return pool.map(_safely, work, chunksize=2)


def main() -> None:
    """Command line."""
    from sweep_report import report

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--level", choices=("single", "multi", "unknown", "none"), default="single")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--rows", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--visible", action="store_true", help="draw sizes anew until every fault counts")
    parser.add_argument("--outliers", type=float, default=0.0, help="share of gross errors")
    parser.add_argument("--wander", type=float, default=0.0, help="slow random drift of the tracker, um")
    parser.add_argument("--wander-s", type=float, default=1200.0, help="its time constant, s")
    parser.add_argument("--no-sigma", action="store_true", help="the machine file does not tell the tracker's noise")
    parser.add_argument("--out", type=Path, default=Path("out/sweep"))
    args = parser.parse_args()
    machine = bench()
    if args.no_sigma:
        machine = replace(machine, tracker=machine.tracker.model_copy(update={"sigma_mm": None}), text="")
    options = Options(args.rows, args.visible, args.outliers, (args.wander, args.wander_s), machine)
    began = time.perf_counter()
    rows = sweep(plan(args.level, args.count, args.start), options, args.jobs)
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / f"{args.level}.json").write_text(json.dumps(rows, indent=1) + "\n")
    print(report(rows, args.level, args.out, time.perf_counter() - began))


if __name__ == "__main__":
    _start()
    main()
