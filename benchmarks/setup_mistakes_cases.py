"""Mistakes in a set-up as people make them, and how each is made."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from setup_mistakes_runs import Random, draw_turn

from ptt.machine import MachineFile, ThreePttSpec
from ptt.run.table import Table, take_rows

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
    return target @ draw_turn(random, upright=True).T + random.uniform(-80.0, 80.0, 3)


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
