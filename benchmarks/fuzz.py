"""Thousands of damaged inputs through the commands: what ends otherwise than with a result or with one clear line?

    python benchmarks/fuzz.py --cases 1000 --seed 1 [--out classes.json] [--only 137,204]

Every case is a fork of this process, so that torch is loaded once; what a case does to its process dies with it.

Classes:
    ok        a result, exit 0; or exit 3 with one clear line, or with rows that have their status
    refused   exit 2 (or 3) with one clear line, and nothing written
    internal  'unexpected ...', a traceback, another exit code, a crash
    wrong     silently: what the format forbids was accepted, or the same input written otherwise gave another result
    broken    an input or another file was changed, a part of an output was left, or we cannot read our own output
    unclear   refused, but in several lines, in one beyond 600 characters, with a control character, or without a word
    leak      a warning of numpy, pandas or torch, or a print, reached the user
    hang      still at work after the limit
"""

import argparse
import contextlib
import gc
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fuzz_commands import COMMANDS, PAGE
from fuzz_inputs import make_inputs
from fuzz_judge import BAD, STORE, Ended, digests, judge
from fuzz_mutations import mutate_file
from fuzz_page import run_page
from fuzz_words import mutate_words

LIMIT_S = 40.0  # processor seconds; the slowest sound case takes 6
WAIT_S = 120.0  # of the clock: what waits for a pipe uses no processor
MEMORY = Path("/dev/shm")  # where files cost no disk, if there is such a place


@dataclass(frozen=True)
class Outcome:
    """One case: what was done, how it ended, and why that is a defect, if it is one."""

    case: int
    words: str
    mutation: str
    verdict: str
    code: int
    kind: str
    why: str
    error: str
    seconds: float


def load_commands() -> None:
    """Import what the verbs import, once, before any case is forked."""
    import importlib
    import pkgutil

    import ptt.commands

    for name in ("torch", "pandas", "scipy.optimize", "scipy.linalg", "nets"):
        importlib.import_module(name)
    for package in (
        "correct",
        "diagnosis",
        "judge",
        "run",
        "fitting",
        "dependence",
        "plan",
        "rig",
        "setup",
        "effects",
        "model",
        "again",
        "door",
        "fleet",
        "show.fleet",
        "show.studio",
    ):
        root = importlib.import_module(f"ptt.{package}")
        for each in pkgutil.walk_packages(root.__path__, f"ptt.{package}."):
            importlib.import_module(each.name)
    for each in pkgutil.iter_modules(ptt.commands.__path__, "ptt.commands."):
        importlib.import_module(each.name)


def run_words(words: list[str]) -> int:
    """One verb in this process, as the program runs it; or a job of the studio's page."""
    from ptt.commands.main import run

    return run_page(words[1:]) if words[:1] == [PAGE] else run(words)


def fork_words(words: list[str], place: Path, logs: Path) -> Ended:
    """Run one verb in a fork, within its limits.

    Args:
        words: the command line.
        place: its working folder.
        logs: folder for what it prints.

    Returns:
        How it ended; code -1 where it was stopped at the limit.
    """
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        _be_the_case(words, place, logs)
    deadline, status = time.monotonic() + WAIT_S, None
    while status is None:
        done, code, usage = os.wait4(child, os.WNOHANG)
        if done:
            status = os.waitstatus_to_exitcode(code)
        elif time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            _, code, usage = os.wait4(child, 0)
            status = -1
        else:
            time.sleep(0.003)
    status = -1 if status in (-signal.SIGXCPU, -signal.SIGKILL) else status
    texts = [(logs / name).read_text(errors="replace") for name in ("out", "err")]
    return Ended(status, *texts, usage.ru_utime + usage.ru_stime)


def require_done(words: list[str], place: Path, logs: Path) -> str:
    """What a command line prints on sound inputs.

    Raises:
        RuntimeError: it fails.
    """
    ended = fork_words(words, place, logs)
    if ended.code:
        raise RuntimeError(f"{' '.join(words)} fails on sound inputs: exit {ended.code}, {ended.err[-500:]}")
    return ended.out


def _be_the_case(words: list[str], place: Path, logs: Path) -> None:
    code = 70
    try:
        os.setsid()
        os.chdir(place)
        resource.setrlimit(resource.RLIMIT_CPU, (int(LIMIT_S), int(LIMIT_S) + 2))
        # No device of the machine is within reach: an administrator's rename would put an end to it.
        for number, name in ((0, str(logs / "in")), (1, str(logs / "out")), (2, str(logs / "err"))):
            handle = os.open(name, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o644)
            os.dup2(handle, number)
        sys.stdin = open(0)  # noqa: SIM115
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        code = run_words(words)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code if isinstance(code, int) and 0 <= code < 256 else 71)


class Fuzzer:
    """Sound inputs in a folder, and the results that they give, for comparison."""

    def __init__(self, root: Path, fleet: bool = True) -> None:
        """Make the inputs in `root`; without a fleet where DuckDB was loaded before, which no fork survives."""
        self.commands = [each for each in COMMANDS if fleet or each[0][0] != "fleet"]
        self.base, self.place, self.logs = root / "base", root / "place", root / "logs"
        for each in (self.base, self.logs):
            each.mkdir(parents=True)
        make_inputs(self.base, lambda words: require_done(words, self.base, self.logs), fleet)
        self._known: dict[str, str] = {}

    def fresh(self, words: Sequence[str] = ()) -> None:
        """A place with the sound inputs in it; the fleet's store, which is large, only where it is used."""
        shutil.rmtree(self.place, ignore_errors=True)
        unused = () if words[:1] == ["fleet"] else (STORE,)
        shutil.copytree(self.base, self.place, ignore=shutil.ignore_patterns(*unused))

    def require_sound(self) -> None:
        """Every command line works as long as nothing is damaged.

        Raises:
            RuntimeError: one does not: the fuzzer would take its refusal for an answer to the damage.
        """
        for words, *_ in self.commands:
            self.sound(words)

    def sound(self, words: list[str]) -> str:
        """What a command line prints on sound inputs."""
        key = " ".join(words)
        if key not in self._known:
            with tempfile.TemporaryDirectory(dir=self.logs) as folder:
                place = Path(folder) / "sound"
                shutil.copytree(self.base, place)
                self._known[key] = require_done(words, place, self.logs)
        return self._known[key]

    def case(self, number: int, seed: int) -> Outcome:
        """Draw, run and judge one case.

        Args:
            number: of the case.
            seed: of the sweep; both together draw the case.

        Returns:
            The outcome.
        """
        rng = random.Random(f"{seed}/{number}")
        words, inputs, out, _ = rng.choices(self.commands, [weight for *_, weight in self.commands])[0]
        self.fresh(words)
        if rng.random() < 0.2 and words[0] != PAGE:
            words, mutation = mutate_words(words, self.place, rng)
        else:
            mutation = mutate_file(self.place / rng.choice(inputs), rng)
        if words[:2] == [PAGE, "peek"]:  # it shows cells as they are and reads none
            mutation = replace(mutation, verdict="")
        told = words[0] in ("fleet", "report")  # they say the digests of their inputs
        expected = self.sound(words) if mutation.verdict == "same" and not told else None
        before = digests(self.place)
        ended = fork_words(words, self.place, self.logs)
        kind, why = judge(ended, mutation, words, out, before, self.place, expected)
        error = ended.err.strip()[-700:]
        return Outcome(number, " ".join(words)[:300], mutation.words, mutation.verdict, ended.code, kind, why, error,
                       round(ended.seconds, 2))  # fmt: skip


def sweep(root: Path, cases: list[int], seed: int, tell: bool = True) -> list[Outcome]:
    """Run cases one after the other.

    Args:
        root: an empty folder to work in.
        cases: their numbers.
        seed: of the sweep.
        tell: whether defects are printed as they are found.

    Returns:
        One outcome each.
    """
    load_commands()
    gc.freeze()  # what is loaded stays shared between the forks
    fuzzer, outcomes = Fuzzer(root), []
    fuzzer.require_sound()
    for number in cases:
        outcome = fuzzer.case(number, seed)
        outcomes.append(outcome)
        if tell and not len(outcomes) % 500:
            print(f"{len(outcomes)} cases: {dict(Counter(each.kind for each in outcomes))}", flush=True)
        if tell and outcome.kind in BAD:
            print(
                f"{number} {outcome.kind}: {outcome.words[:110]} | {outcome.mutation[:90]} | {outcome.why[:220]}",
                flush=True,
            )
    return outcomes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    cases = [int(word) for word in given.only.split(",") if word] or list(range(given.first, given.first + given.cases))
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        started = time.monotonic()
        outcomes = sweep(Path(folder) / "fuzz", cases, given.seed)
    counts = Counter(outcome.kind for outcome in outcomes)
    print({kind: counts.get(kind, 0) for kind in ("ok", "refused", *BAD)}, f"{time.monotonic() - started:.0f} s")
    if given.out:
        given.out.write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1))
    if given.only:
        for outcome in outcomes:
            print(json.dumps(asdict(outcome), indent=1, ensure_ascii=False))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
