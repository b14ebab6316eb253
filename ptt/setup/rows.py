"""Mistakes that affect some rows: readings shifted by a row, a block of rows read on another reflector."""

from dataclasses import replace

import numpy as np

from ptt.setup.columns import said
from ptt.setup.faults import fault_columns, left_after_faults
from ptt.setup.proof import BEYOND_FAULTS, FALL, STEEP
from ptt.setup.result import Finding
from ptt.setup.rigid import TRIM, align_many, rms_of_parts
from ptt.setup.score import forward_many
from ptt.setup.setup import Setup

SLIPS = (1, -1, 2, -2)  # rows; positive: readings come later than their targets
LEAST_KNOWN = 8  # rows with target and reading that a frame needs
LEAST_ROWS = 3  # fewer rows in a block are gross errors
ALIKELY = 1.5  # ratio up to which a slip is preferred to a block: on equal steps a missed reading looks like a shift
MOST_SLIPS, HELPS = 3, 0.9  # number, and ratio by which each further one has to reduce the mean distance
BLOCK_SHIFT = 5.0  # mm: reflector nests are centimetres apart, knocks and slips are smaller
MOST_REFLECTORS = 2  # more different shifts, one for each line of a raster, have another cause
SEEN_GAP = (0.05, 1.0)  # of a step, and mm: where no row is off by the smaller, no reading is in another row
BOTH = 0.8  # share of rows with a reading before and after a slip from which only those are compared
MOST_OFF = 0.6  # of the rows: where more are off, the frame of the others is not reliable
AT_ONCE = 200_000  # rows of all starts that are aligned together: 100 MB
TURNED = 2.0  # ratio of residuals of a shift and of a frame of its own from which a block is rotated too
ALIKE = 0.2  # scatter of a shift relative to it: another reflector shifts all rows equally, a slipped slider does not


def places(setup: Setup) -> np.ndarray:
    """Where the tool should be, (n, 3) mm: by forward kinematics of the commands where possible, else the target."""
    sent = forward_many([setup])[0] if setup.table.joint_prefix == "b" else None
    target = setup.table.target
    return target if sent is None else np.where(np.isfinite(sent).all(axis=1)[:, None], sent, target)


def find_shifted_rows(setup: Setup) -> tuple[list[Finding], Setup]:
    """Shifted readings or a block on another reflector, whichever has the smaller residual.

    Args:
        setup: both files.

    Returns:
        Findings, and the files with them undone.
    """
    slip, block = find_slip(setup), find_block(setup)
    if not slip[0] or not block[0]:
        return slip if slip[0] else block
    left = [_mean_distance(places(item[1]), item[1].table.measured, setup.free) for item in (slip, block)]
    return slip if left[0] < ALIKELY * left[1] else block


def _mean_distance(place: np.ndarray, reading: np.ndarray, free: bool) -> float:
    """Mean distance from the places, mm, gross errors included."""
    distance = align_many(place[None], reading[None], free)[2][0]
    known = np.isfinite(distance)
    return float(distance[known].mean()) if known.any() else 0.0


def find_slip(setup: Setup) -> tuple[list[Finding], Setup]:
    """Readings one or two rows away from their targets, from the first or from some row on.

    Args:
        setup: both files.

    Returns:
        One finding for each slip, and the files with them undone.
    """
    place, reading = places(setup), setup.table.measured
    known = np.isfinite(place).all(axis=1) & np.isfinite(reading).all(axis=1)
    if known.sum() < LEAST_KNOWN or not _slip_is_possible(place, reading, setup.free):
        return [], setup
    far = last = _mean_distance(place, reading, setup.free)
    slips: list[tuple[int, int]] = []
    moved, before, after = reading, 0.0, np.inf
    while before <= (FALL if len(slips) == 1 else STEEP) * after:
        _, slip, first = _best_slip(place, moved, setup.free)
        slips.append((slip, first))
        moved = slipped(moved, slip, first)
        near = _mean_distance(place, moved, setup.free)
        if len(slips) > MOST_SLIPS or near > HELPS * last:
            return [], setup
        last = near
        if far > 2.0 * near:
            before, after = _beside_faults(setup, place, reading, moved)
    std = setup.table.std
    for slip, first in slips:
        std = None if std is None else slipped(std, slip, first)
    findings = [_tell_slip(setup, slip, first, before, after) for slip, first in slips]
    return findings, setup.with_rows(measured=moved, std=std)


def _tell_slip(setup: Setup, slip: int, first: int, before: float, after: float) -> Finding:
    line = setup.table.line[first]
    whole = np.isfinite(setup.table.measured[:first]).all(axis=1).sum() <= 1
    where = "from the first row on" if whole else f"from row {line} on"
    words = (
        f"readings are {abs(slip)} row{'s' if abs(slip) > 1 else ''} {'late' if slip > 0 else 'early'} {where}"
        f"{'' if whole else (': a reading was missed there' if slip < 0 else ': there is one reading too many')}; "
        f"with the readings moved back, the error falls from {1e3 * before:,.0f} to {1e3 * after:,.0f} um"
    )
    rows = "all readings" if whole else f"the readings from row {line} on"
    fix = f"move {rows} {'up' if slip > 0 else 'down'} by {abs(slip)}, and leave the row without a reading empty"
    return Finding("row-shift", words, fix, 1e3 * before, 1e3 * after, True, setup.table.source)


def slipped(reading: np.ndarray, slip: int, first: int) -> np.ndarray:
    """Readings taken from `slip` rows further down, from row `first` on; NaN where there is none."""
    moved = reading.copy()
    rows = np.arange(first, len(reading))
    source = rows + slip
    inside = (source >= first) & (source < len(reading))
    moved[rows[inside]], moved[rows[~inside]] = reading[source[inside]], np.nan
    return moved


def find_block(setup: Setup) -> tuple[list[Finding], Setup]:
    """Blocks of rows that were read on another reflector: the same shift everywhere in the block.

    Args:
        setup: both files of a machine whose tool only translates.

    Returns:
        One finding for each block, and the files with them undone.
    """
    place, reading = places(setup), setup.table.measured.copy()
    known = np.flatnonzero(np.isfinite(place).all(axis=1) & np.isfinite(reading).all(axis=1))
    if len(known) < LEAST_KNOWN:
        return [], setup
    left, turn = _majority_frame(place[known], reading[known], setup.free)
    findings, shifts = list[Finding](), list[np.ndarray]()
    before = float(np.sqrt(np.mean(left**2) * 3.0))
    part = np.zeros(len(known), dtype=int)
    for block in _bad_blocks(left):
        shift = np.median(left[block], axis=0)
        size = float(np.linalg.norm(shift))
        scatter = float(np.sqrt(np.median(((left[block] - shift) ** 2).sum(axis=1))))
        if size < BLOCK_SHIFT or scatter > ALIKE * size:
            continue
        if not any(np.linalg.norm(shift - other) < ALIKE * size for other in shifts):
            shifts.append(shift)
        rows, part[block] = known[block], len(findings) + 1
        reading[rows] -= turn @ shift
        left[block] -= shift
        findings.append(_tell_block(setup, turn, shift, rows, known))
    if not 0 < len(shifts) <= MOST_REFLECTORS:
        return [], setup
    after = rms_of_parts(np.linalg.norm(left, axis=1), part)
    if before < FALL * after or after > BEYOND_FAULTS or after > TURNED * _left_by_turns(place[known], left, part):
        return [], setup
    figures = f"; with that subtracted, the error falls from {1e3 * before:,.0f} to {1e3 * after:,.0f} um"
    told = [
        replace(item, words=item.words + figures, before_um=1e3 * before, after_um=1e3 * after) for item in findings
    ]
    return told, setup.with_rows(measured=reading)


def _tell_block(setup: Setup, turn: np.ndarray, shift: np.ndarray, rows: np.ndarray, known: np.ndarray) -> Finding:
    """The finding of one block: indices of its rows and of all that are known, shift (3,) mm in the base frame."""
    first, last = setup.table.line[rows[0]], setup.table.line[rows[-1]]
    at, off = (", ".join(f"{value:.{digits}f}" for value in turn @ shift) for digits in (1, 3))
    words = (
        f"readings of rows {first} to {last} are {np.linalg.norm(shift):.1f} mm away from the rest, "
        f"all by the same ({at}) mm: another reflector"
    )
    fix = f"subtract ({off}) mm from x_meas, y_meas, z_meas of rows {first} to {last}, or empty those cells"
    if _is_whole_runs(setup.table.run, rows, known):
        fix = (
            'if the tracker was set up anew for a run, write frame = "fitted-per-run" under [tracker] in the '
            f"machine file; otherwise {fix}"
        )
    return said(setup, "wrong-reflector", words, fix)


def _left_by_turns(place: np.ndarray, left: np.ndarray, part: np.ndarray) -> float:
    """Residual, mm rms, with a tracker frame of their own for rows from the only change on; infinite if impossible."""
    edges = np.flatnonzero(np.diff(part))
    if len(edges) != 1 or min(edges[0] + 1, len(part) - edges[0] - 1) < LEAST_KNOWN:
        return np.inf
    distance = np.linalg.norm(left, axis=1)
    for each in np.unique(part):
        here = part == each
        distance[here] = align_many(place[None, here], (place + left)[None, here])[2][0]
    return rms_of_parts(distance, part)


def _is_whole_runs(run: np.ndarray, rows: np.ndarray, known: np.ndarray) -> bool:
    """Whether rows are exactly those of one or several runs, but not all known rows."""
    inside = np.isin(run[known], run[rows])
    return bool(inside.sum() == len(rows) < len(known))


def _slip_is_possible(place: np.ndarray, reading: np.ndarray, free: bool) -> bool:
    """Whether at least a few rows have a residual comparable to the step from row to row."""
    step = np.linalg.norm(np.diff(place, axis=0), axis=1)
    _, _, distance = align_many(place[None], reading[None], free)
    usual = float(np.nanmedian(step[step > 0.0])) if (step > 0.0).any() else np.inf
    return int((distance[0] > min(SEEN_GAP[0] * usual, SEEN_GAP[1])).sum()) >= LEAST_ROWS


def _best_slip(place: np.ndarray, reading: np.ndarray, free: bool) -> tuple[float, int, int]:
    """Cost, slip and first row of the shift that fits best, from several initial frames for each slip."""
    count = len(place)
    third = max(LEAST_KNOWN // 2, count // 3)
    head, tail = np.arange(count) < third, np.arange(count) >= count - third
    parts = [(False, head), (True, tail), (True, head), (True, head | True)]
    starts = [(slip, moved, part) for slip in SLIPS for moved, part in parts]
    slips = np.array([slip for slip, _, _ in starts])
    shifted = {slip: slipped(reading, slip, 0) for slip in SLIPS}
    all_shifted = np.stack([shifted[slip] for slip in slips])
    values = np.stack(
        [np.where(part[:, None], shifted[slip] if moved else reading, np.nan) for slip, moved, part in starts]
    )
    spread = np.broadcast_to(place, values.shape)
    for _ in range(3):
        turn, shift, _ = align_many(spread, values, free)
        cost, first = _best_change_rows(place, reading, all_shifted, turn, shift, np.maximum(0, -slips))
        values = np.stack([slipped(reading, slip, at) for slip, at in zip(slips, first, strict=True)])
    best = int(np.argmin(cost))
    return float(cost[best]), int(slips[best]), int(first[best])


def _best_change_rows(
    place: np.ndarray, reading: np.ndarray, shifted: np.ndarray, turn: np.ndarray, shift: np.ndarray, lost: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least sum of distances (h,) mm, and row (h,) from which on shifted readings fit better.

    `lost` (h,) is the number of rows after the change that a shift leaves without reading.
    """
    expected = place @ turn.transpose(0, 2, 1) + shift[:, None]
    plain, moved = (np.nan_to_num(np.linalg.norm(points - expected, axis=2)) for points in (reading, shifted))
    count, nothing = len(place), np.zeros((len(turn), 1))
    after = np.concatenate([np.cumsum(moved[:, ::-1], axis=1)[:, ::-1], nothing], axis=1)
    after = np.take_along_axis(after, np.minimum(np.arange(count + 1) + lost[:, None], count), axis=1)
    cost = np.concatenate([nothing, np.cumsum(plain, axis=1)], axis=1) + after
    first = np.argmin(cost[:, : max(1, count - LEAST_ROWS + 1)], axis=1)
    return np.take_along_axis(cost, first[:, None], axis=1)[:, 0], first


def _beside_faults(setup: Setup, place: np.ndarray, reading: np.ndarray, moved: np.ndarray) -> tuple[float, float]:
    """Rms error before and after, mm, ordinary faults fitted where possible; over the same rows if enough have both."""
    columns = fault_columns(setup, place) if setup.table.joint_prefix == "b" else None
    distances = []
    for values in (reading, moved):
        if columns is None:
            distances.append(align_many(place[None], values[None], setup.free)[2][0])
        else:
            distances.append(left_after_faults(place, values, columns, setup.free))
    known = np.stack([np.isfinite(distance) for distance in distances])
    if known.sum(axis=1).min() < LEAST_KNOWN:
        return 0.0, np.inf
    known[1] &= distances[1] <= TRIM * np.nanmedian(distances[1]) + 1e-9
    both = known.all(axis=0)
    if both.sum() > BOTH * known.sum(axis=1).min():
        known[:] = both
    before, after = (float(np.sqrt(np.mean(of[rows] ** 2))) for of, rows in zip(distances, known, strict=True))
    return before, after


def _majority_frame(place: np.ndarray, reading: np.ndarray, free: bool) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, 3) mm, in the base frame, of the tracker frame that fits most rows, and its rotation (3, 3)."""
    starts = stretches(len(place), LEAST_KNOWN // 2)
    best = _best_start(place, reading, starts[:1], free)
    if best[0] == len(place):  # all rows in one frame: no other fits more
        return best[1], best[2]
    for kept in np.array_split(starts[1:], min(len(starts) - 1, -(-starts.size // AT_ONCE))):
        other = _best_start(place, reading, kept, free)
        best = other if other[0] > best[0] else best
    return best[1], best[2]


def stretches(count: int, least: int) -> np.ndarray:
    """Masks (h, count) bool: all rows, then half-overlapping stretches of a quarter of them, `least` rows or more."""
    row, long = np.arange(count), max(least, count // 4)
    edges = range(0, count - long + 1, max(1, long // 2))
    return np.stack([row >= 0, *((row >= at) & (row < at + long) for at in edges)])


def _best_start(
    place: np.ndarray, reading: np.ndarray, kept: np.ndarray, free: bool
) -> tuple[int, np.ndarray, np.ndarray]:
    """Number of rows that fit, residuals and rotation of the best frame of h, started from the rows `kept` (h, n)."""
    spread = np.broadcast_to(place, (*kept.shape, 3))
    for again in (True, True, False):
        turn, shift, _ = align_many(spread, np.where(kept[..., None], reading, np.nan), free)
        left = (reading - shift[:, None]) @ turn - place
        near = np.linalg.norm(left, axis=2) < BLOCK_SHIFT / 2.0
        enough = near.sum(axis=1) >= LEAST_KNOWN // 2
        if again:
            kept = np.where(enough[:, None], near, kept)
    best = int(np.argmax(near.sum(axis=1)))
    return int(near[best].sum()), left[best], turn[best]


def _bad_blocks(left: np.ndarray) -> list[np.ndarray]:
    """Consecutive rows with large residuals, as index arrays; none where most rows are off."""
    off = np.linalg.norm(left, axis=1) > BLOCK_SHIFT / 2.0
    if off.mean() > MOST_OFF:
        return []
    edges = np.flatnonzero(np.diff(np.r_[0, off.astype(int), 0]))
    blocks = [np.arange(start, end) for start, end in zip(edges[::2], edges[1::2], strict=True)]
    return [block for block in blocks if len(block) >= LEAST_ROWS]
