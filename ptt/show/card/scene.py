"""The machine as solid parts at one pose, with the parts that an effect moves beside it, enlarged: a ghost."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.show.card.solids import Solid, ball, block, joined, plate, tube
from ptt.show.sizing import round_down

AT_FAULT = 0.25  # of the largest share, from which a part is drawn as the one that is off
PART_COLOURS = {"rails": "#aab2b8", "sliders": "#4c5a66", "links": "#7d8b96", "platform": "#5b7f9b"}
GHOST = "#e69f00"  # what is off
POSES = 48  # along the travel; a slider scrubs through them
SEEN_SHARE = 0.13  # of the machine's size that the largest displacement is drawn as


@dataclass(frozen=True, eq=False)
class PoseLines:
    """A machine at one pose as lines.

    Attributes:
        rails: (r, 2, 3) mm; none on an arm.
        chains: (c, m, 3) mm, the links of a 3-PTT from slider to platform, the one chain of an arm.
        platform: (j, 3) mm, corners; none on an arm.
    """

    rails: np.ndarray
    chains: np.ndarray
    platform: np.ndarray

    @property
    def size(self) -> float:
        """The machine's size, mm."""
        points = np.concatenate([each.reshape(-1, 3) for each in (self.rails, self.chains, self.platform)])
        points = points[np.isfinite(points).all(axis=1)]
        return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 1.0


@dataclass(frozen=True, eq=False)
class MachineLines:
    """A machine at each row as lines.

    Attributes:
        rails: (r, 2, 3) mm, ends of each rail; none on a serial arm.
        chains: (n, c, m, 3) mm, for each row c lines of m points: links of a 3-PTT, the arm of a serial one.
        platform: (n, j, 3) mm, corners of the platform, closed by the drawer; no corners on a serial arm.
    """

    rails: np.ndarray
    chains: np.ndarray
    platform: np.ndarray

    def at(self, row: int) -> PoseLines:
        """The machine at the pose of one row."""
        return PoseLines(self.rails, self.chains[row], self.platform[row])


def parts_of(lines: PoseLines) -> dict[str, Solid]:
    """The machine as solids.

    Args:
        lines: at one pose.

    Returns:
        'rails', 'sliders', 'links', 'platform', those that it has.
    """
    size = lines.size
    thick = 0.011 * size
    if not len(lines.rails):
        return _arm_parts(lines.chains[0], size)
    sliders = [
        block(chain[0], rail[1] - rail[0], (2.6 * thick, 1.6 * thick))
        for rail, chain in zip(lines.rails, lines.chains, strict=True)
    ]
    links = [
        part for chain in lines.chains for part in (tube(chain[0], chain[1], 0.62 * thick), ball(chain[1], 1.1 * thick))
    ]
    return {
        "rails": joined(tube(rail[0], rail[1], thick, 4) for rail in lines.rails),
        "sliders": joined(sliders),
        "links": joined(links),
        "platform": joined([plate(lines.platform, 0.9 * thick)]),
    }


def _arm_parts(chain: np.ndarray, size: float) -> dict[str, Solid]:
    """Links and joints of an arm, thinner toward the tool."""
    count, thick = len(chain) - 1, 0.021 * size
    taper = np.linspace(1.0, 0.5, max(count, 1))
    pairs = [(a, b, t) for a, b, t in zip(chain[:-1], chain[1:], taper, strict=True) if np.linalg.norm(b - a) > 1e-6]
    return {
        "links": joined(tube(a, b, thick * t) for a, b, t in pairs),
        "sliders": joined(ball(point, 1.75 * thick * t) for point, t in zip(chain[:-1], taper, strict=True)),
        "platform": joined([ball(chain[-1], 1.2 * thick)]),
    }


def moved(lines: PoseLines, shift: Mapping[str, Any], at: int, times: float) -> PoseLines:
    """The machine with an effect, enlarged.

    Args:
        lines: at one pose.
        shift: of the effect, as `ptt.show.card.ghost` gives it.
        at: which of the poses.
        times: how much it is enlarged.

    Returns:
        Its lines.
    """
    if "chain" in shift:
        chain = lines.chains[0] + times * np.asarray(shift["chain"][at])
        return PoseLines(lines.rails, chain[None], lines.platform)
    rails = lines.rails + times * np.asarray(shift["rails"])
    platform = lines.platform + times * np.asarray(shift["platform"][at])
    chains = lines.chains.copy()
    chains[:, 0] += times * np.asarray(shift["sliders"][at])
    chains[:, 1] += times * np.asarray(shift["platform"][at])
    return PoseLines(rails, chains, platform)


def usual_times(lines: PoseLines, shift: Mapping[str, Any]) -> float:
    """Round factor at which an effect is well seen.

    Args:
        lines: at one pose.
        shift: of the effect.

    Returns:
        1, 2 or 5 times a power of ten.
    """
    keys = ("chain", "platform") if "chain" in shift else ("sliders", "platform", "rails")
    most = max(float(np.abs(np.asarray(shift[key])).max(initial=0.0)) for key in keys)
    return round_down(SEEN_SHARE * lines.size / most) if most > 0.0 else 1.0


def legs_at_fault(shift: Mapping[str, Any]) -> tuple[str, tuple[int, ...]]:
    """Which kind of part is off, and which of them.

    Args:
        shift: of an effect.

    Returns:
        'slider', 'tower', 'link', 'joint' or 'tool', and numbers from 0; no numbers for the tool.
    """
    share = np.asarray(shift["share"], dtype=float)
    if not share.size or share.max() <= 0.0:
        return "tool", ()
    kinds = ("joint",) if "chain" in shift else ("slider", "tower", "link")
    kind = int(np.argmax(share.max(axis=1)))
    return kinds[kind], tuple(np.flatnonzero(share[kind] >= AT_FAULT * share.max()).tolist())


def place_of_part(lines: PoseLines, who: str) -> np.ndarray:
    """Where a part is, for a label.

    Args:
        lines: at one pose.
        who: 'slider 2', 'link 1', 'tower 3', 'joint 4'; anything else is the tool's.

    Returns:
        (3,) mm.
    """
    kind, _, number = who.partition(" ")
    index = int(number) - 1 if number.isdigit() else -1
    if index >= 0 and len(lines.rails) > index:
        if kind == "link":
            return np.asarray(lines.chains[index].mean(axis=0))
        if kind == "tower":
            return np.asarray(lines.rails[index].mean(axis=0))
        if kind == "slider":
            return np.asarray(lines.chains[index][0])
    if kind == "joint" and not len(lines.rails) and 0 <= index < len(lines.chains[0]) - 1:
        return np.asarray(lines.chains[0][index])
    return np.asarray(lines.platform.mean(axis=0) if len(lines.platform) else lines.chains[0][-1])


def only(lines: PoseLines, kind: str, legs: Sequence[int]) -> dict[str, Solid]:
    """The solids of some legs: what is drawn as a ghost.

    Args:
        lines: at one pose, moved.
        kind: as `legs_at_fault` tells.
        legs: numbers from 0; none for the whole machine but its rails.

    Returns:
        Solids by part.
    """
    if not len(lines.rails):
        return parts_of(lines)
    chosen = list(legs) or list(range(len(lines.rails)))
    ghost = parts_of(PoseLines(lines.rails[chosen], lines.chains[chosen], lines.platform))
    if kind != "tower":
        ghost.pop("rails")
    if kind in ("link", "tool"):
        ghost.pop("sliders")
    return ghost
