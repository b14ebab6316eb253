"""Machines measured twice: is what happened in between told rightly, and are stated differences as large as said?

    python benchmarks/histories.py --count 60 --start 100
    python benchmarks/histories.py --count 100 --start 100 --kind sound

Kinds in turn: sound, one value drifting, one fault repaired, something new. Right means: sound -> same; drifting ->
changed, and nothing but that value is named, or it is in a tie with the one named; repaired -> changed, in values of
that fault alone, one of them at least called repaired; new -> new, with no false change beside it. Machines whose first
run is not solved by the diagnosis give no model, so they are left out and counted. Solved models are kept in
out/histories; results go to --out.
"""

import argparse
import json
import time
import traceback
from pathlib import Path
from typing import Any

import numpy as np
import torch
from histories_draw import KINDS, History, draw_history

from ptt.again.recheck import recheck
from ptt.again.result import Recheck
from ptt.model.of_run import for_runs
from ptt.run.problem import build_problem


def run_history(seed: int, kind: str) -> dict[str, Any]:
    """Draw one, recheck it, and only then look at the truth."""
    row: dict[str, Any] = {"seed": seed, "kind": kind}
    try:
        history = draw_history(seed, kind)
        if history is None:
            return row | {"unsolved": True}
        began = time.perf_counter()
        problem = build_problem(history.model.file, history.table)
        model, _ = for_runs(history.model, problem)
        found = recheck(model, problem)
        return row | describe(history, found) | {"seconds": time.perf_counter() - began}
    except Exception as error:  # one broken case must not lose the others, and must show
        return row | {"error": f"{type(error).__name__}: {error}", "trace": traceback.format_exc(limit=-4)}


def describe(history: History, found: Recheck) -> dict[str, Any]:
    """What was said beside what is true."""
    return {
        "protocol": history.drawn.protocol,
        "noise": history.drawn.notes["noise"],
        "rows": found.rows,
        "outliers": len(found.outlier_rows),
        "effects": list(history.model.keys),
        "right_first": history.right_first,
        "what": history.what,
        "truth": history.parameter,
        "size": history.size,
        "verdict": found.verdict,
        "named": [
            [c.moved.effect, c.moved.name, c.moved.z, c.repaired, *c.indistinguishable_from] for c in found.changed
        ],
        "suggested": found.to_dict()["suggested"],
        "error_um": found.error_um,
        "notes": list(found.notes),
        "z": {f"{one.effect} {one.name}": one.z for one in found.parameters},
        "pull": pull(history, found),
        "right": right(history, found),
    }


def right(history: History, found: Recheck) -> bool:
    """Whether a history was told rightly."""
    effects = {item.moved.effect for item in found.changed}
    if history.kind == "sound":
        return found.verdict == "same"
    if history.kind == "new":
        return found.verdict == "new" and not found.changed
    if history.kind == "repaired":
        return found.verdict == "changed" and effects == {history.what} and any(c.repaired for c in found.changed)
    assert history.parameter is not None
    stem, leg, _ = history.parameter
    name = f"{stem} {leg}" if leg else stem
    if found.verdict != "changed" or len(found.changed) != 1:
        return False
    (change,) = found.changed
    own = (change.moved.effect, change.moved.name) == (history.what, name)
    return own or f"{history.what} {name}" in change.indistinguishable_from


def pull(history: History, found: Recheck) -> float | None:
    """A drift's stated difference less the true one, in stated standard errors."""
    if history.parameter is None:
        return None
    stem, leg, step = history.parameter
    name = f"{stem} {leg}" if leg else stem
    for one in found.parameters:
        if (one.effect, one.name) == (history.what, name):
            return (one.now - one.before - step) / one.std
    return None


def summary(rows: list[dict[str, Any]]) -> str:
    """The figures, one line a kind."""
    lines = []
    for kind in KINDS:
        mine = [row for row in rows if row["kind"] == kind and "right" in row]
        if not mine:
            continue
        wrong = [row["seed"] for row in mine if not row["right"]]
        verdicts = {name: sum(row["verdict"] == name for row in mine) for name in ("same", "changed", "new")}
        lines.append(f"{kind}: {len(mine) - len(wrong)} of {len(mine)} right; said {verdicts}; wrong: {wrong}")
    z = np.array([z for row in rows if row["kind"] == "sound" and "z" in row for z in row["z"].values()])
    if len(z):
        inside, far = np.mean(np.abs(z) < 2.0), np.sum(np.abs(z) > 4.0)
        lines.append(f"sound: {len(z)} differences, {inside:.1%} within 2 std, {far} beyond 4, rms {z.std():.2f}")
    pulls = np.array([row["pull"] for row in rows if row.get("pull") is not None])
    if len(pulls):
        inside, spread = np.mean(np.abs(pulls) < 2.0), np.sqrt(np.mean(pulls**2))
        lines.append(f"drifts: {len(pulls)} pulls, {inside:.1%} within 2, rms {spread:.2f}")
    lines.append(f"unsolved {sum('unsolved' in row for row in rows)}, broken {sum('error' in row for row in rows)}")
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="histories that are told")
    parser.add_argument("--start", type=int, default=100)
    parser.add_argument("--kind", choices=KINDS, help="one kind for all; else all in turn")
    parser.add_argument("--out", type=Path, default=Path("out/histories.json"))
    args = parser.parse_args()
    rows, seed = list[dict[str, Any]](), args.start
    while sum("unsolved" not in row for row in rows) < args.count:
        rows.append(run_history(seed, args.kind or KINDS[seed % len(KINDS)]))
        args.out.parent.mkdir(parents=True, exist_ok=True)
        args.out.write_text(json.dumps(rows, indent=1, default=float) + "\n")  # what is done is kept, whatever comes
        told, word = rows[-1], rows[-1].get("right", rows[-1].get("error", "unsolved"))
        print(
            seed, told["kind"], word, told.get("what", ""), told.get("verdict", ""), told.get("named", ""), flush=True
        )
        seed += 1
    print(summary(rows))


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
