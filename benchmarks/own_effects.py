"""Effects written by `ptt effects new --like` for a fault outside the library: how much of the tool's error they take.

    python benchmarks/own_effects.py --count 24 --start 0 [--kinds unseen]

One fault outside the library alone on a foreign machine; the diagnosis is asked, the file written for all that it
says is followed is loaded as it is, added and fitted, and the virtual machine measured again with the corrected
commands, without noise. The reduction is of the tool's error, against the drawing. Nothing is written where the verdict
is not `unknown`.
"""

import argparse
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from sweep_judge import leading

from ptt.challenge.cases import draw, plan
from ptt.challenge.remeasure import remeasure
from ptt.challenge.truth import table_of
from ptt.diagnosis.diagnose import diagnose
from ptt.effects.prefilled import prefilled
from ptt.effects.registry import load_effects
from ptt.errors import InputError
from ptt.judge.ladder.climb import climb
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.run.problem import build_problem

TOOL_SOUND = 0.1  # um: the fault is one of the readings, and nothing is to be taken from the tool


def main() -> None:
    """Print a line for each rig, and the median reduction."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--kinds", choices=("shown", "unseen", "all"), default="shown")
    options = parser.parse_args()
    cases = plan("unknown", 3 * options.count, options.start, kinds=options.kinds, bench=None, visible=True)
    alone = [replace(case, faults=case.faults[:1]) for case in cases if len(case.faults) == 1][: options.count]
    found = []
    for case in alone:
        began = time.perf_counter()
        words, reduction = _one(case)
        found += [] if reduction is None else [reduction]
        print(f"{case.seed:>7} {case.faults[0]:<24} {words}  {time.perf_counter() - began:.0f} s", flush=True)
    if found:
        share = f"at least 60 % in {np.mean(np.array(found) >= 60.0):.0%}"
        print(f"median {np.median(found):.0f} % of {len(found)}; {share}; worst {np.min(found):.0f} %")


def _one(case: object) -> tuple[str, float | None]:
    drawn, _ = draw(case)  # type: ignore[arg-type]
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    result = diagnose(Model(drawn.rig.machine), problem)
    said = result.to_dict()
    names = ",".join(group[0] for group in said["suggested"])
    if said["verdict"] != "unknown" or not said["depends_on"]:
        return f"{said['verdict']} [{names}]", None
    first = said["depends_on"][0]
    right = leading(said["depends_on"], drawn)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "own.py"
        try:
            written = prefilled("own-effect", said["depends_on"])
        except InputError as error:
            return f"{first['residual']} on {first['on']}: {error}", None
        file.write_text(written.text)
        own = [cls() for cls in load_effects(file).values()]
    ladder = climb(result.model, problem, own)
    tool = remeasure(ladder.model, drawn).to_dict()
    before, after = tool["before"]["total"], (tool["after"] or {"total": np.nan})["total"]
    if before < TOOL_SOUND:
        return f"a fault of the readings, beside [{names}]: tool {before:.1f} -> {after:.1f} um", None
    reduction = 100.0 * (1.0 - after / before) if np.isfinite(after) else -100.0
    where = (
        f"{first['residual']} on {first['on']} ({first['shape']}; {'right' if right and right['right'] else 'wrong'}), "
        f"{len(own)} laws"
    )
    return f"{where} beside [{names}]: tool {before:.1f} -> {after:.1f} um, {reduction:.0f} %", reduction


if __name__ == "__main__":
    main()
