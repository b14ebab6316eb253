"""Cases of a sweep: which faults are hidden in which rig, under which noise; everything follows from the seed."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ptt.challenge.hide import ARM_FAULTS, FAULTS, hide_faults
from ptt.challenge.truth import (
    COUNTED_SIZE,
    READINGS,
    Truth,
    find_truth,
    mount_columns,
    reading_noise,
    seen_place,
    without_set_up,
)
from ptt.effects import library
from ptt.machine import MachineFile
from ptt.rig import RunResult, simulate
from ptt.rig.draw import PROTOCOLS, DrawnRig, Protocol, draw_rig
from ptt.rig.draw_arm_machine import given_arm
from ptt.rig.draw_faults import Fault
from ptt.rig.draw_foreign import draw_foreign
from ptt.rig.draw_foreign_arm import ARM_PROTOCOLS, draw_foreign_arm
from ptt.rig.draw_machine import draw_machine_file
from ptt.rig.draw_noise import NOISES, draw_noise
from ptt.run.axes import rms_length

RIGS, SIZES = 3, 6  # rigs, and sizes of each fault, that are drawn at the most until every fault can be seen
ATTEMPT = 1_000_000  # between the seeds of two attempts: more than a sweep has cases
VISIBLE = (COUNTED_SIZE, 30.0)  # range of sizes of a visible fault, times the noise of one reading
MOST_FAULTS = 5
# Faults that poses in a volume show are also hidden in runs of several loads and temperatures, and those that a path
# shows also in one at several speeds.
ALSO: dict[str, tuple[Protocol, ...]] = {"volume": ("volume", "payload", "warmup"), "path": ("path", "speed")}
# Of an arm: what loads do to springs is seen under loads; its weight alone where no payload strains the same springs.
ALSO_ARM: dict[str, tuple[Protocol, ...]] = {"volume": ARM_PROTOCOLS, "still load": ("volume", "warmup")}
# Readings that an effect asks for: a map of uneven rings takes a hundred rows for each of up to seven joints.
LEAST_ROWS = {"joint-error-map": 720}
# Effects that hardly a run tells from others: hidden alone, never among several.
AMBIGUOUS = ("joint-offset", "tracker-scale")
# At level dense each size of the drawing is off by about the noise of a reading, as on a real machine.
SIZES_OF_DRAWING = ("homing-offset", "lead-scale", "tower-position", "tower-tilt", "link-length", "joint-offset")
LITTLE = (0.2, 2.5)  # range of the sizes of each of these, times the noise of one reading
MOST_TIMES = 3.0  # greatest factor on a drawn size: what a run hardly shows is not made huge


@dataclass(frozen=True)
class Case:
    """One rig to be drawn.

    Attributes:
        seed: of everything.
        level: single, multi, unknown, none, or dense: one fault beside small errors of all sizes of the drawing.
        protocol: how it is measured.
        faults: names of what is hidden.
        noise: kind of noise; None is the bench's own.
        bench: a drawing to be run on the paths of the sample data, of an arm in random postures; None draws machine,
            path and length by the seed.
        rows: about how many, None lets the seed choose.
        visible: draw sizes anew until every fault is of a size in VISIBLE.
        steep: of a drawn machine, whether its rails lean far or lie flat.
        arm: whether the machine is a serial arm.
    """

    seed: int
    level: str
    protocol: Protocol
    faults: tuple[str, ...]
    noise: str | None = None
    bench: MachineFile | None = None
    rows: int | None = None
    visible: bool = True
    steep: bool = False
    arm: bool = False


def table_of_faults(arm: bool) -> dict[str, Fault]:
    """All faults by name, of a 3-PTT or of an arm."""
    return ARM_FAULTS if arm else FAULTS


def names_of(level: str, kinds: str = "all", *, arm: bool = False) -> tuple[str, ...]:
    """Names of the faults of a level: effects of the library, or faults outside it that are shown, unseen or all."""
    table = table_of_faults(arm)
    if level != "unknown":
        return tuple(name for name, fault in table.items() if fault.section != "odd")
    wanted = {"shown": (False,), "unseen": (True,), "all": (False, True)}[kinds]
    return tuple(name for name, fault in table.items() if fault.section == "odd" and fault.unseen in wanted)


def protocols_of(name: str, *, arm: bool = False) -> tuple[Protocol, ...]:
    """Protocols of the runs in which a fault is hidden."""
    own, also = table_of_faults(arm)[name].protocols, ALSO_ARM if arm else ALSO
    return tuple(dict.fromkeys(each for protocol in own for each in also.get(protocol, (protocol,))))


def plan(
    level: str, count: int, start: int, *, kinds: str = "all", noise: str | None = None, **shared: Any
) -> list[Case]:
    """Spread cases evenly over faults, runs and noises.

    Args:
        level: single, multi, unknown, none or dense.
        count: how many.
        start: first seed.
        kinds: shown, unseen or all, of the faults outside the library.
        noise: kind of noise for all of them, None goes through all kinds where machines are drawn.
        **shared: bench, rows, visible, steep, arm of every case.

    Returns:
        The cases.
    """
    cases = []
    for number in range(start, start + count):
        random = np.random.default_rng([number, 61])
        protocol, faults = _choose_faults(level, number, random, kinds, shared.get("arm", False))
        through = list(NOISES)[(number + number // len(NOISES)) % len(NOISES)] if shared.get("bench") is None else None
        case = Case(number, level, protocol, faults, noise or through, **shared)
        least = max((LEAST_ROWS[name] for name in faults if name in LEAST_ROWS), default=None) if case.arm else None
        cases.append(replace(case, rows=case.rows or least))
    return cases


def _choose_faults(
    level: str, number: int, random: np.random.Generator, kinds: str, arm: bool
) -> tuple[Protocol, tuple[str, ...]]:
    protocols = ARM_PROTOCOLS if arm else PROTOCOLS
    if level == "none":
        return protocols[number % len(protocols)], ()
    if level == "multi":
        protocol = protocols[number % len(protocols)]
        return protocol, _several(random, protocol, 2 + number // len(protocols) % (MOST_FAULTS - 1 - arm), arm)
    names = names_of(level, kinds, arm=arm)
    if level == "dense":
        names = tuple(name for name in names if name not in (*SIZES_OF_DRAWING, *AMBIGUOUS))
    name = names[number % len(names)]
    runs = protocols_of(name, arm=arm)
    protocol = runs[random.integers(len(runs))]
    if level == "dense":
        return protocol, (name, *SIZES_OF_DRAWING)
    more = _several(random, protocol, number // 2 % 3, arm) if level == "unknown" else ()
    return protocol, (name, *more)


def _several(random: np.random.Generator, protocol: Protocol, count: int, arm: bool) -> tuple[str, ...]:
    """Names of several effects for one run, one of them, where there is any, that no other protocol shows."""
    table, runs = table_of_faults(arm), {name: protocols_of(name, arm=arm) for name in names_of("multi", arm=arm)}
    fitting = [
        name for name in runs if protocol in runs[name] and name not in AMBIGUOUS and not (arm and name in LEAST_ROWS)
    ]
    special = [name for name in fitting if len(runs[name]) == 1]
    first = [special[random.integers(len(special))]] if special and count else []
    picked = {
        table[name].exclusive or table[name].called: name for name in [*random.permutation(fitting).tolist(), *first]
    }  # the last one stays
    rest = [name for name in random.permutation(list(picked.values())).tolist() if name not in first]
    return tuple(first + rest[: count - len(first)])


def draw(case: Case) -> tuple[DrawnRig, Truth]:
    """Draw the rig of a case, and find its truth.

    Where visible faults are wanted, sizes are drawn again until each fault alone has a size in VISIBLE, and the rig
    too where its run cannot show one; after all attempts the nearest is taken.
    """
    best: tuple[float, DrawnRig] | None = None
    for attempt in range(RIGS if case.visible and case.faults else 1):
        seed = case.seed + ATTEMPT * attempt
        distance, drawn = _hide_visibly(_sound(case, seed), case, seed)
        if best is None or distance < best[0]:
            best = distance, drawn
        if distance == 0.0:
            break
    assert best is not None
    return best[1], find_truth(best[1], library())


def _hide_visibly(sound: DrawnRig, case: Case, seed: int) -> tuple[float, DrawnRig]:
    """Greatest distance of a fault's size from VISIBLE, as a logarithm, and the rig with the faults."""
    if not (case.visible and case.faults):
        return 0.0, hide_faults(sound, case.faults, seed)
    still = simulate(sound.rig, sound.targets, noise=False)
    noise = reading_noise(sound.rig, still.truth).total
    if case.level == "dense":
        distance, own = _best_size(sound, still, noise, case.faults[0], seed)
        return distance, _vary_drawing(hide_faults(sound, case.faults[:1], own), sound, still, noise, seed)
    tried = [_best_size(sound, still, noise, name, seed) for name in case.faults]
    seen = [name for name, (distance, _) in zip(case.faults, tried, strict=True) if distance == 0.0]
    # Of several those that this run cannot show are left out; what the case is about stays.
    enough = len(seen) > 1 if case.level == "multi" else case.faults[0] in seen
    drawn = sound
    for name, (_, own) in zip(case.faults, tried, strict=True):
        if name in seen or not enough:
            drawn = hide_faults(drawn, [name], own)
    return 0.0 if enough else max(distance for distance, _ in tried), drawn


def _vary_drawing(drawn: DrawnRig, sound: DrawnRig, still: RunResult, noise: float, seed: int) -> DrawnRig:
    """The rig with each size of the drawing off by about the noise of a reading."""
    random = np.random.default_rng([seed, 62])
    for name in SIZES_OF_DRAWING:
        wanted = float(np.exp(random.uniform(*np.log(LITTLE)))) * noise
        times = min(wanted / max(_size(hide_faults(sound, [name], seed), still, None), 1e-9), MOST_TIMES)
        drawn = hide_faults(drawn, [name], seed, times)
    return drawn


def _best_size(sound: DrawnRig, still: RunResult, noise: float, name: str, seed: int) -> tuple[float, int]:
    """Distance from VISIBLE, as a logarithm, of the nearest of a few draws of a fault's size, and its seed."""
    best, mount = (np.inf, seed), mount_columns(sound)
    for attempt in range(SIZES):
        own = seed + ATTEMPT // 100 * attempt
        size = max(_size(hide_faults(sound, [name], own), still, mount) / noise, 1e-6)
        best = min(best, (max(0.0, float(np.log(VISIBLE[0] / size)), float(np.log(size / VISIBLE[1]))), own))
        if best[0] == 0.0:
            break
    return best


def _size(drawn: DrawnRig, still: RunResult, mount: np.ndarray | None) -> float:
    """Size of one fault in the readings, less what the tracker's set-up may hold, rms length in mm."""
    frame = simulate(drawn.rig, drawn.targets, noise=False).frame
    shift = frame[READINGS].to_numpy(float) - still.frame[READINGS].to_numpy(float)
    read = np.isfinite(shift).all(axis=1) & (frame["role"] != "base").to_numpy()
    place, run = seen_place(drawn.rig, frame), frame["run"].to_numpy()
    held = None if mount is None else mount[read]
    return rms_length(without_set_up(drawn.rig, shift[read], place[read], run[read], held))


def _sound(case: Case, seed: int) -> DrawnRig:
    if case.arm:
        return _sound_arm(case, seed)
    if case.bench is None:
        foreign = draw_machine_file(seed, steep=True) if case.steep else None
        return draw_foreign(seed, case.protocol, noise=case.noise, rows=case.rows, foreign=foreign)
    drawn = draw_rig(seed, case.bench, case.protocol, rows=case.rows or 300)
    if case.noise is None:
        return drawn
    tracker = type(drawn.rig.tracker).model_validate(drawn.rig.tracker.model_dump() | draw_noise(case.noise, seed))
    return replace(drawn, rig=replace(drawn.rig, tracker=tracker), notes={"noise": case.noise})


def _sound_arm(case: Case, seed: int) -> DrawnRig:
    if case.bench is None:
        return draw_foreign_arm(seed, case.protocol, noise=case.noise, rows=case.rows)
    arm, kind = given_arm(case.bench), case.noise or "white"
    drawn = draw_foreign_arm(seed, case.protocol, noise=kind, rows=case.rows, path="cloud", arm=arm)
    # A given file stays as it is: its tracker is as noisy as it states.
    sigma = case.bench.tracker.sigma_mm
    tracker = drawn.rig.tracker if sigma is None else drawn.rig.tracker.model_copy(update={"white_mm": sigma})
    return replace(drawn, rig=replace(drawn.rig, machine=case.bench, tracker=tracker), absent=())
