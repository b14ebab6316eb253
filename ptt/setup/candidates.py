"""Hypotheses of geometric set-up mistakes of a 3-PTT, each with the correction that undoes it."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, permutations, product
from typing import Literal

import numpy as np
import torch

from ptt.run.axes import AXES
from ptt.setup.rigid import column_medians, rotate_rows
from ptt.setup.score import build, forward_many
from ptt.setup.setup import Hypothesis, Setup, Undo, drawn

Side = Literal["readings", "targets", "both"]
UNITS = {"inches": 25.4, "metres": 1e3, "centimetres": 10.0, "micrometres": 1e-3}
SHORT = {"inches": "in", "metres": "m", "centimetres": "cm", "micrometres": "um"}
BEYOND_HOMING = 5.0  # mm: a larger error of a slider's zero is another origin of its scale, not bad homing


def suggested_by_readings(setup: Setup) -> list[Hypothesis]:
    """Mistakes that the readings suggest: a unit in which they extend like the targets, a left-handed frame."""
    commanded = forward_many([setup])[0]
    place = setup.table.target if np.isfinite(setup.table.target).any() else commanded
    known = np.isfinite(place).all(axis=1) & np.isfinite(setup.table.measured).all(axis=1)
    if not known.any():
        return []
    own, read = (float(np.linalg.norm(np.std(points[known], axis=0))) for points in (place, setup.table.measured))
    near = [item for item, factor in zip(units("readings"), UNITS.values(), strict=True) if is_near(own, factor * read)]
    return [*near, next(item for item in mirrors("readings") if item.undone == "z negated")]


def is_near(one: float, other: float) -> bool:
    """Whether two sizes differ by less than any two units of length do."""
    return 0.8 * one < other < 1.25 * one


def mirrors(side: Side) -> Iterator[Hypothesis]:
    """One axis negated, or two swapped: reflections, which are all equivalent where the frame is free."""
    for axis, letter in enumerate(AXES):
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        matrix = np.diag(sign)
        name = columns_of(side, letter)
        yield Hypothesis("axis-sign", f"{letter}{of(side)} negated", f"negate {name}", _turn(side, matrix), cost(side))
    for one, other in combinations(range(3), 2):
        order = np.arange(3)
        order[[one, other]] = other, one
        first, second = AXES[one], AXES[other]
        words = f"{first} and {second}{of(side)} swapped"
        fix = f"swap {columns_of(side, first)} and {columns_of(side, second)}"
        yield Hypothesis("axes-swapped", words, fix, _turn(side, np.eye(3)[order]), cost(side))


def turned_axes() -> Iterator[Hypothesis]:
    """Every other permutation of signed axes of the readings: rotations, which a fitted frame would absorb."""
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        changes = sum(place != axis for place, axis in enumerate(order)) + sum(sign < 0 for sign in signs)
        if changes > 1 and (changes, min(signs)) != (2, 1.0):
            matrix = np.diag(signs) @ np.eye(3)[list(order)]
            axes = ", ".join(f"{'-' if sign < 0 else ''}{AXES[axis]}" for sign, axis in zip(signs, order, strict=True))
            words = f"({axes}) read as (x, y, z)"
            fix = f"write ({axes}) into the columns {columns_of('readings', 'x')}, y, z"
            yield Hypothesis("axes-swapped", words, fix, _turn("readings", matrix), 0.2)


def units(side: Side) -> Iterator[Hypothesis]:
    """Another unit of length of readings, targets or both."""
    for unit, factor in UNITS.items():
        title = columns_of(side, "x").replace(" and ", f"_{SHORT[unit]} and ") + f"_{SHORT[unit]}"
        words = f"{side if side != 'both' else 'targets and readings'} taken as {unit}"
        yield Hypothesis(
            "unit-scale", words, f"rename the columns ({title}, ...)", _turn(side, factor * np.eye(3)), cost(side)
        )  # fmt: skip


def slider_units(setup: Setup) -> Iterator[Hypothesis]:
    """Slider heights in another unit, alone or with everything else."""
    low, high = drawn(setup).whole_travel
    for item, factor in zip(scales(setup), np.repeat(list(UNITS.values()), 2), strict=True):
        if _plausible(setup, float(factor), 2.0 * (high - low)):
            yield item


def scales(setup: Setup) -> Iterator[Hypothesis]:
    """Every unit of the slider heights, alone and with all other lengths of the run."""
    columns = {"x_cmd": setup.table.target, "x_meas": setup.table.measured}
    others = [title for title, points in columns.items() if np.isfinite(points).any()]
    for unit, factor in UNITS.items():
        titles = [f"{title}_{SHORT[unit]}, ..." for title in ("b1_cmd", *others)]
        fix = f"rename the columns ({titles[0]})"
        yield Hypothesis("unit-scale", f"slider heights taken as {unit}", fix, _scaled(factor), 0.0)
        both = _then(_scaled(factor), _turn("both", factor * np.eye(3)))
        fix = f"rename the columns ({', '.join(titles)})"
        yield Hypothesis("unit-scale", f"every length of the run taken as {unit}", fix, both, 0.1)


def slider_orders() -> Iterator[Hypothesis]:
    """Sliders in another order, counted downward, or both; zeros follow from the targets."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            if order == (0, 1, 2) and min(signs) > 0:
                continue
            if order != (0, 1, 2) and len(set(signs)) > 1:
                continue  # two mistakes at once, of which the data do not tell which slider
            moved, down = order != (0, 1, 2), [leg for leg in range(3) if signs[leg] < 0]
            words = order_words(order) if moved else ""
            words += " and " if moved and down else ""
            words += f"{slider_words(down)} counted downward" if down else ""
            fix = f"swap the columns ({words})" if moved else f"take {slider_words(down)} as a constant less the column"
            undo = _reordered(order, np.array(signs))
            yield Hypothesis(
                "slider-order" if moved else "slider-sign", words, fix, undo, 0.15 * (moved and bool(down))
            )
    yield Hypothesis(
        "slider-sign", "each slider counted from its own zero", "add the constants to the columns", own_zeros, 0.8
    )


def own_zeros(setup: Setup) -> Setup:
    """Slider heights shifted to the zeros that the targets require; unchanged where these are within homing errors."""
    zero = _zeros(setup, np.ones(3))
    if zero is None or np.ptp(zero) < BEYOND_HOMING:
        return setup
    return setup.with_rows(command=setup.table.command + np.round(zero, 3))


def columns_of(side: Side, letter: str) -> str:
    """Titles of a coordinate's columns."""
    titles = {"readings": f"{letter}_meas", "targets": f"{letter}_cmd", "both": f"{letter}_cmd and {letter}_meas"}
    return titles[side]


def of(side: Side) -> str:
    """Which columns, where it is not the readings."""
    return {"readings": "", "targets": " of the targets", "both": " of targets and readings"}[side]


def cost(side: Side) -> float:
    """Prior cost of a mistake: readings pass through more hands than the rest, so mistakes are likelier there."""
    return {"readings": 0.0, "targets": 0.1, "both": 0.2}[side]


def slider_words(legs: Sequence[int]) -> str:
    """Sliders by number."""
    if len(legs) == 3:
        return "all sliders"
    return f"slider{'s' if len(legs) > 1 else ''} {' and '.join(str(leg + 1) for leg in legs)}"


def order_words(order: tuple[int, ...]) -> str:
    """An order of the sliders in words."""
    moved = [place for place in range(3) if order[place] != place]
    if len(moved) == 2:
        return f"sliders {moved[0] + 1} and {moved[1] + 1} interchanged"
    return "sliders taken in the order " + ", ".join(str(leg + 1) for leg in order)


def _turn(side: Side, matrix: np.ndarray) -> Undo:
    def undo(setup: Setup) -> Setup:
        changes = {}
        if side != "targets":
            changes["measured"] = rotate_rows(setup.table.measured, matrix)
            scale = abs(np.linalg.det(matrix)) ** (1.0 / 3.0)
            if setup.table.std is not None:
                sizes = np.abs(matrix) if abs(scale - 1.0) < 1e-9 else scale * np.eye(3)
                changes["std"] = rotate_rows(setup.table.std, sizes)
        if side != "readings":
            changes["target"] = rotate_rows(setup.table.target, matrix)
        return setup.with_rows(**changes)

    return undo


def _plausible(setup: Setup, factor: float, most: float) -> bool:
    """Whether the sliders' strokes fit the travel in that unit, and for a smaller unit do not as they are."""
    stroke = float(np.nanmax(np.ptp(np.nan_to_num(np.asarray(setup.table.command)), axis=0)))
    return factor * stroke <= most and (factor > 1.0 or stroke > most)


def _scaled(factor: float) -> Undo:
    return lambda setup: setup.with_rows(command=factor * np.asarray(setup.table.command))


def _then(first: Undo, second: Undo) -> Undo:
    return lambda setup: second(first(setup))


def _reordered(order: tuple[int, ...], signs: np.ndarray) -> Undo:
    def undo(setup: Setup) -> Setup:
        command = setup.table.command[:, list(order)]  # type: ignore[index]
        moved = replace(setup, table=setup.table.replace(command=command))
        if signs.min() > 0:
            return moved
        zero = _zeros(moved, signs)
        if zero is None:
            zero = zeros_from_home(setup, signs * command, signs)
        elif signs.max() < 0 and np.ptp(zero) < BEYOND_HOMING:
            zero = np.full(3, np.median(zero))
        return moved.with_rows(command=signs * command + np.round(zero, 3))

    return undo


def slider_formulas(before: np.ndarray | None, after: np.ndarray | None) -> str:
    """The change of the slider columns in words that a person can follow: 'write b1_cmd = 542.3 - b1_cmd'.

    Args:
        before: (n, 3) mm, or None.
        after: (n, 3) mm, columns in another order, turned round or shifted.

    Returns:
        The formulas; '' where the change is none or of another kind.
    """
    if before is None or after is None or before is after:
        return ""
    told = []
    for leg in range(3):
        ways = [(sign, other) for sign in (1.0, -1.0) for other in (leg, *(each for each in range(3) if each != leg))]
        rests = {way: after[:, leg] - way[0] * before[:, way[1]] for way in ways}
        way = next((way for way, rest in rests.items() if np.nanmax(rest) - np.nanmin(rest) < 1e-6), None)
        if way is None:
            return ""
        zero = round(float(np.nanmean(rests[way])), 3)
        column = f"b{way[1] + 1}_cmd"
        plus = f"{column} {'+' if zero > 0 else '-'} {abs(zero):g}" if zero else column
        told.append((f"b{leg + 1}_cmd", plus if way[0] > 0 else f"{zero:.7g} - {column}"))
    changed = {title: formula for title, formula in told if title != formula}
    if len(changed) == 2 and all(changed.get(formula) == title for title, formula in changed.items()):
        return f"swap {' and '.join(changed)}"  # as two formulas it reads as if both became alike
    formulas = ", ".join(f"{title} = {formula}" for title, formula in changed.items())
    mixed = any(title not in formula for title, formula in changed.items())
    return f"write {'all at once, by the old values, ' if mixed else ''}{formulas}" if changed else ""


def zeros_from_home(setup: Setup, counted: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Zeros that bring sliders of reversed sign to the middle of their travel at home, as in any run, (3,) mm."""
    mechanism = build(drawn(setup))
    home = np.zeros(3) if mechanism is None else mechanism.home().numpy()
    zero = home - column_medians(counted)
    return np.where(signs < 0, zero.mean() if signs.max() < 0 else zero, 0.0)


def _zeros(setup: Setup, signs: np.ndarray) -> np.ndarray | None:
    """Zero of each slider with which its heights reach the targets, (3,) mm; None where there are no targets."""
    mechanism = build(drawn(setup))
    if mechanism is None or setup.table.command is None:
        return None
    reach = mechanism.inverse(torch.as_tensor(setup.table.target, dtype=torch.float64)).numpy()
    apart = reach - signs * setup.table.command
    known = np.isfinite(apart).all(axis=1)
    return np.median(apart[known], axis=0) if known.sum() > 3 else None
