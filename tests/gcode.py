"""A controller that runs Cartesian programs, written for tests from the RS274/NGC report alone: words in, path out."""

import math
import re
from itertools import pairwise

import numpy as np


def execute(text: str, offset=(0.0, 0.0, 0.0), *, sag: float = 2e-4) -> list[dict]:
    """Moves in machine coordinates: `path` (m, 3) mm without its first point, and what else their lines say."""
    place, offset, absolute, centre_absolute, unit, plane, motion, feed = (
        np.array(offset, dtype=float), np.array(offset, dtype=float), True, False, 1.0, 17, None, None,
    )  # fmt: skip
    moves, e, known = [], 0.0, [False] * 3
    for number, line in enumerate(text.splitlines(), 1):
        clean = re.sub(r"\([^)]*\)|;.*|%", "", line).replace(" ", "")
        words = re.findall(r"([A-Z])([-+]?[0-9.]+)?", clean.upper())
        codes = {float(value) for letter, value in words if letter == "G"}
        value = {letter: float(text) for letter, text in words if letter not in "GMN" and text}
        unit = 25.4 if 20 in codes else 1.0 if 21 in codes else unit
        absolute = True if 90 in codes else False if 91 in codes else absolute
        centre_absolute = True if 90.1 in codes else False if 91.1 in codes else centre_absolute
        plane = next((code for code in (17, 18, 19) if code in codes), plane)
        motion = next((code for code in (0, 1, 2, 3) if code in codes), motion)
        feed = value["F"] * unit if "F" in value else feed
        e = value.get("E", e)
        if codes & {4, 28, 30, 92} or not set(value) & set("XYZIJK"):
            continue
        end = place.copy()
        for axis, letter in enumerate("XYZ"):
            if letter in value:
                zero = 0.0 if 53 in codes else offset[axis] if absolute else place[axis]
                end[axis], known[axis] = zero + unit * value[letter], True
        if motion in (0, 1):
            path = end[None]
        else:
            path = _arc(place, end, plane, motion, value, unit, offset if centre_absolute else None, sag)
        moves.append({"path": path, "line": number, "rapid": motion == 0, "feed": feed, "e": e, "known": list(known)})
        place = end
    return moves


def _arc(place, end, plane, motion, value, unit, origin, sag) -> np.ndarray:
    a, b, c = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}[plane]
    sign = 1.0 if motion == 3 else -1.0
    first, last = complex(place[a], place[b]), complex(end[a], end[b])
    if "R" in value:
        radius, way = unit * value["R"], last - first
        rise = math.sqrt(max(radius**2 - abs(way) ** 2 / 4.0, 0.0)) * sign * math.copysign(1.0, radius)
        centre = (first + last) / 2.0 + 1j * way / abs(way) * rise
    else:
        words = complex(unit * value.get("IJK"[a], 0.0), unit * value.get("IJK"[b], 0.0))
        centre = words + complex(origin[a], origin[b]) if origin is not None else first + words
    turn = math.remainder(np.angle((last - centre) / (first - centre)), 2 * math.pi) * sign
    turn = turn if turn > 1e-9 else turn + 2.0 * math.pi
    turn += 2.0 * math.pi * (value.get("P", 1.0) - 1.0)
    radius = abs(first - centre)
    count = max(math.ceil(turn / math.sqrt(8.0 * sag / radius)), 2)
    share = np.linspace(0.0, 1.0, count + 1)[1:]
    spot = centre + (first - centre) * np.exp(1j * sign * turn * share)
    path = np.empty((count, 3))
    path[:, a], path[:, b], path[:, c] = spot.real, spot.imag, place[c] + share * (end[c] - place[c])
    path[-1] = end
    return path


def whole_path(moves: list[dict], start=None) -> np.ndarray:
    """All points, (m, 3) mm."""
    parts = [move["path"] for move in moves]
    return np.concatenate(parts if start is None else [np.array([start]), *parts])


def dense(path: np.ndarray, step: float) -> np.ndarray:
    """The path with points no farther apart than a step, (m, 3) mm."""
    parts = [path[:1]]
    for first, last in pairwise(path):
        count = max(math.ceil(np.linalg.norm(last - first) / step), 1)
        parts.append(first + np.linspace(0.0, 1.0, count + 1)[1:, None] * (last - first))
    return np.concatenate(parts)


def beside(points: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Distance of points (m, 3) from the nearest stretch of a path (n, 3), (m,) mm."""
    begin, way = path[:-1], np.diff(path, axis=0)
    square = np.maximum((way**2).sum(axis=1), 1e-30)
    nearest = np.empty(len(points))
    for row, point in enumerate(points):
        share = np.clip(((point - begin) * way).sum(axis=1) / square, 0.0, 1.0)
        nearest[row] = np.sqrt(((point - begin - share[:, None] * way) ** 2).sum(axis=1).min())
    return nearest
