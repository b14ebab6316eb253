"""A machine file in figures: slider heights at home and reach of the tool."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from ptt.machine import MachineFile, SerialSpec, ThreePttSpec
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.dexterity import NEAR_RATIO, singularities
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_reach import reach_within_limits
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.setup.arm_lengths import remarks_on

DIRECTIONS = 72  # every 5 degrees
STEPS = 200  # of the search for the reach: 0.5 % of a link sideways, 1 % in z
EVEN_DEG = 0.0, 120.0, 240.0  # the best azimuths: where even they hold the tool badly, azimuths are not the reason


@dataclass(frozen=True)
class MachineSaid:
    """A machine file in figures.

    Attributes:
        kind: 'three-ptt' or 'serial'.
        name: of the machine.
        home_mm: slider heights at p = 0 (joint values at the home of an arm, rad).
        travel_mm: (2, k) ends of travel.
        reach_mm: radius at z = 0 that the tool reaches in every direction, least and greatest z at x = y = 0; of an arm
            the greatest distance from the base's z axis, least and greatest z anywhere.
        remarks: what is odd about it.
    """

    kind: str
    name: str
    home_mm: np.ndarray
    travel_mm: np.ndarray
    reach_mm: tuple[float, float, float]
    remarks: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Keys as `ptt check MACHINE.toml --json` writes them."""
        unit = "mm" if self.kind == "three-ptt" else "rad"
        return {
            "ok": True,
            "findings": [],
            "machine": self.name,
            f"home_{unit}": self.home_mm.tolist(),
            f"travel_{unit}": self.travel_mm.T.tolist(),
            "reach_mm": {"sideways": self.reach_mm[0], "z": list(self.reach_mm[1:])},
            "remarks": list(self.remarks),
        }

    def __str__(self) -> str:
        """Two or three lines and the remarks."""
        if self.kind == "serial":
            sideways, low, high = self.reach_mm
            reach = f"at most {sideways:.0f} mm from the base's z axis; z from {low:.0f} to {high:.0f} mm"
            limits = "within the limits" if np.isfinite(self.travel_mm).all() else "a joint without limits turns once"
            lines = [f"{self.name}: {len(self.home_mm)} joints", f"reach: {reach} ({limits})"]
            return "\n".join([*lines, *(f"remark: {remark}" for remark in self.remarks)])
        home = ", ".join(f"b{leg + 1} = {value:.3f}" for leg, value in enumerate(self.home_mm))
        ends = ", ".join(f"{low:g} to {high:g}" for low, high in dict.fromkeys(map(tuple, self.travel_mm.T.tolist())))
        sideways, low, high = self.reach_mm
        reach = (
            f"reach: {sideways:.0f} mm sideways at z = 0 in every direction; "
            f"z from {low:.0f} to {high:.0f} mm in the middle"
        )
        if not np.isfinite(self.reach_mm).all():
            reach = "reach: none in the middle, for the sliders at x = y = z = 0 lie outside the travel"
        lines = [
            f"{self.name}: the tool is at x = y = z = 0 with the sliders at {home} mm",
            f"travel {ends} mm",
            reach,
        ]
        return "\n".join([*lines, *(f"remark: {remark}" for remark in self.remarks)])


def describe_machine(file: MachineFile) -> MachineSaid:
    """Put a machine file in figures.

    Args:
        file: the machine.

    Returns:
        The figures.

    Raises:
        MachineError: its dimensions cannot be built.
    """
    mechanism = build_mechanism(file.machine)
    if not isinstance(mechanism, ThreePtt) or not isinstance(file.machine, ThreePttSpec):
        assert isinstance(mechanism, Serial)
        home, ends = mechanism.home().numpy(), mechanism.limits().numpy()
        assert isinstance(file.machine, SerialSpec)
        reach, remarks = reach_within_limits(mechanism), remarks_on(file.machine)
        return MachineSaid("serial", file.machine.name, home, ends, reach, remarks)
    home, ends = mechanism.home().numpy(), mechanism.limits().numpy()
    return MachineSaid(
        "three-ptt", file.machine.name, home, ends, reach_of(mechanism), tuple(_remarks(file.machine, home, ends))
    )  # fmt: skip


def reach_of(mechanism: ThreePtt) -> tuple[float, float, float]:
    """Reach of the tool, by a search in steps from the centre.

    Args:
        mechanism: the machine.

    Returns:
        Radius, mm, reached in every direction at z = 0, least and greatest z on the axis; NaN where p = 0 is out of
        travel.
    """
    scale = float(mechanism.link.max())
    angle = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
    out = scale * np.linspace(0.0, 1.0, STEPS + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(DIRECTIONS)], axis=1)
    sideways = np.atleast_1d(reachable(mechanism, out[:, None, None] * ring).all(axis=1))
    column = np.zeros((2 * STEPS + 1, 3))
    column[:, 2] = 2.0 * scale * np.linspace(-1.0, 1.0, 2 * STEPS + 1)
    upright = np.atleast_1d(reachable(mechanism, column))
    if not sideways[0]:
        return np.nan, np.nan, np.nan
    last = int(np.argmin(sideways)) - 1 if not sideways.all() else STEPS
    down = STEPS - int(np.argmin(upright[STEPS::-1])) + 1 if not upright[STEPS::-1].all() else 0
    up = STEPS + int(np.argmin(upright[STEPS:])) - 1 if not upright[STEPS:].all() else 2 * STEPS
    return float(out[last]), float(column[down, 2]), float(column[up, 2])


def reachable(mechanism: ThreePtt, points: np.ndarray) -> np.ndarray:
    """Points that the sliders reach within their travel: (..., 3) mm -> (...) bool."""
    q = mechanism.inverse(torch.as_tensor(points.reshape(-1, 3), dtype=torch.float64)).numpy()
    low, high = mechanism.limits().numpy()
    return np.asarray(((q >= low) & (q <= high)).all(axis=1).reshape(points.shape[:-1]))


def _remarks(spec: ThreePttSpec, home: np.ndarray, ends: np.ndarray) -> list[str]:
    found = []
    if ((home < ends[0]) | (home > ends[1])).any():
        other = "below" if spec.sliders == "above" else "above"
        mirrored = 2.0 * spec.joint_height_mm - home
        inside = ((mirrored >= ends[0]) & (mirrored <= ends[1])).all()
        hint = f'; with sliders = "{other}" it would lie within' if inside else ""
        found.append(f"home lies outside the travel{hint}")
    if spec.platform_radius_mm > spec.base_radius_mm:
        found.append("the platform is wider than the base: are the two radii interchanged?")
    return found + _weak_hold_remarks(spec)


def _weak_hold_remarks(spec: ThreePttSpec) -> list[str]:
    """A remark on a drawing that is close to a singularity at home, where every error of a slider is amplified."""
    hold = _hold(spec)
    if not hold < NEAR_RATIO:
        return []
    grows = (
        f"a slider's error may grow {1.0 / hold:.0f}-fold on its way to it" if hold > 0.0 else "locked sliders do not"
    )
    if _hold(_at_azimuths(spec, EVEN_DEG)) < NEAR_RATIO:
        return [f"the links hardly hold the tool at home: {grows} (`ptt dexterity` says more)"]
    azimuths = spec.slider_azimuth_deg
    remark = f"the towers stand so close (azimuths {_listed(azimuths)} deg) that the tool is hardly held: {grows}"
    turned = tuple(float(np.degrees(value)) for value in azimuths)
    if max(map(abs, azimuths)) < 2.0 * np.pi and _hold(_at_azimuths(spec, turned)) >= NEAR_RATIO:
        return [f"{remark}; perhaps they are in rad, and would be {_listed(turned)} deg"]
    return [remark]


def _hold(spec: ThreePttSpec) -> float:
    """How well links and joints hold the tool at home: least singular value of their directions, NaN out of reach."""
    margins = singularities(ThreePtt.from_spec(spec), torch.zeros(1, 3, dtype=torch.float64))
    return float(torch.minimum(margins.direct, margins.constraint))


def _at_azimuths(spec: ThreePttSpec, azimuths: tuple[float, ...]) -> ThreePttSpec:
    return spec.model_copy(update={"slider_azimuth_deg": azimuths})


def _listed(values: tuple[float, ...]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)
