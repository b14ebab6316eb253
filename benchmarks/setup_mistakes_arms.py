"""Set-up mistakes of serial arms on drawn arms: named first, cured, and nobody accused who made none.

    python -m benchmarks.setup_mistakes_arms --machines 20 --sound 100

Arms are random: five to seven joints, each turned by 0, 90 or -90 degrees against the one before, links and offsets of
50 to 700 mm, ordinary faults in them. The virtual machine measures; a mistake is then made in the columns, as a person
makes it. Zeros of the first and the last joint are the station's and the reflector's: no reading can tell them.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from ptt.machine import JointSpec, MachineFile, SerialSpec
from ptt.machine_schema import TrackerSpec
from ptt.rig.draw_arm import ARM_FAULTS, draw_arm
from ptt.run.table import Table, make_table
from ptt.setup import check_setup

Random = np.random.Generator
Change = Callable[[Table, Random], Table]


def random_arm(random: Random) -> SerialSpec:
    """An arm that reaches in all directions: neighbours of equal axes are rare, and every joint has a lever."""
    joints = int(random.integers(5, 8))
    twist = random.choice([0.0, 90.0, -90.0], p=[0.3, 0.35, 0.35], size=joints)
    twist[0] = random.choice([90.0, -90.0])
    reach = random.uniform(0.5, 1.5)
    joint = [
        JointSpec(
            a_mm=float(np.round(reach * random.choice([0.0, random.uniform(60, 600)]), 1)),
            alpha_deg=float(alpha),
            d_mm=float(np.round(reach * random.choice([0.0, random.uniform(50, 400)]), 1)),
            theta_offset_deg=float(random.choice([0.0, 90.0, -90.0])),
            limits_deg=(-170.0, 170.0),
        )
        for alpha in twist
    ]
    tool = tuple(float(value) for value in np.round(random.uniform(40, 160, 3), 1))
    return SerialSpec(kind="serial", name="drawn", convention="standard", tool_mm=tool, joint=tuple(joint))


def draw_run(seed: int) -> tuple[MachineFile, Table]:
    """A sound set-up of a drawn arm with an ordinary fault or none.

    Args:
        seed: of everything.

    Returns:
        The drawing and the run.
    """
    random = np.random.default_rng([seed, 77])
    spec = random_arm(random)
    run = draw_arm(spec, str(random.choice(list(ARM_FAULTS))), seed)  # type: ignore[arg-type]
    file = MachineFile(machine=run.rig.spec, tracker=TrackerSpec(frame="fitted", tool="fitted"))
    table = make_table(
        None, run.q, run.readings, joint_prefix="q", temp_c=run.temp_c, payload_kg=run.payload_kg, time_s=run.time_s
    )
    return file, table


def _sent(change: Callable[[np.ndarray, Random], np.ndarray]) -> Change:
    return lambda table, random: table.replace(command=change(np.asarray(table.command), random))


def _read(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda table, random: table.replace(measured=change(table.measured))


def _later(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Rows from some row between a quarter and three on."""

    def moved(table: Table, random: Random) -> Table:
        first, measured = int(random.uniform(0.25, 0.75) * table.rows), table.measured.copy()
        measured[first:] = change(measured[first:])
        return table.replace(measured=measured)

    return moved


def _swap(q: np.ndarray, random: Random) -> np.ndarray:
    order = np.arange(q.shape[1])
    one, other = random.choice(q.shape[1], 2, replace=False)
    order[[one, other]] = other, one
    return q[:, order]


def _one(q: np.ndarray, random: Random) -> np.ndarray:
    """One joint between the first and the last."""
    return np.eye(q.shape[1])[int(random.integers(1, q.shape[1] - 1))]


CASES: dict[str, tuple[Change, set[str]]] = {
    "two joints interchanged": (_sent(_swap), {"joint-order"}),
    "a joint turning the other way": (_sent(lambda q, r: q * (1.0 - 2.0 * _one(q, r))), {"joint-sign"}),
    "a zero off by 90 deg": (_sent(lambda q, r: q + 0.5 * np.pi * _one(q, r)), {"joint-sign"}),
    "degrees in rad columns": (_sent(lambda q, r: np.degrees(q)), {"angle-unit"}),
    "radians in deg columns": (_sent(lambda q, r: np.radians(q)), {"angle-unit"}),
    "one axis of the readings negated": (_read(lambda p: p * [1.0, 1.0, -1.0]), {"axis-sign", "axes-swapped"}),
    "readings in inches": (_read(lambda p: p / 25.4), {"unit-scale"}),
    "readings in metres": (_read(lambda p: p / 1e3), {"unit-scale"}),
    "the tracker moved by 30 mm halfway": (_later(lambda p: p + np.array([18.0, -24.0, 0.0])), {"wrong-reflector"}),
    "the tracker set up anew halfway": (_later(lambda p: p[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]), {"wrong-reflector"}),
    "readings a row late": (_read(lambda p: np.vstack([p[:1], p[:-1]])), {"row-shift"}),
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=20)
    parser.add_argument("--sound", type=int, default=100)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    print(f"{'mistake':<36}{'named':>10}{'cured':>10}{'ms':>7}")
    for title, (change, names) in CASES.items():
        named = cured = 0
        took = []
        for seed in range(options.machines):
            file, table = draw_run(seed)
            made = change(table, np.random.default_rng([seed, 5]))
            start = time.perf_counter()
            found = check_setup(file, made)
            took.append(1e3 * (time.perf_counter() - start))
            right = bool(found.findings) and found.findings[0].mistake in names
            whole = found.table is not None and check_setup(found.file, found.table).ok
            named, cured = named + right, cured + (right and whole)
            if options.verbose and not (right and whole):
                print(f"    seed {seed}: {str(found)[:300]!r}")
        count = options.machines
        print(f"{title:<36}{named:>4} / {count:<3}{cured:>4} / {count:<3}{np.median(took):>7.0f}", flush=True)
    accused = [
        (seed, found) for seed in range(options.sound) if (found := check_setup(*draw_run(1000 + seed))).findings
    ]
    print(f"sound arms accused: {len(accused)} of {options.sound}")
    for seed, found in accused:
        print(f"  seed {1000 + seed}: {found}")


if __name__ == "__main__":
    main()
