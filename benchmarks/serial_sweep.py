"""Sweep over virtual arms with one hidden fault each: how often the diagnosis names it first, and keeps silent.

    python benchmarks/serial_sweep.py --count 25 --start 1000 [--machine ur10 kuka_iiwa] [--out out/serial.jsonl]

Arms come from `ptt.rig` alone. A fault counts as visible where it moves the reflector by at least twice the noise of a
reading. "first" is the leading name of the first step; "alone" that nothing else was named beside it.
"""

import argparse
import json
import os
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from ptt.diagnosis.telling.verdict import diagnose
from ptt.machine import MachineFile, load_machine
from ptt.model.model import Model
from ptt.rig.draw_arm import ARM_FAULTS, NAMES, ArmFault, draw_arm
from ptt.run.problem import build_problem
from ptt.run.table import make_table

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
SIGMA = 0.01  # mm
VISIBLE = 2.0


def open_arm(name: str) -> MachineFile:
    """A preset, its tracker's noise told, base frame and reflector mount fitted."""
    file = load_machine(MACHINES / f"{name}.toml")
    return replace(
        file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA, "frame": "fitted", "tool": "fitted"})
    )


def judge(file: MachineFile, fault: ArmFault, seed: int) -> dict[str, Any]:
    """Hide one fault and diagnose the run."""
    run = draw_arm(file.machine, fault, seed, sigma_mm=SIGMA)
    context = {"measured": run.readings, "payload_kg": run.payload_kg, "temp_c": run.temp_c, "time_s": run.time_s}
    file = replace(file, machine=run.rig.spec)
    started = time.perf_counter()
    found = diagnose(Model(file), build_problem(file, make_table(None, run.q, **context)))
    named = [step[0] for step in found.suggested]
    right = found.verdict == "nothing-missing" and not named if fault == "none" else named[:1] == [NAMES[fault]]
    visible = fault == "none" or run.moved_um > VISIBLE * SIGMA * 1e3 * 3**0.5
    return {
        "machine": file.machine.name, "fault": fault, "seed": seed, "verdict": found.verdict,
        "named": [list(step) for step in found.suggested], "right": right, "alone": right and len(named) <= 1,
        "visible": visible, "moved_um": run.moved_um, "seconds": time.perf_counter() - started,
    }  # fmt: skip


def tell(rows: Sequence[dict[str, Any]]) -> None:
    """Print one line for each machine and fault."""
    print(f"{'machine':<12}{'fault':<12}{'runs':>6}{'visible':>9}{'first':>8}{'alone':>8}{'s':>7}")
    for machine, fault in sorted({(row["machine"], row["fault"]) for row in rows}):
        own = [row for row in rows if (row["machine"], row["fault"]) == (machine, fault)]
        seen = [row for row in own if row["visible"]]
        right, alone = (100.0 * sum(row[key] for row in seen) / max(len(seen), 1) for key in ("right", "alone"))
        mean = sum(row["seconds"] for row in own) / len(own)
        print(f"{machine:<12}{fault:<12}{len(own):>6}{len(seen):>9}{right:7.1f}%{alone:7.1f}%{mean:7.1f}")


def main() -> None:
    """Run the sweep."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=25, help="seeds for each fault and machine")
    parser.add_argument("--start", type=int, default=1000)
    parser.add_argument("--machine", nargs="+", default=["ur10", "kuka_iiwa"])
    parser.add_argument("--fault", nargs="+", default=list(ARM_FAULTS))
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for seed in range(asked.start, asked.start + asked.count):
        for name in asked.machine:
            rows += [judge(open_arm(name), fault, seed) for fault in asked.fault]
            if asked.out:
                asked.out.parent.mkdir(parents=True, exist_ok=True)
                asked.out.write_text("".join(json.dumps(row) + "\n" for row in rows))
    tell(rows)


if __name__ == "__main__":
    main()
