"""Set-up mistakes that targets or commands show without readings: out of reach, out of travel, or in one spot."""

import numpy as np
import torch

from ptt.mechanisms.three_ptt import ThreePtt
from ptt.setup.candidates import mirrors, scales, units
from ptt.setup.columns import said
from ptt.setup.drawing import drawing_slips, is_no_machine
from ptt.setup.result import Finding, ties_in_words
from ptt.setup.score import agree, build
from ptt.setup.setup import Setup, drawn, used_rows

LEAST_ROWS = 5  # for a share of rows to mean anything
NEARLY_ALL, NEARLY_NONE = 0.9, 0.05  # shares of rows; a few may be wrong for reasons of their own
SPECK = 2e-3  # of a link: nobody works in so small a volume
WORKED = 0.02  # of a link: the least extent of targets of a real run
AGREED = 0.02  # of the extent: the residual of ordinary faults
MARGIN = 0.05  # of the travel: ends are often stated roughly


def find_reach(setup: Setup) -> tuple[list[Finding], Setup]:
    """A mistake in the drawing, or in a unit, that puts most targets out of reach, and all in reach once undone.

    Args:
        setup: both files of a 3-PTT.

    Returns:
        At most one finding, and the files with it undone.
    """
    before = out_of_reach(setup)
    if before is None or before < 0.5 or setup.table.command is not None:
        return [], setup
    read = np.isfinite(setup.table.measured).any()
    tried = [*drawing_slips(setup), *units("both" if read else "targets"), *([] if read else mirrors("targets"))]
    found = []
    for hypothesis in tried:
        cured = hypothesis.undo(setup)
        after = out_of_reach(cured)
        # Distant targets scaled down a thousandfold are in reach as well, but in a volume too small for a real run.
        if after is not None and after <= NEARLY_NONE and before - after > 0.5 and _spread(cured) > WORKED:
            found.append((hypothesis, after))
    if not found:
        return [], setup
    first, left = found[0]
    others = list(dict.fromkeys(item.undone for item, _ in found[1:] if item.mistake != first.mistake))
    also = ties_in_words(others)
    undone = first.undone.rstrip(",")
    words = (
        f"{before:.0%} of the targets are out of the machine's reach; with {undone}, {_all_but(left)} are within"
        f" it{also}"
    )
    sure = before > NEARLY_ALL and not others
    finding = said(setup, first.mistake, words, first.fix, sure)
    return [finding], first.undo(setup) if sure else setup


def _spread(setup: Setup) -> float:
    """Extent of the targets (diagonal of their box) as a multiple of the link length."""
    target = setup.table.target[used_rows(setup.table)]
    target = target[np.isfinite(target).all(axis=1)]
    return float(np.linalg.norm(np.ptp(target, axis=0))) / drawn(setup).link_length_mm


def find_travel(setup: Setup) -> tuple[list[Finding], Setup]:
    """Slider heights that hardly ever lie within the travel, where another unit brings all of them into it.

    Where every length of a run is in one wrong unit, targets, commands and readings still agree with each other.

    Args:
        setup: both files of a 3-PTT.

    Returns:
        At most one finding, and the files with it undone.
    """
    before = _out_of_travel(setup)
    if before is None or before < NEARLY_ALL or is_no_machine(drawn(setup)):
        return [], setup
    inside = []
    for hypothesis in scales(setup):
        cured = hypothesis.undo(setup)
        after = _out_of_travel(cured)
        if after is not None and after <= NEARLY_NONE and _width(cured) > SPECK * drawn(setup).link_length_mm:
            inside.append((_relative(cured), hypothesis, cured, after))
    if not inside:
        return [], setup
    left, hypothesis, cured, outside = min(inside, key=lambda item: item[0])
    if left > max(2.0 * _relative(setup), AGREED):
        return [], setup  # the columns agree as they are, and would not in another unit
    words = (
        f"{before:.0%} of the slider heights lie outside the travel; with {hypothesis.undone}, "
        f"{_all_but(outside)} are within it"
    )
    return [said(setup, "unit-scale", words, hypothesis.fix)], cured


def _all_but(share: float) -> str:
    """All of them, or all but a share."""
    return f"all but {100.0 * share:.2g}%" if share else "all"


def _width(setup: Setup) -> float:
    """Largest range of a slider's commands, mm."""
    return float(np.nan_to_num(np.ptp(np.nan_to_num(np.asarray(setup.table.command)), axis=0)).max())


def _relative(setup: Setup) -> float:
    """Largest residual between the columns, relative to the rms radius of the points."""
    agreement = agree([setup])[0]
    return agreement.worst / max(agreement.width, 1e-9)


def _out_of_travel(setup: Setup) -> float | None:
    """Share of commands outside the travel; None where there are too few to tell."""
    mechanism, command = build(drawn(setup)), setup.table.command
    if mechanism is None or command is None:
        return None
    sent = command[np.isfinite(command).all(axis=1)]
    if len(sent) < LEAST_ROWS or np.ptp(sent, axis=0).max() < 1e-9:
        return None
    return _outside(mechanism, sent)


def find_speck(setup: Setup) -> tuple[list[Finding], Setup]:
    """Targets that differ and yet lie within a tiny volume: metres in columns of millimetres.

    Args:
        setup: both files of a 3-PTT.

    Returns:
        At most one finding, and the files with it undone.
    """
    if setup.table.command is not None:
        return [], setup
    target, size = setup.table.target[used_rows(setup.table)], drawn(setup).link_length_mm
    if np.isfinite(target).all(axis=1).sum() < LEAST_ROWS:
        return [], setup
    width = size * _spread(setup)
    if not 1e-6 < width < SPECK * size:
        return [], setup
    side = "both" if np.isfinite(setup.table.measured).any() else "targets"
    metres = next(item for item in units(side) if "metres" in item.undone.split())  # type: ignore[arg-type]
    after = out_of_reach(metres.undo(setup))
    if after is None or after > NEARLY_NONE:
        return [], setup
    words = (
        f"the targets lie within {width:.3g} mm of each other on a machine with links of {size:.0f} mm: "
        "this looks like metres"
    )
    return [said(setup, "unit-scale", words, metres.fix)], metres.undo(setup)


def out_of_reach(setup: Setup) -> float | None:
    """Share of targets that the sliders cannot reach within their travel; None where there are too few to tell."""
    mechanism, target = build(drawn(setup)), setup.table.target[used_rows(setup.table)]
    target = target[np.isfinite(target).all(axis=1)]
    if len(target) < LEAST_ROWS or np.ptp(target, axis=0).max() < 1e-6:
        return None
    if mechanism is None:
        return 1.0
    return _outside(mechanism, mechanism.inverse(torch.as_tensor(target, dtype=torch.float64)).numpy())


def _outside(mechanism: ThreePtt, slider: np.ndarray) -> float:
    """Share of slider heights, (m, 3) mm, outside the travel; NaN (target out of reach) counts as outside."""
    low, high = mechanism.limits().numpy()
    rim = MARGIN * (high - low)
    return float(1.0 - ((slider >= low - rim) & (slider <= high + rim)).all(axis=1).mean())
