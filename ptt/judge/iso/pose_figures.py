"""ISO 9283 figures of poses as values: lengths are mm here and um in `to_dict`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ptt.record import Record

Array = NDArray[np.float64]

POSE_CYCLES = 30  # the standard asks for so many cycles


@dataclass(frozen=True)
class PoseFigures:
    """One pose approached the same way under the same load in n cycles.

    Attributes:
        target: (3,) commanded position, mm.
        direction: (k,) directions of arrival +1 or -1; empty where they were not told apart.
        payload: kg, NaN where unknown.
        rows: (n,) rows it was measured in, in time order.
        offset: (3,) mean less target, mm.
        accuracy: AP = |offset|, mm.
        repeatability: RP = mean l + 3 s_l with l_j = |x_j - mean|, mm.
    """

    target: Array
    direction: tuple[int, ...]
    payload: float
    rows: NDArray[np.intp]
    offset: Array
    accuracy: float
    repeatability: float

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "target_mm": self.target.tolist(),
            "direction": list(self.direction) or None,
            "payload_kg": None if np.isnan(self.payload) else self.payload,
            "cycles": len(self.rows),
            "offset_um": (1e3 * self.offset).tolist(),
            "AP_um": 1e3 * self.accuracy,
            "RP_um": 1e3 * self.repeatability,
        }


@dataclass(frozen=True)
class DirectionVariation(Record):
    """How far the means of one pose lie apart when it is approached from different sides.

    Attributes:
        target: (3,) mm.
        directions: number of ways of arrival compared.
        variation: vAP, the largest distance between two of the means, mm.
    """

    keys: ClassVar[str] = "target_mm: target, directions, vAP_um: variation [um]"

    target: Array
    directions: int
    variation: float


@dataclass(frozen=True)
class DistanceFigures(Record):
    """Distance between two poses, cycle by cycle.

    Attributes:
        commanded: mm.
        cycles: pairs of readings.
        accuracy: AD = mean distance less commanded, mm, with its sign.
        repeatability: RD = 3 s of the distance, mm.
    """

    keys: ClassVar[str] = "commanded_mm: commanded, cycles, AD_um: accuracy [um], RD_um: repeatability [um]"

    commanded: float
    cycles: int
    accuracy: float
    repeatability: float


@dataclass(frozen=True)
class Drift(Record):
    """Change of one pose's figures over time, by groups of cycles against the first group.

    Attributes:
        target: (3,) mm.
        group: cycles in a group.
        accuracy: dAP = max |AP - AP of the first group|, mm.
        repeatability: dRP likewise, mm.
    """

    keys: ClassVar[str] = "target_mm: target, group_cycles: group, dAP_um: accuracy [um], dRP_um: repeatability [um]"

    target: Array
    group: int
    accuracy: float
    repeatability: float


@dataclass(frozen=True)
class PoseReport:
    """ISO 9283 figures of a run.

    Attributes:
        poses: those measured at least twice, in the order of first visit.
        variations: one per target reached from several sides.
        distances: between poses that follow one another in `poses`, the same way of arrival or not.
        drifts: one per pose with at least four cycles.
        single: number of poses measured once only, left out.
    """

    poses: tuple[PoseFigures, ...]
    variations: tuple[DirectionVariation, ...]
    distances: tuple[DistanceFigures, ...]
    drifts: tuple[Drift, ...]
    single: int

    @property
    def cycles(self) -> int:
        """The fewest cycles of any pose."""
        return min(len(pose.rows) for pose in self.poses)

    @property
    def standard(self) -> str:
        """What these figures may be called."""
        return "ISO 9283:1998" if self.cycles >= POSE_CYCLES else f"ISO style, n = {self.cycles}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON: the figures' mean and worst, then each of them."""
        return {
            "standard": self.standard,
            "cycles": self.cycles,
            "single_poses": self.single,
            "AP_um": _mean_and_worst([pose.accuracy for pose in self.poses]),
            "RP_um": _mean_and_worst([pose.repeatability for pose in self.poses]),
            "vAP_um": _mean_and_worst([one.variation for one in self.variations]),
            "AD_um": _mean_and_worst([one.accuracy for one in self.distances]),
            "RD_um": _mean_and_worst([one.repeatability for one in self.distances]),
            "dAP_um": _mean_and_worst([one.accuracy for one in self.drifts]),
            "dRP_um": _mean_and_worst([one.repeatability for one in self.drifts]),
            "poses": [pose.to_dict() for pose in self.poses],
            "variations": [one.to_dict() for one in self.variations],
            "distances": [one.to_dict() for one in self.distances],
            "drifts": [one.to_dict() for one in self.drifts],
        }


def _mean_and_worst(values: Sequence[float]) -> dict[str, float] | None:
    """Mean and the value of largest size, um; None for none."""
    if not values:
        return None
    return {"mean": 1e3 * float(np.mean(values)), "worst": 1e3 * float(max(values, key=abs))}


def named_figures(figures: dict[str, Any]) -> list[tuple[str, dict[str, float] | None]]:
    """The figures of a run under the standard's names.

    Args:
        figures: what `ptt iso` gives in JSON for poses.

    Returns:
        Name, and mean and worst over the poses in um, None where the run does not tell them.
    """
    before, after = figures["as_measured"], figures["aligned"]
    return [
        ("accuracy AP, as measured", before["AP_um"]),
        ("accuracy AP, aligned", after["AP_um"]),
        ("repeatability RP", after["RP_um"]),
        ("variation by direction vAP", after["vAP_um"]),
        ("distance accuracy AD", after["AD_um"]),
        ("distance repeatability RD", after["RD_um"]),
        ("drift of AP, aligned", after["dAP_um"]),
        ("drift of RP", after["dRP_um"]),
    ]
