"""Set-up mistakes on machines that nobody here built: named first, cured, and nobody accused who made none.

    python benchmarks/setup_mistakes.py --machines 20 --sound 300

Machines, paths, noise and tracker stations are drawn by the virtual machine's generators; a mistake is then made in the
files, as a person makes it. `named` counts runs whose first sure finding has the mistake's name or one that is the same
thing there, `cured` those whose cured files agree as well as the files before the mistake.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from setup_mistakes_cases import CASES, HAVE, Case
from setup_mistakes_runs import draw_run

from ptt.machine import MachineFile
from ptt.run.table import Table
from ptt.setup import Check, check_setup
from ptt.setup.rigid import align_many, rms
from ptt.setup.score import forward_many
from ptt.setup.setup import Setup


def with_columns(table: Table, have: str) -> Table:
    """The run with the columns that it has: targets and sliders, or one of them."""
    if have == "sliders":
        return table.replace(target=np.full_like(table.target, np.nan))
    return table.replace(command=None) if have == "targets" else table


def agreement(file: MachineFile, table: Table) -> np.ndarray:
    """Error of readings against targets and against commands, after a rigid motion, mm; zero without such columns."""
    setup = Setup(file, table)
    nothing = np.full((1, table.rows, 3), np.nan)
    sent = nothing if table.command is None else forward_many([setup])
    reading, lost = table.measured[None], np.zeros((1, table.rows), dtype=bool)
    found = [rms(align_many(place, reading, setup.free)[2], lost, 1.0)[0] for place in (table.target[None], sent)]
    return np.nan_to_num(np.array(found))


@dataclass(frozen=True)
class Tried:
    """A mistake on one machine.

    Attributes:
        found: what was found.
        named: whether its name came first.
        cured: whether the cured files agree as well as those before the mistake.
        shows: whether the mistake changes anything: a mirrored plane is a turned one, and does no harm.
        seconds: what it took.
    """

    found: Check
    named: bool
    cured: bool
    shows: bool
    seconds: float


def try_case(case: Case, have: str, seed: int) -> Tried:
    """Make the mistake on one drawn machine.

    Args:
        case: the mistake.
        have: which columns the run has.
        seed: of the machine.

    Returns:
        What came of it.
    """
    file, table = draw_run(seed)
    table = with_columns(table, have)
    before = agreement(file, table)
    made = case.make(file, table, np.random.default_rng([seed, 5]))
    start = time.perf_counter()
    found = check_setup(*made)
    took = time.perf_counter() - start
    names = case.names + (case.alone if have == "sliders" else ())
    named = bool(found.findings) and found.findings[0].mistake in names
    assert found.table is not None
    again = check_setup(found.file, found.table)
    cured = again.ok and bool((agreement(found.file, found.table) <= 1.5 * before + 0.1).all())
    mirrored = set(case.names) & {"axis-sign", "axes-swapped"}
    shows = not mirrored or bool((agreement(*made) > 1.5 * before + 0.1).any())
    return Tried(found, named, cured, shows, took)


def sound_runs(count: int) -> Iterator[tuple[int, str, Check]]:
    """Runs without any mistake."""
    for seed in range(count):
        file, table = draw_run(10_000 + seed, faults=seed % 4, rows=[None, 12, 30, None][seed % 4])
        have = HAVE[seed % 3]
        yield seed, have, check_setup(file, with_columns(table, have))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=20)
    parser.add_argument("--sound", type=int, default=300)
    parser.add_argument("--only", default="")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    print(f"{'mistake':<38}{'run has':<10}{'named':>10}{'cured':>10}{'ms':>7}")
    for case in CASES:
        for have in case.have if options.only in case.title else ():
            results = [try_case(case, have, seed) for seed in range(options.machines)]
            _print_case(case, have, results)
            if options.verbose:
                _print_misses(results)
    _print_sound(options.sound)


def _print_case(case: Case, have: str, results: list[Tried]) -> None:
    """One line: of the runs in which the mistake shows, how many were named and cured."""
    shows = [item for item in results if item.shows]
    named, cured = sum(item.named for item in shows), sum(item.cured for item in shows)
    took = 1e3 * float(np.median([item.seconds for item in results])) if results else 0.0
    count = len(shows)
    print(f"{case.title:<38}{have:<10}{named:>4} / {count:<3}{cured:>4} / {count:<3}{took:>7.0f}", flush=True)


def _print_misses(results: list[Tried]) -> None:
    for seed, item in enumerate(results):
        if item.shows and not (item.named and item.cured):
            print(f"    seed {seed}: named {item.named}, cured {item.cured}: {str(item.found)[:300]!r}")


def _print_sound(count: int) -> None:
    accused = [(seed, have, found) for seed, have, found in sound_runs(count) if found.findings]
    sure = sum(not item[2].ok for item in accused)
    print(f"sound runs accused: {len(accused)} of {count}; for certain: {sure}")
    for seed, have, found in accused:
        print(f"  seed {seed}, {have}: {found}")


if __name__ == "__main__":
    main()
