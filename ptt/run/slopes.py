"""Velocities at rows as weighted sums of the slopes between rows: splines, parabolas, single moves."""

import numpy as np

Shares = tuple[np.ndarray, np.ndarray, np.ndarray]  # sparse matrix on slopes: index of the sum, of the interval, weight
Ends = tuple[np.ndarray, np.ndarray]  # velocity at the beginning and end of moves less the mean one, times duration


def _spline(step: np.ndarray) -> tuple[np.ndarray, Shares]:
    """Tridiagonal system of a cubic spline's slopes over intervals of length step (n - 1,), not-a-knot at the ends.

    Source: C. de Boor, A Practical Guide to Splines, 1978, chapter IV.
    """
    rows = len(step) + 1
    first, last = step[0] + step[1], step[-1] + step[-2]
    bands, before, after = np.zeros((3, rows)), np.empty(rows), np.empty(rows)
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = step[:-1], 2.0 * (step[:-1] + step[1:]), step[1:]
    bands[1, 0], bands[0, 1], bands[1, -1], bands[2, -2] = step[1], first, step[-2], last
    before[1:-1], after[1:-1] = 3.0 * step[1:], 3.0 * step[:-1]
    before[0], after[0] = (step[0] + 2.0 * first) * step[1] / first, step[0] ** 2 / first
    before[-1], after[-1] = step[-1] ** 2 / last, (2.0 * last + step[-1]) * step[-2] / last
    row = np.arange(rows)
    interval = np.clip(row - 1, 0, rows - 3)
    return bands, (np.tile(row, 2), np.concatenate([interval, interval + 1]), np.concatenate([before, after]))


def splines(
    lasts: np.ndarray, stretches: list[tuple[int, int]], leaving: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Shares]:
    """One tridiagonal system for the splines of all stretches: `bands`, `owner`, `part` and `right` of a `Pace`.

    Args:
        lasts: durations from row to row, (n - 1,) s.
        stretches: first and last row of each.
        leaving: weight of the stretch that begins at a row in its velocity, (n,); that which ends there has the rest.
    """
    bands, owner, part, shares, place = [np.zeros((3, 0))], [np.zeros(0, dtype=int)], [np.zeros(0)], [_none()], 0
    for first, last in stretches:
        band, (row, interval, weight) = _spline(lasts[first:last])
        bands.append(band)
        owner.append(np.arange(first, last + 1))
        part.append(np.concatenate([leaving[[first]], np.ones(last - first - 1), 1.0 - leaving[[last]]]))
        shares.append((row + place, interval + first, weight))
        place += last + 1 - first
    return np.concatenate(bands, axis=1), np.concatenate(owner), np.concatenate(part), _joined(shares)


def short_stretches(lasts: np.ndarray, sound: np.ndarray, ends: np.ndarray, leaving: np.ndarray) -> Shares:
    """Weights of the slopes in the velocities of rows in stretches of two or three rows: `straight` of a `Pace`."""
    first, size = ends[:-1], np.diff(ends)
    single = first[(size == 1) & sound[first]]
    double = first[size == 2]
    double = double[sound[double] & sound[double + 1]]
    before = lasts[double] / (lasts[double] + lasts[double + 1])  # a parabola through the three
    begun, left = np.concatenate([single, double]), np.concatenate([single + 1, double + 2])
    return _joined(
        [
            (begun, begun, leaving[begun]),
            (left, left - 1, 1.0 - leaving[left]),
            (double + 1, double, 1.0 - before),
            (double + 1, double + 1, before),
        ]
    )


def bend_of(lasts: np.ndarray, sound: np.ndarray, corners: np.ndarray, leaving: np.ndarray, ends: Ends) -> np.ndarray:
    """Velocities beyond those of even motion on straight moves from corner to corner, (n, k): `bend` of a `Pace`."""
    move = corners[:-1][(np.diff(corners) == 1) & sound[corners[:-1]]]
    begin, end = (part[move] / lasts[move, None] for part in ends)
    total = np.zeros((len(lasts) + 1, begin.shape[1]))
    total[move] += leaving[move, None] * begin
    total[move + 1] += (1.0 - leaving[move + 1])[:, None] * end
    return total


def _none() -> Shares:
    return np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0)


def _joined(shares: list[Shares]) -> Shares:
    row, interval, weight = (np.concatenate(parts) for parts in zip(*shares, strict=True))
    return row, interval, weight


def added(shares: Shares, slope: np.ndarray, rows: int) -> np.ndarray:
    """Weighted sums of slopes (n - 1, k), (rows, k)."""
    row, interval, weight = shares
    total = np.zeros((rows, slope.shape[1]))
    np.add.at(total, row, weight[:, None] * slope[interval])
    return total
