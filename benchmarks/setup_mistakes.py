"""Set-up mistakes on machines that nobody here built: named first, cured, and nobody accused who made none.

    python -m benchmarks.setup_mistakes --machines 20 --sound 300

Machines, paths, noise and tracker stations are drawn by the virtual machine's generators; a mistake is then made in the
files, as a person makes it. `named` counts runs whose first sure finding has the mistake's name or one that is the same
thing there, `cured` those whose cured files agree as well as the files before the mistake.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ptt.machine import MachineFile, ThreePttSpec
from ptt.rig.draw_faults import KNOWN, Scene
from ptt.rig.draw_foreign import draw_foreign
from ptt.rig.draw_odd import UNKNOWN
from ptt.rig.nominal import ideal_machine
from ptt.rig.rig import Rig, parse_rig
from ptt.rig.schema import Section
from ptt.rig.simulate import simulate
from ptt.run.table import Table, make_table, take_rows
from ptt.setup import Check, check_setup
from ptt.setup.rigid import align_many, rms
from ptt.setup.score import forward_many
from ptt.setup.setup import Setup

Random = np.random.Generator
Make = Callable[[MachineFile, Table, Random], tuple[MachineFile, Table]]
HAVE = ("both", "sliders", "targets")
SENT = ("both", "sliders")
MIRRORS = ("axis-sign", "axes-swapped", "slider-order")


@dataclass(frozen=True)
class Case:
    """A mistake as people make it.

    Attributes:
        title: in words.
        names: what it may be called.
        make: how it is made.
        have: which columns a run needs for it to be seen.
        alone: names that are the same thing where the run has no targets.
    """

    title: str
    names: tuple[str, ...]
    make: Make
    have: tuple[str, ...] = HAVE
    alone: tuple[str, ...] = ()


@lru_cache(maxsize=64)
def draw_run(seed: int, faults: int = 1, rows: int | None = None) -> tuple[MachineFile, Table]:
    """A sound set-up: a foreign machine with ordinary faults, unknown ones among them, measured from anywhere.

    Args:
        seed: of everything.
        faults: how many.
        rows: about how many readings; None lets the seed choose.

    Returns:
        The drawing and the run.
    """
    random = np.random.default_rng([seed, 404])
    protocol = str(random.choice(["path", "volume", "payload", "warmup", "speed"]))
    drawn = draw_foreign(seed, protocol, rows=rows or int(np.exp(random.uniform(np.log(24), np.log(600)))))  # type: ignore[arg-type]
    rig = drawn.rig
    for _ in range(faults):
        rig = _harm(rig, protocol, random, drawn.room)
    frame = simulate(rig, drawn.targets).frame
    columns = {title: frame[title].to_numpy() for title in frame.columns if title not in drawn.absent}
    return rig.machine, _stand_anywhere(_tabulate(columns), rig.machine, random)


def _harm(rig: Rig, protocol: str, random: Random, room: np.ndarray) -> Rig:
    """One fault more, of the library or of none, up to 1 mm."""
    kinds = (UNKNOWN, KNOWN) if random.random() < 0.3 else (KNOWN,)
    fits = next(found for kind in kinds if (found := [item for item in kind if protocol in item.protocols]))
    item = fits[int(random.integers(len(fits)))]
    values = item.draw(random, Scene(ideal_machine(rig.spec), rig.spec, room))
    values = {key: value for key, value in values.items() if not key.endswith("_share")}
    if item.section == "odd":
        content = {key: value for key, value in rig.spec.model_dump(mode="json").items() if value is not None}
        return replace(rig, odd=(*rig.odd, *parse_rig({"machine": content, "odd": [values]}).odd))
    section: Section = getattr(rig, item.section)
    changed = type(section).model_validate({**section.model_dump(exclude_defaults=True), **values})
    return replace(rig, **{item.section: changed})


def _tabulate(columns: dict[str, np.ndarray]) -> Table:
    def block(titles: list[str]) -> np.ndarray | None:
        return np.column_stack([columns[title] for title in titles]) if titles[0] in columns else None

    extra: dict[str, Any] = {key: columns.get(key) for key in ("time_s", "payload_kg", "temp_c", "feed_mm_s")}
    names = np.array([str(name) for name in columns.get("name", [])])
    blocks = [block([f"{axis}_cmd" for axis in "xyz"]), block([f"b{leg}_cmd" for leg in (1, 2, 3)])]
    blocks.append(block([f"{axis}_meas" for axis in "xyz"]))
    table = make_table(*blocks, **{key: value for key, value in extra.items() if value is not None})
    role = np.array([str(value) for value in columns.get("role", ["pose"] * table.rows)])
    return table.replace(role=role, name=names if len(names) else table.name)


def _stand_anywhere(table: Table, file: MachineFile, random: Random) -> Table:
    """Half of the stations stand turned about z anywhere in the hall, a few of them lie on their side."""
    if file.tracker.frame == "trusted" or random.random() < 0.5:
        return table
    turn = _turn(random, upright=random.random() < 0.8)
    return table.replace(measured=table.measured @ turn.T + random.uniform(-4000.0, 4000.0, 3))


def _turn(random: Random, upright: bool) -> np.ndarray:
    if upright:
        angle = random.uniform(-np.pi, np.pi)
        return np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    square, _ = np.linalg.qr(random.standard_normal((3, 3)))
    return square * np.sign(np.linalg.det(square))


def _spec(file: MachineFile) -> ThreePttSpec:
    assert isinstance(file.machine, ThreePttSpec)
    return file.machine


def _read(change: Callable[[np.ndarray, Random], np.ndarray]) -> Make:
    return lambda file, table, random: (file, table.replace(measured=change(table.measured, random)))


def _want(change: Callable[[np.ndarray, Random], np.ndarray]) -> Make:
    return lambda file, table, random: (file, table.replace(target=change(table.target, random)))


def _send(change: Callable[[np.ndarray, Random], np.ndarray]) -> Make:
    def make(file: MachineFile, table: Table, random: Random) -> tuple[MachineFile, Table]:
        assert table.command is not None
        return file, table.replace(command=change(table.command, random))

    return make


def _draw(change: Callable[[ThreePttSpec, Random], dict[str, Any]]) -> Make:
    def make(file: MachineFile, table: Table, random: Random) -> tuple[MachineFile, Table]:
        spec = _spec(file)
        return replace(file, machine=spec.model_copy(update=change(spec, random))), table

    return make


def _column(name: str, values: Callable[[Table, Random], np.ndarray]) -> Make:
    return lambda file, table, random: (file, table.replace(**{name: values(table, random)}))


def _missed(measured: np.ndarray, random: Random) -> np.ndarray:
    at = int(random.integers(len(measured) // 5, 4 * len(measured) // 5))
    return np.vstack([measured[:at], measured[at + 1 :], np.full((1, 3), np.nan)])


def _block(measured: np.ndarray, random: Random) -> np.ndarray:
    size = int(random.integers(max(4, len(measured) // 20), max(6, len(measured) // 3)))
    start = int(random.integers(0, len(measured) - size))
    away = random.standard_normal(3)
    moved = measured.copy()
    moved[start : start + size] += away / np.linalg.norm(away) * random.uniform(12.0, 60.0)
    return moved


def _one_down(command: np.ndarray, random: Random) -> np.ndarray:
    leg, whole = int(random.integers(3)), random.uniform(300.0, 900.0)
    return np.where(np.arange(3) == leg, whole - command, command)


def _radius(spec: ThreePttSpec, random: Random) -> dict[str, Any]:
    """Diameters for both radii, or for one where the links still reach."""
    for keys in (("platform_radius_mm",), ("base_radius_mm",), ("base_radius_mm", "platform_radius_mm")):
        changes = {key: 2.0 * getattr(spec, key) for key in keys}
        after = spec.model_copy(update=changes)
        if 5.0 < abs(after.base_radius_mm - after.platform_radius_mm) < 0.9 * spec.link_length_mm:
            return changes
    return {"platform_radius_mm": 2.0 * spec.platform_radius_mm}


def _temperature(scale: float, offset: float) -> Make:
    def values(table: Table, random: Random) -> np.ndarray:
        warm = table.temp_c
        rise = np.linspace(0.0, random.uniform(0.0, 8.0), table.rows)
        warm = 20.0 + random.uniform(-3.0, 3.0) + rise if warm is None else warm
        return warm * scale + offset

    return _column("temp_c", values)


def _load(factor: float) -> Make:
    def values(table: Table, random: Random) -> np.ndarray:
        levels = np.sort(random.choice(np.arange(1, 13), 3, replace=False)) * 0.5 * np.array([0.0, 1.0, 1.0])
        return np.repeat(levels, -(-table.rows // 3))[: table.rows] * factor

    return _column("payload_kg", values)


def _clock(table: Table, random: Random) -> np.ndarray:
    seconds = table.time_s if table.time_s is not None else np.arange(table.rows) * random.uniform(2.0, 30.0)
    return 1000.0 * seconds


def _shuffle(file: MachineFile, table: Table, random: Random) -> tuple[MachineFile, Table]:
    clock = table.time_s if table.time_s is not None else np.arange(table.rows) * 3.0
    timed = table.replace(time_s=clock)
    return file, take_rows(timed, np.lexsort(np.nan_to_num(timed.measured).T))


def _other_order(file: MachineFile, table: Table, random: Random) -> tuple[MachineFile, Table]:
    """Readings joined to the poses in another order; those of the base have names of their own."""
    rows = np.flatnonzero(table.role != "base")
    reading = table.measured.copy()
    reading[rows] = reading[random.permutation(rows)]
    return file, table.replace(measured=reading)


def _letters(file: MachineFile, table: Table, random: Random) -> tuple[MachineFile, Table]:
    names = np.array([f"P{row + 1}" for row in range(table.rows)])
    return file, take_rows(table.replace(name=names, time_s=None), np.argsort(names, kind="stable"))


def _noise(file: MachineFile, table: Table, random: Random) -> tuple[MachineFile, Table]:
    tracker = file.tracker.model_copy(update={"sigma_mm": 5.0})
    rows = np.repeat(np.arange(min(table.rows, 60)), 3)
    again = take_rows(table, rows)
    return replace(file, tracker=tracker), again.replace(
        measured=again.measured + random.normal(0.0, 0.005, again.measured.shape), std=None
    )


def _frame(target: np.ndarray, random: Random) -> np.ndarray:
    return target @ _turn(random, upright=True).T + random.uniform(-80.0, 80.0, 3)


def _swap_xy(points: np.ndarray, random: Random) -> np.ndarray:
    return points[:, [1, 0, 2]]


def _negate(points: np.ndarray, random: Random) -> np.ndarray:
    return points * np.where(np.arange(3) == random.integers(3), -1.0, 1.0)


def _order(command: np.ndarray, random: Random) -> np.ndarray:
    return command[:, [[1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]][int(random.integers(5))]]


def _length(spec: ThreePttSpec, random: Random) -> dict[str, Any]:
    off = random.uniform(20.0, 50.0) * random.choice([-1.0, 1.0])
    if random.random() < 0.5:
        return {"link_length_mm": spec.link_length_mm + off}
    other = spec.base_radius_mm + off
    return {
        "base_radius_mm": other
        if abs(other - spec.platform_radius_mm) < 0.9 * spec.link_length_mm
        else spec.base_radius_mm - abs(off)
    }


def _feed(table: Table, random: Random) -> np.ndarray:
    return np.full(table.rows, 60.0 * random.uniform(35.0, 100.0))


def _other_way(command: np.ndarray, random: Random) -> np.ndarray:
    return command[:, [0, 2, 1]]


def _other_zeros(command: np.ndarray, random: Random) -> np.ndarray:
    return command + np.r_[0.0, random.uniform(12.0, 60.0, 2)]


def _other_side(spec: ThreePttSpec, random: Random) -> dict[str, Any]:
    return {"sliders": "below" if spec.sliders == "above" else "above"}


def _interchanged(spec: ThreePttSpec, random: Random) -> dict[str, Any]:
    return {"base_radius_mm": spec.platform_radius_mm, "platform_radius_mm": spec.base_radius_mm}


CASES = (
    Case("tracker: x and y swapped", ("axes-swapped", "axis-sign"), _read(_swap_xy), alone=MIRRORS),
    Case("tracker: one axis negated", ("axis-sign", "axes-swapped"), _read(_negate), alone=MIRRORS),
    Case("readings in inches", ("unit-scale",), _read(lambda p, r: p / 25.4)),
    Case("readings in metres", ("unit-scale",), _read(lambda p, r: p / 1e3)),
    Case("readings in centimetres", ("unit-scale",), _read(lambda p, r: p / 10.0)),
    Case("readings in micrometres", ("unit-scale",), _read(lambda p, r: p * 1e3)),
    Case("targets in inches", ("unit-scale",), _want(lambda p, r: p / 25.4), ("both", "targets")),
    Case("targets in metres", ("unit-scale",), _want(lambda p, r: p / 1e3), ("both", "targets")),
    Case("targets: x and y swapped", ("axes-swapped", "axis-sign", "slider-order"), _want(_swap_xy), ("both",)),
    Case("sliders in another order", ("slider-order",), _send(_order), ("both",)),
    Case("sliders numbered the other way", ("slider-order",), _send(_other_way), SENT, MIRRORS),
    Case("all sliders counted downward", ("slider-sign",), _send(lambda b, r: r.uniform(300, 900) - b), SENT),
    Case("one slider counted downward", ("slider-sign",), _send(_one_down), SENT),
    Case("sliders from other zeros", ("slider-sign",), _send(_other_zeros), SENT),
    Case("sliders on the wrong side", ("slider-side",), _draw(_other_side)),
    Case("radii interchanged", ("radii-interchanged",), _draw(_interchanged), ("both",)),
    Case("diameter for radius", ("diameter-for-radius",), _draw(_radius), SENT, ("drawing-length",)),
    Case("a length off by 20 to 50 mm", ("drawing-length",), _draw(_length), SENT),
    Case("readings a row late", ("row-shift",), _read(lambda p, r: np.vstack([p[:1], p[:-1]]))),
    Case("a reading missed", ("row-shift",), _read(_missed)),
    Case("rows not in travel order (time)", ("row-order",), _shuffle),
    Case("readings in another order than the poses", ("row-order",), _other_order),
    Case("rows sorted by their names' letters", ("row-order",), _letters),
    Case("targets in the workpiece's frame", ("target-frame",), _want(_frame), ("both",)),
    Case("a block on another reflector", ("wrong-reflector",), _read(_block)),
    Case("Kelvin in temp_c", ("temperature-unit",), _temperature(1.0, 273.15)),
    Case("Fahrenheit in temp_c", ("temperature-unit",), _temperature(1.8, 32.0)),
    Case("newtons in payload_kg", ("payload-unit",), _load(9.80665)),
    Case("grams in payload_kg", ("payload-unit",), _load(1000.0)),
    Case("ms in time_s", ("time-unit",), _column("time_s", _clock)),
    Case("mm/min in feed_mm_s", ("time-unit",), _column("feed_mm_s", _feed)),
    Case("sigma_mm in um", ("noise-implausible",), _noise),
)  # fmt: skip


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
