"""The machine as solids at one pose, and a ghost: the parts that an effect displaces, by enlarged displacements."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.show.card.solids import Solid, ball, block, joined, plate, tube
from ptt.show.sizing import round_down

AT_FAULT = 0.25  # of the largest displacement, from which a leg or joint counts as displaced
PART_COLOURS = {"rails": "#aab2b8", "sliders": "#4c5a66", "links": "#7d8b96", "platform": "#5b7f9b"}
GHOST = "#e69f00"  # colour of displaced parts
POSES = 48  # along the travel, among which a control on the page chooses
SEEN_SHARE = 0.13  # of the machine's size: length at which the largest displacement is drawn


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
        """Diagonal of the machine's bounding box, mm; 1 where it has no finite point."""
        points = np.concatenate([each.reshape(-1, 3) for each in (self.rails, self.chains, self.platform)])
        points = points[np.isfinite(points).all(axis=1)]
        return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 1.0


@dataclass(frozen=True, eq=False)
class MachineLines:
    """A machine at each row as lines.

    Attributes:
        rails: (r, 2, 3) mm, ends of each rail; none on a serial arm.
        chains: (n, c, m, 3) mm, for each row c lines of m points: links of a 3-PTT, the arm of a serial one.
        platform: (n, j, 3) mm, corners of the platform, an open polygon; none on a serial arm.
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
        lines: the machine at one pose.

    Returns:
        Those of 'rails', 'sliders', 'links' and 'platform' that it has; of an arm 'sliders' are its joints and
        'platform' its tool.
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
    """The machine displaced by an effect.

    Args:
        lines: the machine at one pose.
        shift: displacements by the effect, from `ptt.show.card.ghost`.
        at: index of the pose among those of `shift`.
        times: factor by which displacements are enlarged.

    Returns:
        The displaced lines.
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
    """Round factor of enlargement at which an effect is well seen.

    Args:
        lines: the machine at one pose.
        shift: displacements by the effect.

    Returns:
        1, 2 or 5 times a power of ten.
    """
    keys = ("chain", "platform") if "chain" in shift else ("sliders", "platform", "rails")
    most = max(float(np.abs(np.asarray(shift[key])).max(initial=0.0)) for key in keys)
    return round_down(SEEN_SHARE * lines.size / most) if most > 0.0 else 1.0


def legs_at_fault(shift: Mapping[str, Any]) -> tuple[str, tuple[int, ...]]:
    """Which kind of part an effect displaces most, and which legs or joints.

    Args:
        shift: displacements by the effect.

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
    """Where the label of a part is anchored.

    Args:
        lines: the machine at one pose.
        who: 'slider 2', 'link 1', 'tower 3', 'joint 4'; anything else stands for the tool.

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
    """The solids that are drawn as a ghost: those of the displaced legs, or the whole of an arm.

    Args:
        lines: the displaced machine at one pose.
        kind: kind of part from `legs_at_fault`.
        legs: numbers from 0; empty for all legs.

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
