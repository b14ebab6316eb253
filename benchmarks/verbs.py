"""Every verb on a long run: seconds, and the most memory that it and its workers hold.

    python benchmarks/verbs.py [--rows 1000000] [--keep FOLDER] [--only compare report] [--cores 0]

The runs are those of `million.py`, a second one of the same machine for `recheck` and whatever holds two runs beside
each other. Each verb prints one line as soon as it has ended; `report` comes last, because it takes longest. `fit` and
most that follow it need the model that `add` writes; `fleet` makes a store of both runs and works on them.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from million import MACHINE, make_run, measure

EFFECTS = ("backlash", "once-per-rev", "screw-growth")
GOAL_GB = 4.0
WRITTEN = ("sliders.csv", "simulated.csv")
RIG = """machine = "{machine}"
seed = 7
[conditions]
dwell_s = 1.0
[drive]
backlash_mm = [0.04, 0.05, 0.03]
"""


def commands(folder: Path, rows: int) -> dict[str, list[str]]:
    """What is run, by verb; runs that are not there yet are made."""
    one, two, solved = folder / f"run-{rows}.csv", folder / f"again-{rows}.csv", str(folder / f"solved-{rows}.toml")
    for path, seed in ((one, 5), (two, 6)):
        if not path.exists():
            make_run(path, rows, seed)
    run, again, drawing = str(one), str(two), str(MACHINE)
    (folder / "rig.toml").write_text(RIG.format(machine=MACHINE))
    sliders, simulated = (folder / path for path in WRITTEN)
    store, targets, comp = str(folder / "store"), str(folder / "targets.csv"), str(folder / "compensator")
    return {
        "check": ["check", run, "--model", drawing],
        "compare": ["compare", run, "--model", drawing],
        "compare, plots": ["compare", run, "--model", drawing, "--plots", str(folder / "plots")],
        "compare two": ["compare", run, "--after", again, "--model", drawing],
        "iso": ["iso", run, "--model", drawing],
        "diagnose": ["diagnose", run, "--model", drawing],
        "add": ["add", run, *EFFECTS, "--model", drawing, "--out", solved],
        "fit": ["fit", run, "--model", solved, "--out", str(folder / "fit.toml")],
        "remove": ["remove", run, EFFECTS[-1], "--model", solved, "--out", str(folder / "removed.toml")],
        "recheck": ["recheck", again, "--model", solved],
        "evaluate": ["evaluate", run, "--model", solved],
        "evaluate two": ["evaluate", run, again],
        "predict": ["predict", run, "--model", solved, "--out", str(sliders)],
        "train": ["train", run, "--machine", solved, "--out", comp],
        "predict, trained": ["predict", run, "--model", comp, "--out", str(sliders)],
        "simulate": ["simulate", str(folder / "rig.toml"), run, "--out", str(simulated)],
        "export": ["export", "--model", solved, "--to", "table", "--out", str(folder / "table"), "--run", run],
        "plan": ["plan", drawing, "--rows", str(rows), "--out", targets],
        "fleet init": ["fleet", "init", store],
        "fleet add": ["fleet", "add", store, "one", run, again, "--model", drawing],
        "fleet run": ["fleet", "run", store],
        "report": ["report", run, "--model", solved, "--out", str(folder / "report.html")],
    }


def main() -> None:
    """Read the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--keep", type=Path, help="make the runs here, or use them where they are there already")
    parser.add_argument("--only", nargs="+", help="these verbs alone")
    parser.add_argument("--cores", default="", help="as in 0,1; all by default")
    own = parser.parse_args()
    cores = [int(core) for core in own.cores.split(",") if core]
    with tempfile.TemporaryDirectory() as empty:
        folder = own.keep or Path(empty)
        folder.mkdir(parents=True, exist_ok=True)
        for verb, words in commands(folder, own.rows).items():
            if own.only and verb not in own.only:
                continue
            for path in WRITTEN:  # they hold readings, which no verb replaces
                (folder / path).unlink(missing_ok=True)
            seen = measure([sys.executable, "-m", "ptt.commands.main", *words, "--json"], cores)
            told = {key: round(float(seen[key]), 2) for key in ("wall_s", "cpu_s", "peak_gb")}
            sound = told["peak_gb"] < GOAL_GB and str(seen["text"]).startswith("{")
            print(json.dumps({"verb": verb, "rows": own.rows, **told, "sound": sound}), flush=True)


if __name__ == "__main__":
    main()
