"""Kinematics of the 3-PTT: three sliders, three links with universal joints, a platform that only translates.

Because the platform does not rotate, the offset from platform joint to tool is constant, and rail i is shifted by it.
What is left is a virtual joint centre c_i on each shifted rail, a link length L_i away from the tool point p:
|p - c_i| = L_i, c_i = foot_i + q_i rail_i.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.errors import MachineError
from ptt.machine import ThreePttSpec
from ptt.mechanisms.spheres import dot, in_blocks, intersect_spheres, rows_last, with_batch_axes

LEGS = 3
LEG_SLOTS = ("centre x [mm]", "centre y [mm]", "centre z [mm]", "link length [mm]")
SLOTS = (
    *(f"leg {leg} {slot}" for leg in (1, 2, 3) for slot in LEG_SLOTS),
    *(f"tool {axis} [mm]" for axis in "xyz"),
)


@dataclass(frozen=True, eq=False)
class ThreePtt:
    """A 3-PTT of any leg geometry.

    Attributes:
        foot: (3, 3) mm, virtual joint centre of each leg at slider height 0 (joint on the slider less platform joint).
        rail: (3, 3), unit vector of each rail, along growing slider height.
        link: (3,) mm, link lengths.
        outer_axis: (3, 3), unit vector of the universal joints' axis that is fixed to slider and platform.
        above: whether each slider is beyond the platform along its rail; it tells the inverse's two roots apart.
        side: +1 or -1, on which side of the plane c_1 c_2 c_3 (normal (c_2 - c_1) x (c_3 - c_1)) the platform is.
        joint_height_mm: how far the slider joint lies below the point whose height q_i is, already in `foot`.
        travel_mm: least and greatest height of each slider, None where not known.
    """

    foot: Tensor
    rail: Tensor
    link: Tensor
    outer_axis: Tensor
    above: bool
    side: float
    joint_height_mm: float = 0.0
    travel_mm: tuple[tuple[float, float], ...] | None = None

    joints: ClassVar[int] = LEGS
    slots: ClassVar[tuple[str, ...]] = SLOTS

    @classmethod
    def from_spec(cls, spec: ThreePttSpec) -> ThreePtt:
        """Build the mechanism that a machine file describes.

        A leaning rail turns about its slider's place at p = 0, so the home pose is that of the upright machine, as long
        as the slider stays on its side of the link.

        Args:
            spec: the [machine] section.

        Returns:
            The mechanism.

        Raises:
            MachineError: the links are too short to reach p = 0.
        """
        azimuth, lean = (torch.deg2rad(_tensor(angles)) for angles in (spec.slider_azimuth_deg, spec.slider_lean_deg))
        radial = torch.stack((azimuth.cos(), azimuth.sin(), torch.zeros(LEGS, dtype=torch.float64)), -1)
        upward = _tensor((0.0, 0.0, 1.0))
        rail = lean.sin()[:, None] * radial + lean.cos()[:, None] * upward
        spread = spec.base_radius_mm - spec.platform_radius_mm
        if spec.link_length_mm <= abs(spread):
            what = f"link_length_mm = {spec.link_length_mm} cannot span the radii' difference of {spread} mm"
            raise MachineError(what, where="[machine]", fix="lengthen the links or bring the radii together")
        drop = math.sqrt(spec.link_length_mm**2 - spread**2)
        pivot_height = spec.joint_height_mm + (drop if spec.sliders == "above" else -drop)
        pivot = spec.base_radius_mm * radial + pivot_height * upward
        return cls.from_legs(
            rail_foot=pivot - pivot_height * rail,
            rail_direction=rail,
            link_length=[spec.link_length_mm] * LEGS,
            platform_joint=spec.platform_radius_mm * radial,
            above=spec.sliders == "above",
            joint_height_mm=spec.joint_height_mm,
            travel_mm=spec.travel_ends,
            outer_axis=torch.stack((-azimuth.sin(), azimuth.cos(), torch.zeros(LEGS, dtype=torch.float64)), -1),
        )

    @classmethod
    def from_legs(
        cls,
        rail_foot: Tensor | Sequence[Sequence[float]],
        rail_direction: Tensor | Sequence[Sequence[float]],
        link_length: Tensor | Sequence[float],
        platform_joint: Tensor | Sequence[Sequence[float]],
        *,
        above: bool = True,
        joint_height_mm: float = 0.0,
        travel_mm: tuple[tuple[float, float], ...] | None = None,
        outer_axis: Tensor | Sequence[Sequence[float]] | None = None,
    ) -> ThreePtt:
        """Build a mechanism leg by leg.

        Args:
            rail_foot: (3, 3) mm, point of each rail at slider height 0.
            rail_direction: (3, 3), direction of each rail, any length.
            link_length: (3,) mm.
            platform_joint: (3, 3) mm, platform joint of each leg from the tool point.
            above: whether each slider is beyond the platform along its rail.
            joint_height_mm: how far the slider joint lies below the point whose height q_i is.
            travel_mm: least and greatest height of each slider.
            outer_axis: (3, 3), outer axis of the universal joints; None takes the horizontal tangent of `rail_foot`.

        Returns:
            The mechanism.
        """
        base = _tensor(rail_foot)
        rail = torch.nn.functional.normalize(_tensor(rail_direction), dim=-1, eps=0.0)
        upward = _tensor((0.0, 0.0, 1.0))
        foot = base - _tensor(platform_joint) - joint_height_mm * upward
        tangent = torch.linalg.cross(upward.expand_as(base), base) if outer_axis is None else _tensor(outer_axis)
        axis = torch.nn.functional.normalize(tangent, dim=-1)
        link = _tensor(link_length)
        side = _platform_side(foot, rail, link, above)
        return cls(foot, rail, link, axis, above, side, joint_height_mm, travel_mm)

    @property
    def outward(self) -> Tensor:
        """Horizontal unit vectors from the middle to each slider, (3, 3)."""
        return torch.linalg.cross(self.outer_axis, _tensor((0.0, 0.0, 1.0)).expand_as(self.outer_axis))

    @property
    def across(self) -> Tensor:
        """Unit vectors at right angles to each rail, the way that its upper end leans outward, (3, 3)."""
        return torch.linalg.cross(self.outer_axis, self.rail)

    @property
    def flat(self) -> Tensor:
        """Rails nearer to the horizontal than to the vertical, (3,) bool: what lies outward lies along them."""
        return (self.rail * self.outward).sum(dim=-1).abs() > self.rail[:, 2].abs()

    @property
    def foot_direction(self) -> Tensor:
        """Unit vectors along which a rail's foot may be misplaced besides tangentially, (3, 3): outward.

        On a flat rail they are those across it, since outward is along the rail there, which is a homing offset.
        """
        return torch.where(self.flat[:, None], self.across, self.outward)

    def forward(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Tool position of slider heights: three spheres, closed form.

        Source: three-sphere intersection in the basis of two edges and their normal (trilateration).

        Args:
            q: float64 tensor (n, 3) mm, slider heights.
            geometry: (n, 15) or (1, 15) mm, shift of each slot in `slots`.

        Returns:
            p: (n, 3) mm, NaN where the spheres do not meet.
        """
        return in_blocks(self._forward, q, geometry)

    def inverse(self, p: Tensor, geometry: Tensor | None = None, near: Tensor | None = None) -> Tensor:
        """Slider heights of a tool position.

        Source: |p - foot_i - q_i rail_i| = L_i solved for q_i; on upright rails b_i = Z + h +- sqrt(L^2 - |q_i|^2),
        plus for sliders above the platform.

        Args:
            p: float64 tensor (n, 3) mm, tool positions.
            geometry: (n, 15) or (1, 15) mm, shift of each slot in `slots`.
            near: not used; of a leg's two roots `above` says which.

        Returns:
            q: (n, 3) mm, NaN where a link is too short.
        """
        return in_blocks(self._inverse, p, geometry)

    def jacobian(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Derivative of the tool position by the slider heights.

        Source: s_i . dp = (s_i . rail_i) dq_i for each link vector s_i, inverted by cross products.

        Args:
            q: float64 tensor (n, 3) mm, slider heights.
            geometry: (n, 15) or (1, 15) mm, shift of each slot in `slots`.

        Returns:
            dp/dq: (n, 3, 3) mm per mm, row x, y, z, column slider.
        """
        return in_blocks(self._jacobian, q, geometry)

    def link_vectors(self, p: Tensor) -> Tensor:
        """Link vectors s_i from the slider joint to the platform joint.

        Args:
            p: (n, 3) mm, tool positions.

        Returns:
            s: (n, 3, 3) mm, row leg, column x, y, z; NaN where out of reach.
        """
        centre, _, _ = self._spheres(rows_last(self.inverse(p)), None)
        return (rows_last(p) - centre).movedim((0, 1), (-2, -1))

    def home(self) -> Tensor:
        """Slider heights at p = 0.

        Returns:
            q0: (3,) mm.

        Raises:
            MachineError: p = 0 is out of reach.
        """
        q = self.inverse(torch.zeros(1, LEGS, dtype=torch.float64))[0]
        if not bool(torch.isfinite(q).all()):
            raise MachineError("the tool cannot reach p = 0", fix="count tool positions from inside the workspace")
        return q

    def limits(self) -> Tensor:
        """Ends of travel.

        Returns:
            (2, 3) mm, lower ends first, infinite where not known.
        """
        return _tensor(((-math.inf, math.inf),) * LEGS if self.travel_mm is None else self.travel_mm).T

    def _forward(self, q: Tensor, geometry: Tensor | None) -> Tensor:
        """`forward` of one block."""
        centre, link, tool = self._spheres(rows_last(q), geometry)
        p = intersect_spheres(centre, link, self.side)
        return (p if tool is None else p + tool).movedim(0, -1)

    def _inverse(self, p: Tensor, geometry: Tensor | None) -> Tensor:
        """`inverse` of one block."""
        foot, link, tool = self._spheres(None, geometry, p.ndim - 1)
        at = rows_last(p)
        reach = (at if tool is None else at - tool) - foot  # shape: (leg, xyz, n)
        along = dot(reach, with_batch_axes(self.rail, p.ndim - 1), 1)
        drop = torch.sqrt(torch.addcmul(link * link - dot(reach, reach, 1), along, along))
        return (along + drop if self.above else along - drop).movedim(0, -1)

    def _jacobian(self, q: Tensor, geometry: Tensor | None) -> Tensor:
        """`jacobian` of one block."""
        centre, link, _ = self._spheres(rows_last(q), geometry)
        vector = intersect_spheres(centre, link, self.side) - centre  # shape: (leg, xyz, n)
        along = dot(vector, with_batch_axes(self.rail, q.ndim - 1), 1)
        minor = torch.linalg.cross(vector.roll(-1, 0), vector.roll(-2, 0), dim=1)
        volume = dot(vector[0], minor[0], 0)
        return (minor * (along / volume).unsqueeze(1)).movedim((1, 0), (-2, -1))

    def _spheres(
        self, q: Tensor | None, geometry: Tensor | None, batch_axes: int = 1
    ) -> tuple[Tensor, Tensor, Tensor | None]:
        """Centres (leg, xyz, n), radii (leg, n) and tool shift (xyz, n) or None, mm; q (leg, n) mm, None is 0."""
        axes = batch_axes if q is None else q.ndim - 1
        centre, link = with_batch_axes(self.foot, axes), with_batch_axes(self.link, axes)
        if q is not None:
            centre = torch.addcmul(centre, with_batch_axes(self.rail, axes), q.unsqueeze(1))
        if geometry is None:
            return centre, link, None
        shift = rows_last(geometry)
        legs = shift[: LEGS * len(LEG_SLOTS)].unflatten(0, (LEGS, len(LEG_SLOTS)))
        return centre + legs[:, :3], link + legs[:, 3], shift[LEGS * len(LEG_SLOTS) :]


def _tensor(values: Tensor | Sequence[float] | Sequence[Sequence[float]]) -> Tensor:
    """Float64 tensor of numbers."""
    return torch.as_tensor(values, dtype=torch.float64)


def _platform_side(foot: Tensor, rail: Tensor, link: Tensor, above: bool) -> float:
    """+1 or -1, side of the centres' plane that holds the platform, the legs' order being what turns its normal."""
    along = -(foot * rail).sum(-1)
    drop = torch.sqrt(link**2 - ((foot + along[:, None] * rail) ** 2).sum(-1))
    height = torch.nan_to_num(along + drop if above else along - drop)
    centre = foot + height[:, None] * rail
    normal = torch.linalg.cross(centre[1] - centre[0], centre[2] - centre[0])
    upward = float(normal @ rail.sum(0)) >= 0.0
    return -1.0 if upward == above else 1.0
