"""Shared by the checks of single columns: plausible limits of machines, findings, corrections."""

import numpy as np

from ptt.machine import SerialSpec, ThreePttSpec
from ptt.setup.names import Mistake
from ptt.setup.result import Finding
from ptt.setup.setup import Setup, Undo, used_rows

HOTTEST = 100.0  # deg C: no machine is measured above
HEAVIEST = 100.0  # kg on a machine of up to a metre; on larger ones in proportion to the cube of the size
FASTEST = {"three-ptt": 2000.0, "serial": 15000.0}  # mm/s: ball screws, arms
Result = tuple[Finding, Undo | None]


def heaviest(spec: ThreePttSpec | SerialSpec) -> float:
    """Upper limit of the payload of a machine of this size, kg."""
    if isinstance(spec, ThreePttSpec):
        size = 2.0 * spec.link_length_mm
    else:
        size = float(sum(np.hypot(joint.a_mm, joint.d_mm) for joint in spec.joint))
    return HEAVIEST * max(1.0, size / 1000.0) ** 3


def fastest(spec: ThreePttSpec | SerialSpec) -> float:
    """Upper limit of the speed of a machine of this kind, mm/s."""
    return FASTEST[spec.kind]


def known(values: np.ndarray | None) -> np.ndarray:
    """Finite values of a column."""
    return np.zeros(0) if values is None else np.asarray(values, dtype=float)[np.isfinite(values)]


def standing_still(setup: Setup) -> list[str]:
    """A question on each column of readings that is constant; none where all three are, as at a single pose."""
    read = setup.table.measured[used_rows(setup.table)]
    read = read[np.isfinite(read).all(axis=1)]
    still = np.ptp(read, axis=0) == 0.0 if len(read) > 1 else np.ones(3, dtype=bool)
    if still.all():
        return []
    return [
        f"{'xyz'[axis]}_meas is {read[0, axis]:g} in every row: is that its column?" for axis in np.flatnonzero(still)
    ]


def said(setup: Setup, mistake: Mistake, words: str, fix: str, sure: bool = True) -> Finding:
    """A finding without errors before and after."""
    return Finding(mistake, words, fix, None, None, sure, setup.table.source)


def settled(setup: Setup, found: Result | None) -> tuple[list[Finding], Setup]:
    """The result of a check as a list of findings, and the files with it undone where it is sure."""
    if found is None:
        return [], setup
    finding, undo = found
    return [finding], undo(setup) if undo is not None and finding.sure else setup


def shifted(field: str, factor: float, offset: float) -> Undo:
    """A column times a factor plus an offset."""
    return lambda setup: setup.with_rows(**{field: np.asarray(getattr(setup.table, field)) * factor + offset})
