"""Serial arms of revolute joints: Denavit-Hartenberg kinematics with an error slot for every link parameter."""

import functools
import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from ptt.machine import SerialSpec
from ptt.mechanisms.serial_chain import Link, LinkFrames, carry, walk
from ptt.mechanisms.serial_inverse import sample_joints, solve_inverse

LINK_SLOTS = ("da [mm]", "dalpha [rad]", "dd [mm]", "dtheta [rad]", "dbeta [rad]")
TOOL_SLOTS = ("tool x [mm]", "tool y [mm]", "tool z [mm]")
PARALLEL_RAD = 0.02  # axes closer than this have a common normal that jumps under tiny errors


@dataclass(frozen=True)
class Serial:
    """A serial arm as its drawing says, with k revolute joints.

    Every link is a screw about z and one about x. Standard convention: Z_1 X_1 ... Z_k X_k, tool; modified (Craig):
    X_1 Z_1 ... X_k Z_k, tool, where Z_i = Rot(z, q_i + offset_i + dtheta_i) Trans(z, d_i + dd_i) and
    X_i = Trans(x, a_i + da_i) Rot(x, alpha_i + dalpha_i) Rot(y, dbeta_i). The Hayati rotation dbeta therefore tilts
    axis i + 1 against axis i in the standard convention, and axis i against axis i - 1 in the modified one
    (Hayati and Mirmirani, Improving the absolute positioning accuracy of robot manipulators, 1985).

    Geometry slots: five per joint in the order of `LINK_SLOTS`, then the tool's shift in its own frame.

    Attributes:
        name: what the machine file calls it.
        convention: which side of the joint the link's x screw lies on.
        a_mm: (k,) link lengths.
        alpha_rad: (k,) link twists.
        d_mm: (k,) link offsets.
        offset_rad: (k,) what is added to the joint value.
        tool_mm: (3,) tool point in the last link's frame.
        limits_rad: (k, 2) lower and upper joint limit, infinite where the machine file gives none.
    """

    name: str
    convention: Literal["standard", "modified"]
    a_mm: tuple[float, ...]
    alpha_rad: tuple[float, ...]
    d_mm: tuple[float, ...]
    offset_rad: tuple[float, ...]
    tool_mm: tuple[float, float, float]
    limits_rad: tuple[tuple[float, float], ...]

    @classmethod
    def from_spec(cls, spec: SerialSpec) -> "Serial":
        """Build the arm from its machine file.

        Args:
            spec: the [machine] table.

        Returns:
            The nominal arm.
        """
        everywhere = (-math.inf, math.inf)
        limits = [everywhere if joint.limits_deg is None else joint.limits_deg for joint in spec.joint]
        return cls(
            name=spec.name,
            convention=spec.convention,
            a_mm=tuple(joint.a_mm for joint in spec.joint),
            alpha_rad=tuple(math.radians(joint.alpha_deg) for joint in spec.joint),
            d_mm=tuple(joint.d_mm for joint in spec.joint),
            offset_rad=tuple(math.radians(joint.theta_offset_deg) for joint in spec.joint),
            tool_mm=spec.tool_mm,
            limits_rad=tuple((math.radians(low), math.radians(high)) for low, high in limits),
        )

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return len(self.a_mm)

    @property
    def slots(self) -> tuple[str, ...]:
        """Names of the G = 5 k + 3 geometry slots."""
        return tuple(f"joint {i + 1} {slot}" for i in range(self.joints) for slot in LINK_SLOTS) + TOOL_SLOTS

    @property
    def reach_mm(self) -> float:
        """A length the tool cannot get farther than from the base: the sum over links of hypot(a, d), and the tool."""
        return sum(math.hypot(a, d) for a, d in zip(self.a_mm, self.d_mm, strict=True)) + math.hypot(*self.tool_mm)

    @property
    def length_mm(self) -> float:
        """Characteristic length: a rotation by one radian counts as much as a shift by this.

        It is the root mean square, over joint values spread over the limits and over all joints, of the distance from
        the tool point to the joint axis, so that translation and rotation columns of the Jacobian are alike in size.
        """
        return _characteristic_length(self)

    def limits(self) -> Tensor:
        """Ends of travel: (2, k) rad, lower ends first, infinite where there is none."""
        return torch.tensor(self.limits_rad, dtype=torch.float64).T

    def home(self) -> Tensor:
        """Joint values that errors are referred to, (k,) rad: all zero, where the encoders read nothing."""
        return torch.zeros(self.joints, dtype=torch.float64)

    def parallel_axes(self) -> tuple[bool, ...]:
        """Tell per joint whether its x screw joins two (nearly) parallel joint axes in the drawing.

        There the common normal is ill defined: dbeta_i is the parameter to use, and dd_i does the same as dd of the
        other joint of the pair (i + 1 in the standard convention, i - 1 in the modified one).

        Returns:
            k flags; the x screw outside the first or last axis joins no pair and is never flagged.
        """
        alone = self.joints - 1 if self.convention == "standard" else 0
        return tuple(i != alone and abs(math.sin(alpha)) < PARALLEL_RAD for i, alpha in enumerate(self.alpha_rad))

    def links(self, geometry: Tensor | None = None) -> tuple[Link, ...]:
        """Add the geometry errors to the drawing's link parameters.

        Args:
            geometry: (..., G) errors of the geometry slots; None for the drawing.

        Returns:
            k links; numbers for the drawing, tensors (...,) with errors.
        """
        drawing = zip(self.a_mm, self.alpha_rad, self.d_mm, self.offset_rad, strict=True)
        if geometry is None:
            return tuple(Link(*values) for values in drawing)
        errors = geometry[..., :-3].unflatten(-1, (self.joints, 5)).unbind(-2)
        return tuple(Link(*values).shifted(*error.unbind(-1)) for values, error in zip(drawing, errors, strict=True))

    def tool(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Place the tool point in the last link's frame, (..., 3) or (3,) mm."""
        nominal = torch.tensor(self.tool_mm, dtype=q.dtype, device=q.device)
        return nominal if geometry is None else nominal + geometry[..., -3:]

    def walk(self, q: Tensor, geometry: Tensor | None = None) -> tuple[LinkFrames, ...]:
        """Follow the chain from the base; see `ptt.mechanisms.serial_chain.walk`."""
        return walk(self.links(geometry), q, self.convention == "standard")

    def forward(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Place the tool point.

        Args:
            q: float64 tensor (..., k) joint values, rad.
            geometry: (..., G) or (1, G) errors of the geometry slots, mm and rad; None for the drawing.

        Returns:
            (..., 3) tool position in the base frame, mm.
        """
        return carry(self.tool(q, geometry), self.links(geometry), q, self.convention == "standard")

    def pose(self, q: Tensor, geometry: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Place the tool with its orientation.

        Args:
            q: (..., k) joint values, rad.
            geometry: (..., G) or (1, G) errors of the geometry slots; None for the drawing.

        Returns:
            (..., 3) tool position, mm, and (..., 3, 3) rotation whose columns are the tool axes n, o, a.
        """
        end = self.walk(q, geometry)[-1].end
        return end.point(self.tool(q, geometry)), end.rotation()

    def frames(self, q: Tensor, geometry: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Place every link, for instance to find where its centre of mass is.

        Args:
            q: (..., k) joint values, rad.
            geometry: (..., G) or (1, G) errors of the geometry slots; None for the drawing.

        Returns:
            (..., k, 3) origins of the frames that the links carry (behind X_i in the standard convention, behind Z_i in
            the modified one), mm, and (..., k, 3, 3) their rotations.
        """
        ends = [link.end for link in self.walk(q, geometry)]
        origins = torch.broadcast_tensors(*(end.origin for end in ends))
        rotations = torch.broadcast_tensors(*(end.rotation() for end in ends))
        return torch.stack(origins, -2), torch.stack(rotations, -3)

    def jacobian(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Differentiate the tool position by the joints: dp/dq, z_i x (p - o_i) about each axis.

        Args:
            q: float64 tensor (..., k) joint values, rad.
            geometry: (..., G) or (1, G) errors of the geometry slots; None for the drawing.

        Returns:
            (..., 3, k) mm/rad.
        """
        return self.pose_jacobian(q, geometry)[..., :3, :]

    def pose_jacobian(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Differentiate the tool pose by the joints: the geometric Jacobian.

        Args:
            q: (..., k) joint values, rad.
            geometry: (..., G) or (1, G) errors of the geometry slots; None for the drawing.

        Returns:
            (..., 6, k): velocity of the tool point, mm/rad, above the angular velocity, rad/rad, in the base frame.
        """
        links = self.walk(q, geometry)
        tip = links[-1].end.point(self.tool(q, geometry))
        columns = [link.before_z.revolute_twist("z", tip) for link in links]
        return torch.stack(torch.broadcast_tensors(*columns), -1)

    def geometry_jacobian(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Differentiate the tool pose by the geometry slots: the differential error model.

        Source: Hui Jizhuang et al. (2016), eqs. 7 and 8, the sum over links of the partial derivatives by theta, d, a
        and alpha, here with the orientation as a small rotation vector and with the Hayati angle.

        Args:
            q: (..., k) joint values, rad.
            geometry: (..., G) or (1, G) errors around which to differentiate; None for the drawing.

        Returns:
            (..., 6, G): shift of the tool point, mm per slot unit, above its rotation, rad per slot unit.
        """
        links = self.walk(q, geometry)
        tip = links[-1].end.point(self.tool(q, geometry))
        columns = [column for link in links for column in link.columns(tip)]
        end = links[-1].end
        columns += [end.prismatic_twist("x"), end.prismatic_twist("y"), end.prismatic_twist("z")]
        return torch.stack(torch.broadcast_tensors(*columns), -1)

    def inverse(
        self,
        p: Tensor,
        geometry: Tensor | None = None,
        near: Tensor | None = None,
        *,
        rotation: Tensor | None = None,
    ) -> Tensor:
        """Find joint values within the limits that reach tool positions or poses.

        Args:
            p: float64 tensor (n, 3) tool positions, mm.
            geometry: (n, G) or (1, G) errors of the geometry slots; None for the drawing.
            near: (n, k) or (1, k) joint values to start from and, where joints are to spare, to stay close to; rad.
            rotation: (n, 3, 3) tool orientations; None leaves the orientation free.

        Returns:
            (n, k) joint values, rad; NaN rows where none was found. `solve_inverse` also says how well.
        """
        return solve_inverse(self, p, rotation=rotation, geometry=geometry, near=near).q


@functools.lru_cache(maxsize=64)
def _characteristic_length(arm: Serial) -> float:
    jacobian = arm.pose_jacobian(sample_joints(arm, 4096))[:, :3]
    return max(float(jacobian.square().sum(1).mean().sqrt()), 1.0)
