"""Sweep over arms with hidden faults, as `sweep.py` does over 3-PTT: everything about them is drawn by seed.

    python benchmarks/serial_sweep.py --level single --count 200 --out out/serial
    python benchmarks/serial_sweep.py --level unknown --kinds unseen --start 5000
    python benchmarks/sweep_report.py out/serial

Arms, runs, noise and faults come from `ptt.rig` alone, as drawn by `draw_foreign_arm`; sizes of faults are drawn anew
until each leaves 2 to 30 times the noise of one reading once the tracker's frame and the reflector's mount are out. The
loop is closed as a user closes it: `ptt add` of the names that were said, commands of that model, and the virtual arm
measured again with them, without noise, at fresh poses between those of the run.
"""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import pandas as pd
from serial_fresh import fresh_poses
from sweep import follow, run_case, start
from sweep_judge import printed_heldout, reached

import ptt
from ptt.challenge.cases import Case, plan
from ptt.challenge.truth import Truth
from ptt.door.model import model_of
from ptt.effects import library
from ptt.rig.draw import DrawnRig
from ptt.rig.draw_noise import NOISES


def reach_afresh(result: Any, drawn: DrawnRig, truth: Truth, frame: pd.DataFrame) -> dict[str, Any]:
    """Close the loop: add what was named to the run, and send the model's commands to fresh poses."""
    names = [group[0] for group in result.to_dict()["suggested"]]
    given = model_of(drawn.rig.machine, library())
    run = ptt.read(frame.drop(columns=[*drawn.absent]), given)  # its rows lie in a folder that lives as long as it
    added = ptt.add(given, run, *names)
    fresh = fresh_poses(drawn, drawn.rig.seed)
    return {"tool": reached(added.model.physics, fresh, truth, printed_heldout(result.to_dict()))}


def run_arm(case: Case) -> dict[str, Any]:
    """Draw an arm, diagnose it, and only then look at the truth."""
    return run_case(case, reach_afresh)


def _options(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--level", choices=("single", "multi", "unknown", "none"), default="single")
    parser.add_argument("--noise", choices=tuple(NOISES), help="one kind for all; else all kinds in turn")
    parser.add_argument("--kinds", choices=("shown", "unseen", "all"), default="all", help="outside the library")
    parser.add_argument("--count", type=int, default=25)
    parser.add_argument("--start", type=int, default=1000)
    parser.add_argument("--rows", type=int, help="of a run; else 40 to 700 by the seed")
    parser.add_argument("--any-size", action="store_true", help="leave the sizes of the faults as they are drawn")
    parser.add_argument("--fault", help="only cases that hide this one")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/serial"))
    return parser.parse_args(given)


def main(given: Sequence[str] | None = None) -> None:
    """Command line."""
    args = _options(given)
    shared = {"rows": args.rows, "visible": not args.any_size, "arm": True}
    cases = plan(args.level, args.count, args.start, kinds=args.kinds, noise=args.noise, **shared)
    if args.fault:
        cases = [case for case in cases if args.fault in case.faults]
    follow(cases, args.level, args.out, args.jobs, run_arm)


if __name__ == "__main__":
    start()
    main()
