"""Whole processes of the verbs beside one that only imports torch, pandas and scipy: `python benchmarks/processes.py`.

Every round runs each of them once, one after the other; what counts is the processor time of a process and its
children, at the median of the rounds. The import alone is what any program with these packages takes.
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

DATA = Path(__file__).parent.parent / "data"
RUN, MACHINE = DATA / "sealed_one" / "run.csv", DATA / "sealed_one" / "machine.toml"
TARGETS = DATA / "sealed_one" / "targets.csv"
IMPORTS = "import torch, pandas, scipy.linalg, scipy.optimize"
VERBS = ("check", "compare", "diagnose", "predict")


def commands(folder: Path) -> dict[str, list[str]]:
    """What is run, by name; sliders are written into a folder."""
    own = {verb: ["-m", "ptt", verb, str(RUN), "--model", str(MACHINE), "--json"] for verb in VERBS}
    own["predict"][3:4] = [str(TARGETS)]
    own["predict"] += ["--out", str(folder / "sliders.csv")]
    return {"imports": ["-c", IMPORTS]} | own


def spent(words: list[str]) -> float:
    """Seconds of processor of one process; its byte code is kept, as it is wherever somebody works."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *words], check=True, capture_output=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Read the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as folder:
        every = commands(Path(folder))
        for words in every.values():  # the first one of each reads its files from the disk
            spent(words)
        seen = {name: list[float]() for name in every}
        for _ in range(rounds):
            for name, words in every.items():
                seen[name].append(spent(words))
    unit = statistics.median(seen["imports"])
    for name, times in seen.items():
        print(f"{name:10} {statistics.median(times):6.2f} s of processor, {statistics.median(times) / unit:5.2f} x")


if __name__ == "__main__":
    main()
