"""Real measurements with published results, through the same verbs as any run.

Run it as `python benchmarks/real.py [PART ...] [--out FIGURES.json] [--stride 5] [--clones DIR]`; without a part all of
them. Sets that are not beside the project (shared/data) are skipped and named.

    telescope    pointing of a two-axis mount: terms beside the published fit
    humanoid     two arms of Agile Justin: the ladder of errors and leave-one-out, beside the published ones
    short        dh-offsets fitted on few rows of an arm: must not raise the error of the rows it has not seen
    transfer     UR10: fitted on series A and B, tested on C
    diagnose     names and verdict of every set and of its two halves, and what one half's model leaves on the other
    printers     linear deltas: heights left out in turn
    arms         the same as diagnose of two industrial arms, whose readings lie in a folder of clones (real_arms.py)

Lengths are um, RMS of the distance, unless said. Halves are every other one of ten blocks of travel, all visits of a
pose together.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import klipper
import numpy as np
import real_arms
import torch
import ur10 as ur10_bench
from real_data import here, humanoid, open_set, plain_telescope, telescope, ur10
from real_published import (
    SIDES,
    Row,
    humanoid_ladder,
    humanoid_left_out,
    rms_um,
    telescope_drift,
    telescope_terms,
    with_effects,
)

from ptt.diagnosis.diagnose import diagnose
from ptt.errors import PttError
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.run.holdout import blocks
from ptt.run.problem import Problem

FOLDERS: dict[str, str | None] = {
    "telescope": "rts2_pointing", "humanoid": "dlr_justin", "short": "ur10_ipa", "transfer": "ur10_ipa",
    "diagnose": "", "printers": "klipper_delta", "arms": None,
}  # fmt: skip
SHORT = (50, 75, 100, 200, 400)
DRAWS = 8


def short_runs() -> list[Row]:
    """Print what dh-offsets leaves on unseen rows where it was fitted on few."""
    cases = {f"UR10 {name}": open_set(*ur10(name)) for name in "BCD"}
    if here("dlr_justin"):
        cases |= {f"Justin {side}": open_set(*humanoid(side)) for side in SIDES}
    print(f"fitted on few rows, RMS on all others, um (median of {DRAWS} draws): drawing -> + dh-offsets (times worse)")
    rows = []
    for name, problem in cases.items():
        text = f"  {name:<14}"
        for count in SHORT:
            pairs = np.array([unseen(problem, count, seed) for seed in range(DRAWS)])
            before, after = np.median(pairs, axis=0)
            worse = int((pairs[:, 1] > pairs[:, 0]).sum())
            text += f"  {count}: {before:.0f} -> {after:.0f} ({worse})"
            rows.append({"set": name, "rows": count, "drawing": before, "dh-offsets": after, "worse": worse})
        print(text, flush=True)
    return rows


def unseen(problem: Problem, count: int, seed: int) -> tuple[float, float]:
    """Error on unseen rows, without and with dh-offsets fitted on a stretch of consecutive rows."""
    rows = np.flatnonzero(problem.used)
    first = int(np.random.default_rng(seed).integers(0, len(rows) - count))
    shown = np.isin(np.arange(problem.table.rows), rows[first : first + count])
    part = problem.masked(~shown)
    hidden = problem.used & ~shown
    return tuple(rms_um(fit(with_effects(problem, names), part), hidden) for names in ((), ("dh-offsets",)))


def transfer(stride: int) -> list[Row]:
    """The UR10 fitted on two series and tested on a third."""
    rows: list[Row] = []
    ur10_bench.transfer(stride, rows)
    return rows


def halves(problem: Problem) -> list[np.ndarray]:
    """Every other block, (n,) bool each."""
    block = blocks(problem.table)
    return [problem.used & (block % 2 == parity) for parity in range(2)]


def diagnose_all(stride: int) -> list[Row]:
    """Print what is named on every set and its halves, and what a half's model leaves on the other."""
    cases: dict[str, Callable[[], Problem]] = {}
    if here("rts2_pointing"):
        cases["telescope"] = lambda: open_set(*telescope())
        cases |= {
            f"two axes, {frame}": lambda frame=frame: open_set(*plain_telescope(frame))
            for frame in ("trusted", "fitted")
        }
    if here("dlr_justin"):
        cases |= {f"Justin {side}": lambda side=side: open_set(*humanoid(side)) for side in SIDES}
    if here("ur10_ipa"):
        steps = {"A": stride, "B": 1, "C": 1, "D": 1}
        cases |= {f"UR10 {name}": lambda name=name: open_set(*ur10(name, steps[name])) for name in steps}
    return [row for name, load in cases.items() for row in _replicate(name, load())]


def diagnose_arms(clones: Path) -> list[Row]:
    """The same of two industrial arms."""
    rows = list[Row]()
    if (clones / real_arms.TX2).exists():
        for path in real_arms.PATHS:
            rows += _replicate(f"TX2 {path}", open_set(*real_arms.tx2(clones, path)))
    if (clones / real_arms.IRB120).exists():
        rows += _replicate("IRB 120", open_set(*real_arms.irb120(clones)))
    if not rows:
        print(f"arms: skipped, no clone in {clones}")
    return rows


def _replicate(name: str, problem: Problem) -> list[Row]:
    rows = [_look(name, "all", problem, np.ones(problem.table.rows, dtype=bool))]
    for index, half in enumerate(halves(problem)):
        rows.append(_look(name, f"half {index + 1}", problem, half))
    agree = _alike(rows[1]["suggested"], rows[2]["suggested"])
    print(f"  {name}: the halves name {'the same' if agree else 'different effects'}", flush=True)
    return rows


def _alike(one: Sequence[Sequence[str]], other: Sequence[Sequence[str]]) -> bool:
    """Whether each step of either has its like in the other: the same name, or a tie that holds it."""

    def met(steps: Sequence[Sequence[str]], others: Sequence[Sequence[str]]) -> bool:
        return all(any(set(step) & set(their) for their in others) for step in steps)

    return len(one) == len(other) and met(one, other) and met(other, one)


def _look(name: str, which: str, problem: Problem, shown: np.ndarray) -> Row:
    started = time.perf_counter()
    part = problem.masked(~shown)
    found = diagnose(Model(problem.file), part)
    named = [step[0] for step in found.suggested]
    row: Row = {
        "set": name, "rows": which, "verdict": found.verdict, "named": named, "words": found.words,
        "suggested": [list(step) for step in found.suggested], "seconds": time.perf_counter() - started,
    }  # fmt: skip
    hidden = problem.used & ~shown
    text = ""
    if hidden.any():
        plain, model = (fit(with_effects(problem, names), part) for names in ((), named))
        row["unseen_um"] = {"drawing": rms_um(plain, hidden), "model": rms_um(model, hidden)}
        text = "; other half {drawing:.0f} -> {model:.0f} um".format(**row["unseen_um"])
    told = " + ".join("/".join(step) for step in row["suggested"]) or "-"
    print(f"  {name:<14}{which:<8}{found.verdict:<17}{told}{text}  [{row['seconds']:.0f} s]", flush=True)
    return row


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*FOLDERS, []], metavar="PART")
    parser.add_argument("--stride", type=int, default=5, help="of UR10 series A")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--clones", type=Path, default=Path(), help="folder that real_arms.py's clones lie in")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    work: dict[str, Callable[[], list[Row] | None]] = {
        "telescope": lambda: telescope_terms() + telescope_drift(),
        "humanoid": lambda: humanoid_ladder() + humanoid_left_out(),
        "short": short_runs,
        "transfer": lambda: transfer(asked.stride),
        "diagnose": lambda: diagnose_all(asked.stride),
        "printers": klipper.main,
        "arms": lambda: diagnose_arms(asked.clones),
    }
    figures: dict[str, Any] = {}
    for part in asked.parts or work:
        folder = FOLDERS[part]
        if folder is not None and not here(folder):
            print(f"{part}: skipped, {folder} is not beside the project")
            continue
        try:
            figures[part] = work[part]()
        except PttError as error:
            print(f"{part}: {error}")
        if asked.out:
            asked.out.parent.mkdir(parents=True, exist_ok=True)
            asked.out.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
