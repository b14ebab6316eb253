"""Kill -9 at random moments of writing verbs: what is there must be the old or the new, whole, and the next run clean.

    python benchmarks/kill.py --kills 200 --seed 1

Every run is a fork, so that torch is loaded once. Half of the kills come at a random time, half at a random step
of the writing itself (a file or folder opened, renamed, removed), where a write that is not whole would show.

Counts: whole (old or new), mixed (neither), stray (the run after left a temporary), failed (the run after fails).
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fuzz import fork_words, load_commands, require_done, run_words
from fuzz_inputs import make_inputs

STEPS = ("open", "os.rename", "os.chmod", "os.mkdir", "os.remove", "os.rmdir", "tempfile.mkstemp", "tempfile.mkdtemp")
# What is run first (its output is the old one), what is killed, and where it writes.
VERBS: dict[str, tuple[list[str], list[str], str]] = {
    "add": (
        ["add", "also.csv", "link-length", "--model", "machine.toml", "--out", "out.toml"],
        ["add", "run.csv", "tower-tilt", "--model", "machine.toml", "--out", "out.toml"],
        "out.toml",
    ),
    "train": (
        ["train", "also.csv", "--machine", "machine.toml", "--out", "folder"],
        ["train", "run.csv", "--machine", "model.toml", "--out", "folder"],
        "folder",
    ),
    "predict": (
        ["predict", "targets.csv", "--model", "machine.toml", "--out", "out.csv"],
        ["predict", "targets.csv", "--model", "model.toml", "--out", "out.csv"],
        "out.csv",
    ),
    "report": (
        ["report", "also.csv", "--model", "machine.toml", "--out", "out.html"],
        ["report", "run.csv", "--model", "model.toml", "--out", "out.html"],
        "out.html",
    ),
    "export-c": (
        ["export", "--model", "machine.toml", "--to", "c", "--out", "folder"],
        ["export", "--model", "model.toml", "--to", "c", "--out", "folder"],
        "folder",
    ),
    "export-linuxcnc": (
        ["export", "--model", "machine.toml", "--to", "linuxcnc", "--step", "30", "--out", "folder"],
        ["export", "--model", "model.toml", "--to", "linuxcnc", "--step", "30", "--out", "folder"],
        "folder",
    ),
    "export-klipper": (
        ["export", "--model", "machine.toml", "--to", "klipper", "--out", "printer.cfg"],
        ["export", "--model", "model.toml", "--to", "klipper", "--out", "printer.cfg"],
        "printer.cfg",
    ),
    "export-table": (
        ["export", "--model", "machine.toml", "--to", "table", "--step", "30", "--out", "out.csv"],
        ["export", "--model", "model.toml", "--to", "table", "--step", "30", "--out", "out.csv"],
        "out.csv",
    ),
    "program": (
        ["program", "part.ngc", "--model", "machine.toml", "--out", "out.ngc"],
        ["program", "part.ngc", "--model", "model.toml", "--out", "out.ngc"],
        "out.ngc",
    ),
    "check": (
        ["check", "also.csv", "--model", "machine.toml", "--out-run", "out.csv"],
        ["check", "run.csv", "--model", "machine.toml", "--out-run", "out.csv"],
        "out.csv",
    ),
    "simulate": (
        ["simulate", "rig.toml", "targets.csv", "--seed", "5", "--out", "out.csv"],
        ["simulate", "rig.toml", "targets.csv", "--seed", "6", "--out", "out.csv"],
        "out.csv",
    ),
    "fleet": (
        ["fleet", "init", "store"],
        ["fleet", "add", "store", "bench", "run.csv", "--model", "model.toml"],
        "store",
    ),
}


# What has to be there before the first; and the verbs whose new output is the same bit for bit each time.
BEFORE: dict[str, tuple[list[str], ...]] = {
    "fleet-run": (
        ["fleet", "init", "store"],
        ["fleet", "add", "store", "bench", "run.csv", "--model", "model.toml", "--date", "2026-01-02"],
    )
}
VERBS["fleet-run"] = (
    ["fleet", "add", "store", "bench", "also.csv", "--date", "2026-02-02"],
    ["fleet", "run", "store"],
    "store",
)
SAME = ("predict", "export-c", "export-linuxcnc", "export-klipper", "export-table", "program", "check", "simulate")


@dataclass(frozen=True)
class Kill:
    """One kill: of what, at what moment, and what was found after it."""

    verb: str
    moment: str
    found: str
    why: str


@dataclass
class Prepared:
    """A verb with its old output in a folder, its steps of writing and its time counted, and what whole looks like."""

    place: Path
    words: list[str]
    out: str
    steps: int
    seconds: float
    new: dict[str, str]


class Killer:
    """Sound inputs, and every verb's old output, to be killed over and over."""

    def __init__(self, root: Path, verbs: list[str], base: Path | None = None) -> None:
        """Make old outputs below `root`, and inputs where no folder of them is given."""
        self.root, self.logs = root, root / "logs"
        self.logs.mkdir(parents=True)
        if base is not None:
            shutil.copytree(base, root / "base")
        else:
            (root / "base").mkdir()
            make_inputs(root / "base", lambda words: require_done(words, root / "base", self.logs), fleet=False)
        self.prepared = {verb: self._prepare(verb) for verb in verbs}

    def _prepare(self, verb: str) -> Prepared:
        first, words, out = VERBS[verb]
        place = self.root / verb
        shutil.copytree(self.root / "base", place)
        for each in (*BEFORE.get(verb, ()), first):
            require_done(each, place, self.logs)
        trial = self.root / "trial"
        shutil.copytree(place, trial)
        count, started = self.root / "count", time.monotonic()
        _finish(_fork_killed(words, trial, None, count))
        seconds, new = time.monotonic() - started, _state(trial / out)
        shutil.rmtree(trial)
        return Prepared(place, words, out, max(1, int(count.read_text())), seconds, new)

    def kill(self, verb: str, rng: random.Random) -> Kill:
        """Kill a verb once and look at what it left.

        Args:
            verb: a key of `VERBS`.
            rng: where chance comes from.

        Returns:
            What was found.
        """
        ready = self.prepared[verb]
        place = self.root / "killed"
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(ready.place, place)
        old = _state(place / ready.out)
        step = rng.randrange(1, ready.steps + 1) if rng.random() < 0.5 else None
        child = _fork_killed(ready.words, place, step, self.root / "count")
        moment = f"step {step} of {ready.steps}"
        if step is None:
            wait = rng.uniform(0.0, ready.seconds)
            time.sleep(wait)
            moment = f"{wait:.2f} of {ready.seconds:.2f} s"
            os.kill(child, signal.SIGKILL)
        _finish(child)
        whole = _whole(place, ready, verb, old, self.logs)
        if whole:
            return Kill(verb, moment, "mixed", whole)
        after = fork_words(ready.words, place, self.logs)
        if after.code:
            return Kill(verb, moment, "failed", after.err[-300:])
        stray = [each.name for each in place.iterdir() if each.name.startswith(f".{ready.out}.")]
        return Kill(verb, moment, "stray" if stray else "whole", ", ".join(stray))


def _fork_killed(words: list[str], place: Path, step: int | None, count: Path) -> int:
    """Start a verb in a fork that ends itself at a step of writing; without a step it counts them."""
    child = os.fork()
    if child:
        return child
    seen = 0

    def hook(event: str, given: tuple[object, ...]) -> None:
        nonlocal seen
        if event in STEPS and not (event == "open" and isinstance(given[1], str) and given[1].startswith("r")):
            seen += 1
            if seen == step:
                os.kill(os.getpid(), signal.SIGKILL)

    try:
        os.chdir(place)
        null = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1, 2):
            os.dup2(null, number)
        if step is None:
            sys.addaudithook(hook)
            run_words(words)
            done = seen
            Path(count).write_text(str(done))
        else:
            sys.addaudithook(hook)
            run_words(words)
    finally:
        os._exit(0)


def _finish(child: int) -> None:
    os.waitpid(child, 0)


def _state(path: Path) -> dict[str, str]:
    """Digests of a file, or of what a folder holds."""
    files = [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file())
    return {str(each.relative_to(path.parent)): hashlib.sha256(each.read_bytes()).hexdigest() for each in files}


def _whole(place: Path, ready: Prepared, verb: str, old: dict[str, str], logs: Path) -> str:
    """'' where an output is the old one bit for bit, or a new one that is whole; else what is wrong with it."""
    path = place / ready.out
    if not path.exists():
        return "the old one is gone"
    state = _state(path)
    if state == old or state == ready.new:
        return ""
    if verb in SAME:
        apart = sorted(name for name in state if state[name] not in (old.get(name), ready.new.get(name)))
        return f"neither the old one nor the new: {', '.join(apart) or 'of both'}"
    if verb == "report":
        text = path.read_text()
        return "" if text.rstrip().endswith("</html>") and len(text) > 50_000 else "a part of a page"
    words = (
        ["fleet", "show", ready.out, "--json"]
        if verb.startswith("fleet")
        else ["predict", "targets.csv", "--model", ready.out, "--out", "x.csv"]
    )
    ended = fork_words(words, place, logs)
    (place / "x.csv").unlink(missing_ok=True)
    return ended.err[-300:] if ended.code else ""


def sweep(
    root: Path, kills: int, seed: int, verbs: list[str], tell: bool = True, base: Path | None = None
) -> list[Kill]:
    """Kill verbs one after the other.

    Args:
        root: an empty folder to work in.
        kills: how often.
        seed: of the moments.
        verbs: which.
        tell: whether defects are printed as they are found.
        base: a folder of sound inputs; None makes one.

    Returns:
        What each kill left.
    """
    load_commands()
    killer, rng, found = Killer(root, verbs, base), random.Random(seed), []
    for number in range(kills):
        one = killer.kill(verbs[number % len(verbs)], rng)
        found.append(one)
        if tell and one.found != "whole":
            print(number, one, flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verbs", nargs="*", default=list(VERBS))
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        started = time.monotonic()
        found = sweep(Path(folder) / "kill", given.kills, given.seed, given.verbs)
    counts = Counter((one.verb, one.found) for one in found)
    print(
        {f"{verb} {kind}": count for (verb, kind), count in sorted(counts.items())},
        f"{time.monotonic() - started:.0f} s",
    )
    if given.out:
        given.out.write_text(json.dumps([vars(one) for one in found], indent=1))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
