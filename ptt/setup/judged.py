"""Residuals between targets, commands and readings with a mistake undone and ordinary faults fitted; what is proof."""

from dataclasses import dataclass, replace

import numpy as np

from ptt.run.table import take_rows
from ptt.setup.faults import MOST_TIMES, fault_columns, left_after_faults
from ptt.setup.proof import BEYOND_FAULTS, FALL, STEEP
from ptt.setup.rigid import rms
from ptt.setup.score import FLOOR, Agreement, agree, forward_many
from ptt.setup.setup import Hypothesis, Setup, drawn, used_rows

MOST_ROWS = 120  # rows judged: more add nothing about a mistake that affects all
BROKEN = 0.5  # mm after ordinary faults are fitted: below it there is nothing to explain
RAW = 0.2  # weight, in the score, of the residuals before ordinary faults are fitted: it decides between near ties
SPECK, UNLIKELY = 2e-3, 5.0  # of a link: nobody measures in so small a volume; the penalty in the score


@dataclass(frozen=True, eq=False)
class Judged:
    """A hypothesis and its residuals.

    Attributes:
        setup: the files with the mistake undone.
        steps: the mistakes undone, in order.
        agreement: residuals after ordinary faults are fitted.
        plain: the judgement before anything was undone; None where nothing was.
        raw: sum of logarithms as `total`, before ordinary faults are fitted: they may absorb part of a mistake.
    """

    setup: Setup
    steps: tuple[Hypothesis, ...]
    agreement: Agreement
    plain: "Judged | None" = None
    raw: float = 0.0

    @property
    def width(self) -> float:
        """Rms radius of the points before anything was undone, mm."""
        return (self.plain or self).agreement.width

    @property
    def worst(self) -> float:
        """Largest residual of the pairs, mm, scaled up where the points lie closer together than before."""
        return float(np.nan_to_num(self.agreement.beside(self.width)).max())

    @property
    def total(self) -> float:
        """Sum of the logarithms of the residuals."""
        return self.agreement.total(self.width)

    @property
    def score(self) -> float:
        """Sum of logarithms and penalties by which hypotheses are ranked; small is good."""
        odd = _oddness(self.agreement.turn)
        odd += UNLIKELY * (self.agreement.width < SPECK * drawn(self.setup).link_length_mm)
        return self.total + RAW * self.raw + sum(step.cost for step in self.steps) + odd


def judge(setup: Setup, steps: tuple[Hypothesis, ...], plain: Judged | None = None, most: float = MOST_TIMES) -> Judged:
    """Residuals between the columns after ordinary faults are fitted.

    Args:
        setup: both files, mistakes undone.
        steps: the mistakes undone.
        plain: the judgement before anything was undone.
        most: usual sizes that no fault exceeds.

    Returns:
        The judgement.
    """
    agreement = agree([setup])[0]
    values, reading = agreement.rms.copy(), setup.table.measured
    for index, place in enumerate((setup.table.target, forward_many([setup])[0])):
        if not np.isfinite(values[index]) or values[index] > drawn(setup).link_length_mm / 4.0:
            continue
        columns = fault_columns(setup, place)
        if columns is not None:
            distance = left_after_faults(place, reading, columns, setup.free, most)[None]
            lost = np.isfinite(reading).all(axis=1) & ~np.isfinite(distance[0])
            left = rms(distance, lost[None] & np.isfinite(place).any(), drawn(setup).link_length_mm)[0]
            values[index] = min(values[index], left)
    return Judged(setup, steps, replace(agreement, rms=values), plain, agreement.total(agreement.width))


def undo_all(steps: tuple[Hypothesis, ...], setup: Setup) -> Setup:
    """Both files with one mistake undone after the other."""
    for step in steps:
        setup = step.undo(setup)
    return setup


def thinned(setup: Setup, most: int) -> Setup:
    """At most so many rows, evenly spread over those with a reading: every second one may have none."""
    used = used_rows(setup.table)
    read = used & np.isfinite(setup.table.measured).all(axis=1)
    rows = np.flatnonzero(read if read.any() else used)
    if len(rows) > most:
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, most).round().astype(int))]
    return replace(setup, table=take_rows(setup.table, rows)) if len(rows) < setup.table.rows else setup


def is_proof(plain: Judged | None, item: Judged) -> bool:
    """Whether the error falls far, from above the level of ordinary faults to that level."""
    if plain is None or item.agreement.width < SPECK * drawn(item.setup).link_length_mm:
        return False  # readings of a single pose agree with any drawing, and so does all that is scaled down to one
    before, after = plain.agreement.rms, item.agreement.beside(item.width)
    fell = np.isfinite(before) & (before > after)
    steep = np.nanmax(before) > STEEP * np.nanmax(after)
    large = before[fell].max(initial=0.0) > (BROKEN * _size(item) if steep else _least(item))
    deep = plain.total - item.total > len(item.steps) * np.log(FALL)
    rest = max(float(np.nanmax(after)), FLOOR)
    each = np.nanmax(before) > FALL * rest and rest < BEYOND_FAULTS * _size(item)
    return bool(large and deep and each)


def _least(item: Judged) -> float:
    """Smallest error that proves a mistake, mm; a wrong length is seen between targets and commands, without noise."""
    length = any(step.mistake == "drawing-length" for step in item.steps)
    return (BROKEN if length else BEYOND_FAULTS) * _size(item)


def _size(item: Judged) -> float:
    """Factor on limits in mm: faults of small machines are smaller."""
    return min(1.0, drawn(item.setup).link_length_mm / 200.0)


def _oddness(turn: np.ndarray) -> float:
    """Small penalty on tilt and rotation of the tracker: it decides between hypotheses that fit equally well."""
    tilt = np.arccos(np.clip(turn[2, 2], -1.0, 1.0))
    angle = np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))
    return float(0.04 * tilt + 0.01 * angle)
